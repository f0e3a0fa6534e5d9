"""The process that workers are forked from, started before it is needed.

It imports what workers need while this process does something else; a worker is then a fork of it, ready at
once. Nothing heavy is imported here, so that it can be the first thing a command does.
"""

import os
from collections.abc import Sequence

ESTIMATING = ("rivid.leash", "rivid.batch")
"""What a worker needs that estimates batches."""

DRAWING = (
    "rivid.leash",
    "rivid.drawing",
    "rivid.results",
    "rivid.report",
    "jinja2",
    *(f"rivid.figures.{name}" for name in ("tdr", "histogram", "delay_map", "discharge", "fir_day", "t50")),
    "pyarrow.parquet",
)
"""What a worker needs that draws figures."""


def cores() -> int:
    """Processor cores that this process may use."""
    try:
        return len(os.sched_getaffinity(0))
    except AttributeError:  # not on every system
        return os.cpu_count() or 1


def warm(modules: Sequence[str]) -> None:
    """Have the process that workers are forked from start and import `modules`, and come back at once.

    Where it runs already it stays as it is: a worker then imports what is missing itself.
    """
    if os.name != "posix":
        return  # workers are spawned one by one there
    from multiprocessing import forkserver

    os.environ["RIVID_LEASH"] = "1"  # for its import of the leash
    forkserver.set_forkserver_preload(list(modules))
    forkserver.ensure_running()
