"""Parts of the diagnosis taken out one by one: the exam must fail each time.

A small fixed set of cases, which the diagnosis as it is passes, is asked again under each mutation. A mutation
that no case notices is a part that nothing shows to be needed, or a hole in the exam.

Usage: python -m benchmarks.exam.mutations [--only MUTATION ...]
"""

import argparse
import contextlib
from collections.abc import Callable, Iterator, Sequence
from concurrent.futures import ProcessPoolExecutor
from dataclasses import dataclass
from multiprocessing import get_context
from typing import Any
from unittest.mock import patch

import numpy as np

from benchmarks.exam.answering import Logs, answer
from benchmarks.exam.cases import ALLOWED, Case
from benchmarks.exam.judging import OVERLAP, Judged, judge
from benchmarks.exam.naive import named_by_regression
from benchmarks.exam.planting import sealed
from benchmarks.measure import table

NOTHING = frozenset[str]()
Passes = Callable[[Judged], bool]


@dataclass(frozen=True)
class Fixed:
    """A case of the small set: a season, and what counts as passed."""

    case: Case
    seed: int
    passes: Passes
    asks: str


def right(judged: Judged) -> bool:
    """Named first, and alone."""
    return judged.alone


def silent(judged: Judged) -> bool:
    """No name."""
    return not judged.names and judged.verdict != "error"


def quiet(judged: Judged) -> bool:
    """No name, and nothing unknown."""
    return silent(judged) and judged.verdict == "no_gap"


def placed(judged: Judged) -> bool:
    """Something unknown, and where."""
    return judged.unknown


def windowed(judged: Judged) -> bool:
    """Named first, in its window."""
    return judged.first and (judged.overlap or 0.0) >= OVERLAP


FIXED: tuple[Fixed, ...] = (
    Fixed(Case("nothing/uneven", "", "uneven", 1, allowed=ALLOWED), 3, silent, "no name"),
    Fixed(Case("one/leakage", "", "effects/leakage", 1, ("leakage",)), 3, right, "leakage, alone"),
    Fixed(Case("outside/hunting", "", "outside/hunting", 1), 3, placed, "unknown, and where"),
    Fixed(
        Case("river/bypass", "", "exam/river_bypass", 1, ("unlogged_upstream_release",), river=True), 1,
        windowed, "the release, in its window",
    ),
    Fixed(Case("slow_weather", "", "exam/slow_weather", 1), 3, quiet, "no_gap"),
)  # fmt: skip
"""Seeds of development: the diagnosis as it is passes them all."""


def as_it_is() -> contextlib.AbstractContextManager[Any]:
    """Nothing is taken out."""
    return contextlib.nullcontext()


@contextlib.contextmanager
def regression() -> Iterator[None]:
    """The whole search replaced by least squares of the level's differences."""
    with patch("rivid.diagnosis.workflow.diagnose", named_by_regression):
        yield


@contextlib.contextmanager
def no_guard() -> Iterator[None]:
    """Effects of the level pass unseen."""
    with patch("rivid.diagnosis.workflow.guarded", lambda *_: True):
        yield


@contextlib.contextmanager
def no_gate() -> Iterator[None]:
    """What is left never speaks."""
    with patch("rivid.diagnosis.answer._unknown", lambda *_: None):
        yield


@contextlib.contextmanager
def no_trimming() -> Iterator[None]:
    """All days of a river count in the first fit."""
    with patch.dict("rivid.diagnosis.workflow.TRIM", {"pool": 0.0, "river": 0.0}):
        yield


@contextlib.contextmanager
def days_for_blocks() -> Iterator[None]:
    """Days are dealt and flipped one by one."""
    from rivid.diagnosis import blocks

    def dealt(days: Any, block_days: int | None = None) -> blocks.Split:
        return blocks.split(days, 1)

    def flipped(scores: Any, split: blocks.Split, used: Any = None) -> Any:
        return np.arange(len(split.day))

    with (
        patch("rivid.diagnosis.workflow.split", dealt),
        patch("rivid.diagnosis.candidates.flip_blocks", flipped),
    ):
        yield


MUTATIONS: dict[str, Callable[[], contextlib.AbstractContextManager[Any]]] = {
    "as it is": as_it_is,
    "naive regression of the differenced level": regression,
    "no guard for effects of the level": no_guard,
    "no step-4 gate": no_gate,
    "no trimming of days": no_trimming,
    "days instead of blocks": days_for_blocks,
}


def answered(logs: Logs, mutation: str) -> dict[str, Any]:
    """A diagnosis with a part taken out; in a process of its own."""
    with MUTATIONS[mutation]():
        return answer(logs)


def failing(mutation: str, examiner: ProcessPoolExecutor) -> dict[str, str]:
    """Cases that a mutation fails, and what was said instead."""
    found = {}
    with ProcessPoolExecutor(1, mp_context=get_context("spawn")) as candidate:
        for fixed in FIXED:
            logs, truth = examiner.submit(sealed, fixed.case, fixed.seed).result()
            said = candidate.submit(answered, logs, mutation).result()
            judged = judge(said, truth, fixed.case.expected, fixed.case.allowed, None)
            passed = fixed.passes(judged)
            print(
                f"{mutation}: {fixed.case.name}: {'passed' if passed else 'FAILED'}: {judged.verdict} "
                f"{list(judged.names)}",
                flush=True,
            )
            if not passed:
                found[fixed.case.name] = f"{judged.verdict} [{', '.join(judged.names)}]"
    return found


def told(found: dict[str, dict[str, str]]) -> str:
    """The table: each mutation with the cases that fail."""
    lines = []
    for mutation, failed in found.items():
        cases = "; ".join(f"{name}: {said}" for name, said in failed.items())
        good = bool(failed) != (mutation == "as it is")
        verdict = "as it must be" if good else "NOT NOTICED" if mutation != "as it is" else "DOES NOT PASS"
        lines.append([mutation, cases or "none", verdict])
    return table(["mutation", "cases that fail", "the exam"], lines)


def noticed(found: dict[str, dict[str, str]]) -> bool:
    """Whether all passes as it is, and every mutation fails somewhere.

    Examples
    --------
    >>> noticed({"as it is": {}, "no step-4 gate": {"outside/hunting": "no_gap []"}})
    True
    >>> noticed({"as it is": {}, "no step-4 gate": {}})
    False
    """
    return all(bool(failed) != (mutation == "as it is") for mutation, failed in found.items())


def main(words: Sequence[str] | None = None) -> None:
    """Ask the fixed cases under each mutation, and print the table."""
    parser = argparse.ArgumentParser(prog="python -m benchmarks.exam.mutations", description=__doc__)
    parser.add_argument("--only", nargs="*", default=[], help="mutations whose name holds this")
    only = parser.parse_args(words).only
    chosen = [m for m in MUTATIONS if not only or any(part in m for part in only)]
    with ProcessPoolExecutor(1, mp_context=get_context("spawn")) as examiner:
        found = {mutation: failing(mutation, examiner) for mutation in chosen}
    print(told(found))
    if not noticed(found):
        raise SystemExit(1)


if __name__ == "__main__":
    main()
