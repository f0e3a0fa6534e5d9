"""Engines that execute tasks: worker processes of this machine, or this process; one path, the same rows.

Nothing heavy is imported here: worker processes can be started before this process imports what it needs
itself. They are forks of one process, which imports what workers need (0.6 s with matplotlib) while this
process imports (0.4 s) and estimates (:func:`warm`). A worker ends with the command, also where the command
is killed (:func:`_end_with_parent`). Pyarrow does not import pandas (:func:`without_pandas`): 0.3 s.
"""

import gc
import os
import signal
import sys
import threading
from collections.abc import Callable, Iterable, Iterator, Sequence
from concurrent.futures import FIRST_COMPLETED, BrokenExecutor, Future, ProcessPoolExecutor, wait
from contextlib import AbstractContextManager, nullcontext
from multiprocessing import get_context, parent_process
from typing import Any

ESTIMATING = ("rivid.run.run",)  # modules of a worker that estimates batches

DRAWING = (  # those of one that draws figures
    "rivid.run.drawing", "rivid.results.read", "rivid.report.build", "jinja2", "rivid.plots.draw",
    "pyarrow.compute", "pyarrow.parquet",
)  # fmt: skip

Progress = Callable[[int], AbstractContextManager[Callable[[int], Any]]]
"""A progress bar: called with the total, it gives a context; its value is called with each number done."""
IN_FLIGHT = 2  # tasks submitted per worker: while one runs, the next is at hand


class Engine(AbstractContextManager["Engine"]):
    """Executes tasks, `slots` at a time; this one in this process alone.

    A task that is lost with its worker raises one of `died` from its future; :meth:`renew` then starts new
    workers. Any other exception is raised by the task itself. `draws`: its workers draw figures too.
    """

    died: tuple[type[BaseException], ...] = ()
    draws = True

    @property
    def slots(self) -> int:
        """Tasks that run at a time."""
        return 1

    def submit(self, task: Callable[..., Any], *arguments: Any) -> Future[Any]:
        """Execute a task; for workers, task, arguments and result are pickled."""
        future: Future[Any] = Future()
        future.set_result(task(*arguments))
        return future

    def renew(self) -> None:
        """Replace the workers after one died."""

    def one(self) -> AbstractContextManager["Engine"]:
        """An engine of a single worker, for a task that may kill it."""
        return nullcontext(self)

    def __exit__(self, kind: type[BaseException] | None, error: BaseException | None, *_: object) -> None:
        """End the workers, at once after an error."""


class Processes(Engine):
    """Worker processes of this machine: ``with Processes(4) as engine``; they end with the block.

    `modules` are imported once for all workers.
    """

    died = (BrokenExecutor,)

    def __init__(self, workers: int, modules: Sequence[str] = ESTIMATING) -> None:
        self.workers = workers
        self.modules = modules
        self._pool: ProcessPoolExecutor | None = None

    @property
    def slots(self) -> int:
        return self.workers

    def __exit__(self, kind: type[BaseException] | None, *_: object) -> None:
        self._close(at_once=kind is not None)

    def submit(self, task: Callable[..., Any], *arguments: Any) -> Future[Any]:
        if self._pool is None:
            warm(self.modules)
            context = get_context("forkserver" if os.name == "posix" else "spawn")
            self._pool = ProcessPoolExecutor(self.workers, mp_context=context, initializer=_begin)
        try:
            return self._pool.submit(task, *arguments)
        except BrokenExecutor as error:  # a worker died in between: reported like that of any task
            future: Future[Any] = Future()
            future.set_exception(error)
            return future

    def renew(self) -> None:
        """Terminate the remaining workers; the next task starts new ones."""
        self._close(at_once=True)

    def one(self) -> Engine:
        """A worker apart from the others."""
        return Processes(1, self.modules)

    def _close(self, at_once: bool) -> None:
        pool, self._pool = self._pool, None
        if pool is None:
            return
        if at_once:
            for process in list((pool._processes or {}).values()):
                process.terminate()
        pool.shutdown(wait=True, cancel_futures=True)


