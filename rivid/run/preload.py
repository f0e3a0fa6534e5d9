"""The process that workers are forked from, started before it is needed; and how a worker begins.

It imports what workers need while this process does something else; a worker is then a fork of it, ready at
once. Nothing heavy is imported here, so that it can be the first thing a command does.
"""

import os
import signal
import sys
import time
from collections.abc import Iterator, Sequence
from contextlib import contextmanager

ESTIMATING = ("rivid.run.leash", "rivid.run.batch")
"""What a worker needs that estimates batches."""

DRAWING = (
    "rivid.run.leash",
    "rivid.run.drawing",
    "rivid.results.read",
    "rivid.report.build",
    "jinja2",
    *(f"rivid.plots.{name}" for name in ("tdr", "histogram", "delay_map", "discharge", "fir_day", "t50")),
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
    forkserver.set_forkserver_preload([*modules, "rivid.run.settled"])
    with _same_path():
        forkserver.ensure_running()


@contextmanager
def _same_path() -> Iterator[None]:
    """Let a process that starts now import what this one imports, from the same places and no others.

    Otherwise it would look into the current directory first, where a folder `rivid` may lie, or a module that
    somebody put there.
    """
    path = os.pathsep.join(os.path.abspath(place) for place in sys.path)
    given = {"PYTHONPATH": path, "PYTHONSAFEPATH": "1"}
    before = {name: os.environ.get(name) for name in given}
    os.environ.update(given)
    try:
        yield
    finally:
        for name, value in before.items():
            if value is None:
                os.environ.pop(name, None)
            else:
                os.environ[name] = value


def begin(parent: int) -> None:
    """Set a worker up: signals are the parent's business, and it does not outlive the parent."""
    import threading

    from rivid.run.lean import spare_pandas
    from rivid.run.leash import hold

    hold()
    signal.signal(signal.SIGINT, signal.SIG_IGN)
    signal.signal(signal.SIGTERM, signal.SIG_DFL)
    if hasattr(signal, "SIGALRM"):
        signal.signal(signal.SIGALRM, signal.SIG_IGN)
    spare_pandas()
    threading.Thread(target=_leave_with, args=(parent,), daemon=True).start()


def _leave_with(parent: int) -> None:
    while True:
        try:
            os.kill(parent, 0)
        except ProcessLookupError:
            os._exit(1)
        except PermissionError:
            pass
        time.sleep(0.5)
