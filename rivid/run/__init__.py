"""A run: plan, batches of days, workers, figures."""
