"""An engine of Dask workers: of a standing cluster, or of this machine for the duration of the run.

Only Dask's futures are used: few batches are in flight, and a worker writes its segment itself, so that the
tables are the same bytes as with processes. Workers must see DATA_DIR and OUT under the same paths, and have
the same version of rivid.
"""

import importlib.util
import pickle
import threading
import time
from collections.abc import Callable
from concurrent.futures import CancelledError, Future
from contextlib import suppress
from pathlib import Path
from typing import Any

from rivid import __version__
from rivid.errors import ConfigError, RividError
from rivid.results.store import METHOD_VERSION
from rivid.run.workers import ESTIMATING, Engine, without_pandas

PATIENCE = 10  # time in which a scheduler must answer [s]

CLOSING = 5  # time to wait for client and cluster to end [s]; all work is done: a late end is no error
LOOK_AGAIN = 5.0  # interval at which the workers of a scheduler are counted [s]
STARTS = 3  # attempts to start a cluster on this machine: a worker may be killed while it starts
AT_LEAST = 16  # least tasks offered to a standing scheduler: an adaptive cluster grows with its queue
OURS = {  # settings of a cluster on this machine
    "distributed.scheduler.allowed-failures": 0,  # a task that killed a worker is reported at once
    "distributed.worker.profile.enabled": False,
    "distributed.worker.preload": list(ESTIMATING),
    # one thread of BLAS; and not Dask's MALLOC_TRIM_THRESHOLD_, which gives memory back after every array
    "distributed.nanny.pre-spawn-environ": dict.fromkeys(
        ("OMP_NUM_THREADS", "MKL_NUM_THREADS", "OPENBLAS_NUM_THREADS"), 1
    ),
}

VERSION = f"{__version__}, method {METHOD_VERSION}"

_one_at_a_time = threading.Lock()


class Dask(Engine):
    """Workers of a Dask cluster: ``with Dask() as engine``; it starts with the first task.

    `scheduler` is the address of a standing scheduler, ``tcp://host:8786``, or the path of its scheduler
    file, ending in ``.json``. Without: a cluster on this machine of `workers` processes of one thread each,
    gone when the block ends. Dask gives up a task that killed its worker and starts another worker: there is
    none to renew, and no task needs a worker of its own.
    """

    draws = False  # processes of this machine do

    def __init__(self, scheduler: str | None = None, workers: int = 1) -> None:
        if importlib.util.find_spec("distributed") is None:
            raise ConfigError(
                "--engine dask needs dask, which is not installed: pip install 'rivid[dask]', "
                "or leave the option out: processes give the same tables"
            )
        if scheduler and scheduler.endswith(".json") and not Path(scheduler).is_file():
            raise ConfigError(
                f"no scheduler file {scheduler}: start `dask scheduler --scheduler-file {scheduler}`, "
                "or give the scheduler's address"
            )
        self.scheduler = scheduler
        self.workers = workers
        self._client: Any = None
        self._cluster: Any = None
        self._executor: Any = None
        self._counted = (0.0, 0)

    def __exit__(self, kind: type[BaseException] | None, error: BaseException | None, *_: object) -> None:
        client, self._client = self._client, None
        gone = client is not None and client.status != "running"
        if client is not None:
            self._executor.shutdown(wait=kind is None)
            with suppress(TimeoutError):
                client.close(timeout=CLOSING)
        if self._cluster is not None:  # also one that no client has reached
            with suppress(TimeoutError):
                self._cluster.close(timeout=CLOSING)
        if gone and isinstance(error, CancelledError | OSError):
            raise RividError(
                f"the scheduler {self.scheduler or 'of this machine'} went away: what is done is kept, "
                "the same command goes on from there"
            ) from error

    @property
    def slots(self) -> int:
        """Tasks that run at a time, or that are offered to a standing scheduler."""
        if not self.scheduler:
            return self.workers
        self._begin()
        seen, n = self._counted
        if time.monotonic() - seen > LOOK_AGAIN:
            n = max(AT_LEAST, sum(self._client.nthreads().values()))
            self._counted = (time.monotonic(), n)
        return n

    def submit(self, task: Callable[..., Any], *arguments: Any) -> Future[Any]:
        self._begin()
        # a worker has another current directory
        given = [value.absolute() if isinstance(value, Path) else value for value in arguments]
        # as bytes: the scheduler, often a thread of this process, would unpickle and pickle anything else
        call = pickle.dumps((task, given))
        future: Future[Any] = self._executor.submit(_execute, VERSION, not self.scheduler, call)
        return future

    def _begin(self) -> None:
        if self._client is not None:
            return
        import dask
        from distributed import Client, KilledWorker, LocalCluster

        self.died = (KilledWorker,)
        if self.scheduler:
            by = {"scheduler_file" if self.scheduler.endswith(".json") else "address": self.scheduler}
            try:
                self._client = Client(**by, timeout=PATIENCE, set_as_default=False)
            except (OSError, TimeoutError, ValueError) as error:
                raise RividError(
                    f"no Dask scheduler answers at {self.scheduler} ({type(error).__name__}): "
                    "start one (`dask scheduler`), or leave --scheduler out for workers of this machine"
                ) from None
        else:
            with dask.config.set(OURS):
                self._cluster = self._start(LocalCluster)
            self._client = Client(self._cluster, set_as_default=False)
        self._executor = self._client.get_executor(pure=False)

    def _start(self, cluster: Callable[..., Any]) -> Any:
        for _ in range(STARTS):
            try:
                return cluster(
                    n_workers=self.workers,
                    threads_per_worker=1,
                    dashboard_address="127.0.0.1:0",
                    silence_logs=50,
                )
            except (RuntimeError, OSError, TimeoutError) as error:
                why = error
        raise RividError(
            f"Dask's workers did not begin ({why}): give fewer --workers, or leave --engine dask out"
        ) from why


def _execute(version: str, own: bool, call: bytes) -> Any:
    """Execute a pickled task in a Dask worker, one at a time: drawing is not safe with threads.

    The worker of a standing scheduler may execute tasks of other users: its state is not changed.
    """
    if version != VERSION:
        raise RividError(
            f"a Dask worker has rivid {VERSION}, this command is rivid {version}: "
            "install the same on both, and start the workers again"
        )
    if own:
        without_pandas()
    with _one_at_a_time:
        task, arguments = pickle.loads(call)
        return task(*arguments)
