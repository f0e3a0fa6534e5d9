"""Batches mapped over an engine: over worker processes, or over none; one path, the same rows.

An :class:`Engine` is all that is asked of what executes: so many tasks at a time, each a function and its
arguments, and a word when a worker died. A worker writes its own segment, so rows never travel between
processes, and what was done stays done. A killed worker costs only its batch: the batch is halved until the
day that kills is alone and failed.
"""

import os
from collections.abc import Callable, Iterable, Iterator, Sequence
from concurrent.futures import FIRST_COMPLETED, BrokenExecutor, Future, ProcessPoolExecutor, wait
from contextlib import AbstractContextManager, contextmanager, nullcontext
from multiprocessing import get_context
from pathlib import Path
from platform import node
from typing import Any, Protocol

from rivid.errors import RividError
from rivid.results.rows import write_segment
from rivid.run.batch import Batch, estimate_batch, failed_batch
from rivid.run.preload import ESTIMATING, begin, warm

Done = Callable[[int], None]
IN_FLIGHT = 2
"""Tasks handed out per worker ahead of their turn."""


class Engine(Protocol):
    """What executes tasks.

    A task that is lost with its worker raises one of `died` from its future; :meth:`renew` then gives
    workers again. Any other exception is the task's own.
    """

    @property
    def slots(self) -> int:
        """Tasks that run at a time."""
        ...

    died: tuple[type[BaseException], ...]
    """What says that a worker died."""

    def submit(self, task: Callable[..., Any], *arguments: Any) -> Future[Any]:
        """Have a task executed; task, arguments and answer must travel between processes."""
        ...

    def renew(self) -> None:
        """Have workers again after one died."""
        ...

    def one(self) -> AbstractContextManager["Engine"]:
        """An engine of a single worker, for a task that may kill it."""
        ...


class Here:
    """This process alone."""

    slots = 1
    died: tuple[type[BaseException], ...] = ()

    def submit(self, task: Callable[..., Any], *arguments: Any) -> Future[Any]:
        """Execute the task, and come back when it is done."""
        future: Future[Any] = Future()
        future.set_result(task(*arguments))
        return future

    def renew(self) -> None:
        """Nothing to renew: whoever kills this process ends the run."""

    @contextmanager
    def one(self) -> Iterator["Engine"]:
        """This one."""
        yield self


class Processes:
    """Worker processes of this machine: ``with Processes(4) as engine``; they are gone when the block ends.

    Parameters
    ----------
    workers : int
    modules : sequence of str
        What workers need, imported once for all of them.
    """

    died: tuple[type[BaseException], ...] = (BrokenExecutor,)

    def __init__(self, workers: int, modules: Sequence[str] = ESTIMATING) -> None:
        self.slots = workers
        self.modules = modules
        self._pool: ProcessPoolExecutor | None = None

    def __enter__(self) -> "Processes":
        return self

    def __exit__(self, kind: type[BaseException] | None, *_: object) -> None:
        self._close(at_once=kind is not None)

    def submit(self, task: Callable[..., Any], *arguments: Any) -> Future[Any]:
        """Have a worker execute the task."""
        if self._pool is None:
            self._pool = self._open()
        try:
            return self._pool.submit(task, *arguments)
        except BrokenExecutor as error:  # a worker died since: the caller learns it as of any task
            future: Future[Any] = Future()
            future.set_exception(error)
            return future

    def renew(self) -> None:
        """Drop what is left of the workers; the next task has new ones."""
        self._close(at_once=True)

    @contextmanager
    def one(self) -> Iterator[Engine]:
        """A worker apart from the others."""
        with Processes(1, self.modules) as engine:
            yield engine

    def _open(self) -> ProcessPoolExecutor:
        warm(self.modules)
        context = get_context("forkserver" if os.name == "posix" else "spawn")
        return ProcessPoolExecutor(self.slots, mp_context=context, initializer=begin, initargs=(os.getpid(),))

    def _close(self, at_once: bool) -> None:
        pool, self._pool = self._pool, None
        if pool is None:
            return
        if at_once:
            for process in list((pool._processes or {}).values()):
                process.terminate()
        pool.shutdown(wait=True, cancel_futures=True)


def processes(workers: int, modules: Sequence[str] = ESTIMATING) -> AbstractContextManager[Engine]:
    """An engine of so many worker processes; of one: this process."""
    return Processes(workers, modules) if workers > 1 else nullcontext(Here())


def each(tasks: Iterable[tuple[Any, ...]], engine: Engine) -> Iterator[tuple[tuple[Any, ...], Any, bool]]:
    """Have tasks executed, a few ahead of their turn; give them as they come back.

    Parameters
    ----------
    tasks : iterable of (function, argument, ...)
        Taken as workers have room for them.
    engine : Engine

    Yields
    ------
    task : tuple
    answer
        None where it was lost.
    lost : bool
        A worker died during the task, perhaps of it.
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
                    answer = future.result()
                except engine.died:
                    lost.append(task)
                else:
                    yield task, answer, False
            finished = set()
            if lost:  # with a pool all that was under way is lost too: known before the next is handed out
                engine.renew()
                finished = {future for future in under_way if future.done()}
        for task in lost:
            yield task, None, True


def run_batches(batches: Iterable[Batch], segments: Path, engine: Engine, done: Done) -> None:
    """Estimate batches and write their segments.

    Parameters
    ----------
    batches : iterable of Batch
        Taken as workers have room for them.
    segments : Path
        Directory of the segments; every worker of the engine must see it.
    engine : Engine
    done : callable
        Called with the number of windows of each batch that is finished.

    Raises
    ------
    RividError
        Where a worker does not see DATA_DIR or OUT.
    """
    for (_, batch, _), _, lost in each(((work, batch, segments) for batch in batches), engine):
        if lost:
            _alone(batch, segments, engine, done)
        else:
            done(len(batch.windows))


def work(batch: Batch, segments: Path) -> None:
    """What a worker does with a batch.

    Raises
    ------
    RividError
        Where it does not see the logs' directory or that of the segments: a lost disk is no failed day.
    """
    for place in (batch.root, segments):
        if not place.exists():
            raise RividError(
                f"a worker on {node()} does not see {place}: DATA_DIR and OUT must be there, under these "
                "paths, on every machine that works; what is done is kept"
            )
    write_segment(segments, estimate_batch(batch))


def _alone(batch: Batch, segments: Path, engine: Engine, done: Done) -> None:
    """A batch during which a worker died, by itself; halved for as long as it kills its worker."""
    try:
        with engine.one() as single:
            single.submit(work, batch, segments).result()
        done(len(batch.windows))
    except engine.died:
        if len(batch.windows) == 1:
            reason = "the worker process died on this day (out of memory?)"
            write_segment(segments, failed_batch(batch, reason))
            done(1)
            return
        for half in batch.halves():
            _alone(half, segments, engine, done)
