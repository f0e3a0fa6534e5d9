"""A fleet: many reaches under one directory, run by one pool of workers, each as if it were alone.

DATA_DIR/<reach>/ holds the logs of a reach, OUT/<reach>/ its results. The report on all reaches is in OUT
itself: fleet.html, fleet.csv, fleet.parquet and fleet.json.
"""
