"""Batches mapped over worker processes, or over none: one path, the same rows.

A worker writes its own segment, so rows never travel between processes, and what was done stays done.
A killed worker costs only its batch: the batch is halved until the day that kills is alone and failed.
"""

import os
import signal
import threading
import time
from collections import deque
from collections.abc import Callable, Iterable, Iterator
from concurrent.futures import FIRST_COMPLETED, Future, ProcessPoolExecutor, wait
from concurrent.futures.process import BrokenProcessPool
from contextlib import contextmanager
from multiprocessing import get_context
from pathlib import Path

from rivid.batch import Batch, estimate_batch, failed_batch
from rivid.lean import spare_pandas
from rivid.leash import hold
from rivid.store import write_segment

Done = Callable[[int], None]
IN_FLIGHT = 2
"""Batches handed out per worker ahead of their turn."""


def run_batches(batches: Iterable[Batch], segments: Path, workers: int, done: Done) -> None:
    """Estimate batches and write their segments.

    Parameters
    ----------
    batches : iterable of Batch
    segments : Path
        Directory of the segments.
    workers : int
        Worker processes; 1 works in this process.
    done : callable
        Called with the number of windows of each batch that is finished.
    """
    if workers <= 1:
        for batch in batches:
            work(batch, segments)
            done(len(batch.windows))
        return
    waiting = deque(batches)
    while waiting:
        for suspect in _drain(waiting, segments, workers, done):
            _alone(suspect, segments, done)


def work(batch: Batch, segments: Path) -> None:
    """What a worker does with a batch."""
    write_segment(segments, estimate_batch(batch))


def _drain(waiting: deque[Batch], segments: Path, workers: int, done: Done) -> list[Batch]:
    """Work until nothing waits, or until a worker dies; gives the batches that were then in its pool."""
    under_way: dict[Future[None], Batch] = {}
    with _pool(workers) as pool:
        try:
            while waiting or under_way:
                while waiting and len(under_way) < IN_FLIGHT * workers:
                    under_way[pool.submit(work, waiting[0], segments)] = waiting[0]
                    waiting.popleft()
                finished, _ = wait(under_way, return_when=FIRST_COMPLETED)
                for future in finished:
                    future.result()
                    done(len(under_way.pop(future).windows))
        except BrokenProcessPool:
            return list(under_way.values())
    return []


def _alone(batch: Batch, segments: Path, done: Done) -> None:
    """A batch during which a worker died, by itself; halved for as long as it kills its worker."""
    try:
        with _pool(1) as pool:
            pool.submit(work, batch, segments).result()
        done(len(batch.windows))
    except BrokenProcessPool:
        if len(batch.windows) == 1:
            reason = "the worker process died on this day (out of memory?)"
            write_segment(segments, failed_batch(batch, reason))
            done(1)
            return
        for half in batch.halves():
            _alone(half, segments, done)


@contextmanager
def _pool(workers: int) -> Iterator[ProcessPoolExecutor]:
    """A pool whose processes are gone when the block ends, however it ends."""
    context = get_context("forkserver" if os.name == "posix" else "spawn")
    if os.name == "posix":
        os.environ["RIVID_LEASH"] = "1"  # for the forkserver's import of the leash
        context.set_forkserver_preload(["rivid.leash", "rivid.batch"])
    pool = ProcessPoolExecutor(workers, mp_context=context, initializer=_begin, initargs=(os.getpid(),))
    try:
        yield pool
    except BaseException:
        for process in list((pool._processes or {}).values()):
            process.terminate()
        raise
    finally:
        pool.shutdown(wait=True, cancel_futures=True)


def _begin(parent: int) -> None:
    """Set a worker up: signals are the parent's business, and it does not outlive the parent."""
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
