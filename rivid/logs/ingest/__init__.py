"""Exports of other systems to daily logs: only what is declared, and every value accounted for.

`series` reads the files and joins them to one series per source, `days` makes canonical columns of these and
judges each day as `rivid run` would, `work` writes the days and the configuration for them.
"""
