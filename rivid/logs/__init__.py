"""Reading and writing daily logs: find the days, read them as declared in `[input]`, put them on a grid.

A day passes `spec` (what the configuration declares; times, names and sizes of files), `text` (text files),
`log` (a file in memory, read by Arrow where it is clean) and `days` (find the days, put them on the grid).
"""

SUFFIXES = (".csv", ".csv.gz", ".parquet")
"""Endings of the names of logs."""


def suffix_of(name: str) -> str | None:
    """The suffix of a log's name, in small letters; None for a name that is no log's."""
    lower = name.lower()
    return next((s for s in SUFFIXES[::-1] if lower.endswith(s)), None)
