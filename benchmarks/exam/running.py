"""Cases asked one after the other, over processes: plant, diagnose, and only then look at the truth.

The truth of a season is held by the process that judges, in its memory. The process that diagnoses is another
one, started without it; it gets logs and a configuration. A result is written, the truth beside the answer,
when the answer is there.
"""

import json
import os
import subprocess
import threading
import time
from collections.abc import Callable, Sequence
from concurrent.futures import Future, ProcessPoolExecutor, ThreadPoolExecutor
from dataclasses import dataclass
from multiprocessing import get_context
from pathlib import Path
from typing import Any

from benchmarks.exam import answering
from benchmarks.exam.cases import ROOT, Case, Task
from benchmarks.exam.planting import floor_of, sealed
from rivid.errors import RividError

KEPT = ROOT / "build" / "exam"
MOST_TASKS = 20
"""Seasons that one process diagnoses before another takes its place."""
THREADS = ("OPENBLAS_NUM_THREADS", "OMP_NUM_THREADS", "MKL_NUM_THREADS", "NUMBA_NUM_THREADS")
Report = Callable[[str], None]


def place_of(task: Task, kept: Path = KEPT) -> Path:
    """File of a case and seed.

    Examples
    --------
    >>> from benchmarks.exam.cases import Case
    >>> place_of((Case("one/clock_offset/x2", "one_x2", "", 1), 5000), Path("kept")).as_posix()
    'kept/one-clock_offset-x2/5000.json'
    """
    case, seed = task
    return kept / case.name.replace("/", "-") / f"{seed}.json"


def outstanding(todo: Sequence[Task], shard: tuple[int, int], kept: Path = KEPT) -> list[Task]:
    """Tasks of a shard (number, of how many) that have no result yet."""
    mine, shards = shard
    return [task for i, task in enumerate(todo) if i % shards == mine and not place_of(task, kept).exists()]


@dataclass(frozen=True)
class Desks:
    """The three things that are done to a case; tests put simple ones in their place."""

    plant: Callable[[Case, int], tuple[answering.Logs, dict[str, Any]]]
    answer: Callable[[answering.Logs], dict[str, Any]]
    floor: Callable[[Case, int, str], list[float]]


DESKS = Desks(sealed, answering.answer, floor_of)


def run(
    todo: Sequence[Task],
    *,
    processes: int = 2,
    hours: float | None = None,
    kept: Path = KEPT,
    desks: Desks = DESKS,
    report: Report = print,
) -> int:
    """Ask what is outstanding, until it is done or time is up; results are kept as they come.

    Parameters
    ----------
    todo : sequence of (Case, int)
    processes : int
        Busy at a time.
    hours : float, optional
        No case is begun later than this.
    kept : Path
        Where results go.
    desks : Desks
    report : callable
        Told of each result.

    Returns
    -------
    int
        How many were done.
    """
    for name in THREADS:
        os.environ.setdefault(name, "1")  # for the processes to come: side by side, one thread each
    deadline = None if hours is None else time.monotonic() + 3600.0 * hours
    context = get_context("spawn")  # nothing of this process is inherited
    done, lock, revision = [0], threading.Lock(), revision_of()
    with (
        ProcessPoolExecutor(processes, mp_context=context, max_tasks_per_child=MOST_TASKS) as examiners,
        ProcessPoolExecutor(processes, mp_context=context, max_tasks_per_child=MOST_TASKS) as candidates,
        ThreadPoolExecutor(processes) as turns,
    ):

        def ask(task: Task) -> None:
            if deadline is not None and time.monotonic() > deadline:
                return
            case, seed = task
            try:
                logs, truth = examiners.submit(desks.plant, case, seed).result()
            except RividError as error:  # four times the size may be more than this reach and its people bear
                report(f"{case.name} {seed} cannot be simulated: {error}"[:200])
                return
            said = candidates.submit(desks.answer, logs).result()
            floor = None
            if case.expected and said.get("effects"):  # a gap was closed, or not
                floor = examiners.submit(desks.floor, case, seed, said["reach_response"]).result()
            result = {
                "case": case.name, "seed": seed, "revision": revision, "truth": truth,
                "answer": said, "floor": floor,
            }  # fmt: skip
            keep(result, place_of(task, kept))
            with lock:
                done[0] += 1
                report(f"{done[0]}/{len(todo)} {case.name} {seed}: {said_of(said)}")

        waiting: list[Future[None]] = [turns.submit(ask, task) for task in todo]
        for one in waiting:
            one.result()
    return done[0]


def keep(result: dict[str, Any], place: Path) -> None:
    """Write a result whole or not at all."""
    place.parent.mkdir(parents=True, exist_ok=True)
    part = place.with_suffix(".part")
    part.write_text(json.dumps(result), encoding="utf-8")
    part.replace(place)


def results_of(todo: Sequence[Task], kept: Path = KEPT) -> list[tuple[Case, dict[str, Any]]]:
    """Results that there are, with their cases, in the order of the tasks."""
    return [
        (case, json.loads(place.read_text(encoding="utf-8")))
        for case, seed in todo
        if (place := place_of((case, seed), kept)).exists()
    ]


def said_of(answer: dict[str, Any]) -> str:
    """An answer in one line."""
    if "error" in answer:
        return str(answer["error"])[:200]
    names = ", ".join(
        e["name"] + (f" (or {', '.join(e['tied_with'])})" if e["tied_with"] else "")
        for e in answer["effects"]
    )
    return f"{answer['verdict']} [{names}] {answer.get('seconds', 0):.0f} s"


def revision_of() -> str:
    """The commit that answers, with a mark where files differ from it; empty where there is none."""
    try:
        told = subprocess.run(
            ["git", "describe", "--always", "--dirty", "--abbrev=8"], cwd=ROOT, capture_output=True,
            text=True, check=True,
        )  # fmt: skip
    except (OSError, subprocess.CalledProcessError):
        return ""
    return told.stdout.strip()
