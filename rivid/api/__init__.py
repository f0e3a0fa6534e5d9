"""The library's front door: a few words for what the commands do, on arrays and on logs.

``rivid.read_day``, ``rivid.jmap`` and the others are exported lazily by :mod:`rivid` itself.
"""
