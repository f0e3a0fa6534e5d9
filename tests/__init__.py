"""The tests of rivid. `make test-long` sets RIVID_LONG: random examples then run completely."""

import os

LONG = bool(os.environ.get("RIVID_LONG"))


def examples(full, least=20):
    """Return the number of random examples: all in `make test-long`, else an eighth, at least `least`."""
    return full if LONG else min(full, max(full // 8, least))
