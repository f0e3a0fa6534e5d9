"""The library's results and functions: the commands' work on arrays and logs.

``rivid.read_day``, ``rivid.jmap`` and the others are exported lazily by :mod:`rivid` itself.
"""
