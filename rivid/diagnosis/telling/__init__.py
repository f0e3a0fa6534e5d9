"""From a study to an answer, a page, pictures and files."""
