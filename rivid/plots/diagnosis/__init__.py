"""Pictures of a diagnosis, from plain arrays and words; importing this loads no matplotlib.

Before and after have one colour each in all of them: vermilion without the named effects, blue with them.
"""

KINDS = ("diagnosis_map", "diagnosis_gap", "diagnosis_day", "diagnosis_inflow", "diagnosis_loop")
"""Names of the files, in the order in which a page shows them."""
