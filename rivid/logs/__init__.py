"""Reading and writing daily logs: find the days, read them as declared in `[input]`, put them on a grid.

`find` lists the days; `read` makes a data set of consecutive days. Between the two: `spec` (what the
configuration declares), `files` (bytes, with limits), `csvfast` and `csvtext` (CSV, quick and tolerant),
`parquet`, `numbers` and `times` (texts to numbers), `log` and `load` (a file in memory), `grid` (samples).
"""
