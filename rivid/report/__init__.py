"""The pages of a run and of a diagnosis, and their summaries."""