def processes(workers: int, modules: Sequence[str]) -> Engine:
    """An engine of so many worker processes; for one, this process."""
    return Processes(workers, modules) if workers > 1 else Engine()


def each(tasks: Iterable[tuple[Any, ...]], engine: Engine) -> Iterator[tuple[tuple[Any, ...], Any, bool]]:
    """Execute tasks (function, argument, ...), and yield each as it finishes, with its result.

    The third value is whether it was lost: a worker died during it, perhaps because of it.
    """
    coming, under_way = iter(tasks), dict[Future[Any], tuple[Any, ...]]()
    while True:
        while len(under_way) < IN_FLIGHT * engine.slots and (task := next(coming, None)) is not None:
            under_way[engine.submit(*task)] = task
        if not under_way:
            return
        finished, _ = wait(under_way, return_when=FIRST_COMPLETED)
        lost = []
        while finished:
            for future in finished:
                task = under_way.pop(future)
                try:
                    result = future.result()
                except engine.died:
                    lost.append(task)
                else:
                    yield task, result, False
            finished = set()
            if lost:  # a broken pool loses all its tasks: collect them before new ones are submitted
                engine.renew()
                finished = {future for future in under_way if future.done()}
        for task in lost:
            yield task, None, True


def cores() -> int:
    """Processor cores that this process may use."""
    try:
        return len(os.sched_getaffinity(0))
    except AttributeError:  # not on every system
        return os.cpu_count() or 1


def warm(modules: Sequence[str]) -> None:
    """Start the process that workers are forked from, have it import `modules`, and return at once.

    Where it runs already it stays as it is: a worker then imports what is missing itself.
    """
    if os.name != "posix":
        return  # workers are spawned one by one there
    from multiprocessing import forkserver, resource_tracker

    forkserver.set_forkserver_preload(list(modules))
    resource_tracker.ensure_running()  # starting it unblocks SIGINT
    # it imports from the same places as this process, and not from the current directory, where a folder
    # `rivid` or a module of another name would be taken
    path = os.pathsep.join(os.path.abspath(place) for place in sys.path)
    given = {"PYTHONPATH": path, "PYTHONSAFEPATH": "1"}
    before = {name: os.environ[name] for name in given if name in os.environ}
    unblocked = signal.pthread_sigmask(signal.SIG_BLOCK, {signal.SIGINT})  # Ctrl-C goes to all processes
    os.environ.update(given)
    try:
        forkserver.ensure_running()
    finally:
        for name in given:
            del os.environ[name]
        os.environ.update(before)
        signal.pthread_sigmask(signal.SIG_SETMASK, unblocked)


def _begin() -> None:
    """Initialise a worker: the parent handles signals, and the worker ends with it."""
    signal.signal(signal.SIGINT, signal.SIG_IGN)
    signal.signal(signal.SIGTERM, signal.SIG_DFL)
    if hasattr(signal, "SIGALRM"):
        signal.signal(signal.SIGALRM, signal.SIG_IGN)
    without_pandas()
    gc.freeze()  # the modules that the fork brought: collections need not look at them
    threading.Thread(target=_end_with_parent, daemon=True).start()


def _end_with_parent() -> None:
    """End this process when the command that started it ends: its end of their pipe closes then."""
    parent = parent_process()
    if parent is not None:
        parent.join()
        os._exit(1)


class _NoPandas:
    """A finder of modules to which pandas does not exist."""

    def find_spec(self, name: str, path: object = None, target: object = None) -> None:
        if name == "pandas":
            raise ModuleNotFoundError(name)


def without_pandas() -> None:
    """Keep pyarrow from importing pandas, to recognise a Series, when it makes its first array.

    ``import pandas`` still works afterwards; where it is loaded already, nothing is done.
    """
    if "pandas" in sys.modules:
        return
    import pyarrow as pa

    finder = _NoPandas()
    sys.meta_path.insert(0, finder)
    try:
        pa.array([])
    finally:
        sys.meta_path.remove(finder)
