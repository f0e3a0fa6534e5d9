"""A fleet: many reaches under one directory, each run as if it were alone, by one pool of workers.

DATA_DIR/<reach>/ holds the logs of a reach, OUT/<reach>/ its results. What is said of all of them together
lies in OUT itself: fleet.html, fleet.csv, fleet.parquet and fleet.json.
"""
