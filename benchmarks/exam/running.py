"""Run the exam: hide effects in a season, diagnose it, and store the answer with the truth.

The judging process holds the truth of a season in its memory. The diagnosis runs in another process, which
receives only logs and a configuration. A result, with truth and answer, is appended as one line of JSON to
the file of the shard as soon as the answer is available.
"""

import json
import os
import subprocess
import threading
import time
from collections.abc import Callable, Sequence
from concurrent.futures import Future, ProcessPoolExecutor, ThreadPoolExecutor
from dataclasses import dataclass
from functools import partial
from multiprocessing import get_context
from pathlib import Path
from typing import Any

from benchmarks.exam import answering, hiding
from rivid.errors import RividError

ROOT = Path(__file__).parent.parent.parent
KEPT = ROOT / "build" / "exam"
MOST_TASKS = 20
"""Seasons that a process diagnoses before it is replaced."""
THREADS = ("OPENBLAS_NUM_THREADS", "OMP_NUM_THREADS", "MKL_NUM_THREADS", "NUMBA_NUM_THREADS")
Report = Callable[[str], None]
Shard = tuple[int, int]
"""Number of a shard, counted from 0, and number of shards."""


def results_of(kept: Path = KEPT) -> list[dict[str, Any]]:
    """Return the stored results by seed; the last one if a seed has several. Truncated lines are skipped."""
    found = {}
    for place in sorted(kept.glob("*.jsonl")):
        for line in place.read_text(encoding="utf-8").splitlines():
            try:
                one = json.loads(line)
            except json.JSONDecodeError:  # the run was stopped while writing
                continue
            found[one["seed"]] = one
    return [found[seed] for seed in sorted(found)]


def outstanding(seeds: Sequence[int], shard: Shard = (0, 1), kept: Path = KEPT) -> list[int]:
    """Return the seeds of a shard that have no result yet."""
    mine, shards = shard
    done = {one["seed"] for one in results_of(kept)}
    return [seed for i, seed in enumerate(seeds) if i % shards == mine and seed not in done]


@dataclass(frozen=True)
class Desks:
    """The three steps of a season. Tests replace them by simple ones."""

    plant: Callable[[int], tuple[answering.Logs, dict[str, Any]]] = hiding.sealed
    answer: Callable[[answering.Logs], dict[str, Any]] = answering.answer
    floor: Callable[[answering.Logs, Sequence[dict[str, Any]]], list[float] | None] = answering.floor


def short(longest: int) -> Desks:
    """Return the steps for seasons of at most `longest` days."""
    return Desks(plant=partial(hiding.sealed, longest=longest))


def run(
    seeds: Sequence[int],
    *,
    shard: Shard = (0, 1),
    processes: int = 2,
    hours: float | None = None,
    kept: Path = KEPT,
    desks: Desks = Desks(),
    report: Report = print,
) -> int:
    """Answer the outstanding seasons until all are done or the time is up; store each result at once.

    Parameters
    ----------
    seeds : sequence of int
    shard : (int, int)
        Number of the shard and number of shards.
    processes : int
        Number of concurrent seasons.
    hours : float, optional
        No season is started after this time.
    kept : Path
        Folder of the results.
    desks : Desks
    report : callable
        Called with a line for each result.

    Returns
    -------
    int
        Number of answered seasons.
    """
    for name in THREADS:
        os.environ.setdefault(name, "1")  # one thread for each of the concurrent processes
    todo = outstanding(seeds, shard, kept)
    deadline = None if hours is None else time.monotonic() + 3600.0 * hours
    context = get_context("spawn")  # the processes inherit nothing from this one
    done, lock, revision = [0], threading.Lock(), revision_of()
    kept.mkdir(parents=True, exist_ok=True)
    place = kept / f"shard-{shard[0]}-of-{shard[1]}.jsonl"
    with (
        ProcessPoolExecutor(processes, mp_context=context, max_tasks_per_child=MOST_TASKS) as examiners,
        ProcessPoolExecutor(processes, mp_context=context, max_tasks_per_child=MOST_TASKS) as candidates,
        ThreadPoolExecutor(processes) as turns,
    ):

        def ask(seed: int) -> None:
            if deadline is not None and time.monotonic() > deadline:
                return
            try:
                logs, truth = examiners.submit(desks.plant, seed).result()
            except RividError as error:
                report(f"{seed} cannot be simulated: {error}"[:200])
                return
            known = truth.pop("known")
            answer = candidates.submit(desks.answer, logs).result()
            floor = None
            if known and answer.get("effects"):  # otherwise there is no closed gap to evaluate
                floor = candidates.submit(desks.floor, logs, known).result()
            result = {"seed": seed, "revision": revision, "truth": truth, "answer": answer, "floor": floor}
            with lock:
                append(result, place)
                done[0] += 1
                report(f"{done[0]}/{len(todo)} seed {seed}, {truth['kind']}: {summary_of(answer)}")

        waiting: list[Future[None]] = [turns.submit(ask, seed) for seed in todo]
        for one in waiting:
            one.result()
    return done[0]


def append(result: dict[str, Any], place: Path) -> None:
    """Append a result as a line. A truncated last line is terminated first."""
    line = json.dumps(result) + "\n"
    with place.open("ab+") as out:
        if out.tell():
            out.seek(-1, os.SEEK_END)
            if out.read(1) != b"\n":
                line = "\n" + line
        out.write(line.encode())


def summary_of(answer: dict[str, Any]) -> str:
    """Format an answer as one line."""
    if "error" in answer:
        return str(answer["error"])[:200]
    names = ", ".join(
        e["name"] + (f" (or {', '.join(e['tied_with'])})" if e["tied_with"] else "")
        for e in answer["effects"]
    )
    return f"{answer['verdict']} [{names}] {answer.get('seconds', 0):.0f} s"


def revision_of() -> str:
    """Return the commit of the working tree, marked if files differ from it; empty without a repository."""
    try:
        ran = subprocess.run(
            ["git", "describe", "--always", "--dirty", "--abbrev=8"], cwd=ROOT, capture_output=True,
            text=True, check=True,
        )  # fmt: skip
    except (OSError, subprocess.CalledProcessError):
        return ""
    return ran.stdout.strip()
