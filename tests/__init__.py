"""The tests of rivid. `make test-long` sets RIVID_LONG: random examples then run in full."""

import os


def examples(full):
    """The number of random examples: all in `make test-long`, else a quarter, but at least 20."""
    return full if os.environ.get("RIVID_LONG") else min(full, max(full // 4, 20))
