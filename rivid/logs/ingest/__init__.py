"""Exports of other systems to daily logs: only what is declared, and every value accounted for.

`export` reads a file, `series` joins the files to one series per source, `signals` makes of these the
canonical columns, `days` judges each day as `rivid run` would, `ledger` counts, `place` writes,
`settings` says how the result is to be read, and `work` is all of it.
"""
