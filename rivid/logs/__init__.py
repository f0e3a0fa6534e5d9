"""Reading and writing daily logs: find the days, read them as declared in `[input]`, put them on a grid.

A day passes `spec` (what the configuration declares; times, names and sizes of files), `text` (text files),
`log` (a file in memory, read by Arrow where it is clean) and `days` (find the days, put them on the grid).
"""
