"""The rows of the exam and what each asks: a share of answers, and its target."""

from collections.abc import Callable, Sequence
from dataclasses import dataclass

from benchmarks.exam.judging import OVERLAP, WORSE_NAMED, WORSE_NOTHING, Judged
from benchmarks.exam.shares import Target

Test = Callable[[Judged], bool | None]
"""Whether an answer counts; None where it is not asked."""


@dataclass(frozen=True)
class Asked:
    """A share of a row's answers.

    Attributes
    ----------
    words : str
    test : callable
    target : Target or None
        None: told for the reader, without a target.
    """

    words: str
    test: Test
    target: Target | None = None


@dataclass(frozen=True)
class Row:
    """A scenario of the exam's table."""

    key: str
    title: str
    asked: tuple[Asked, ...]


FALSE = "a false name"
NO_GAP = Asked("answered no_gap", lambda j: j.verdict == "no_gap")


def _false(most: float) -> Asked:
    return Asked(FALSE, lambda j: j.false, Target(most=most))


def _one(first: float, alone: float | None, wrong: float) -> tuple[Asked, ...]:
    asked = [Asked("named first", lambda j: j.first, Target(least=first))]
    if alone is not None:
        asked.append(Asked("and alone", lambda j: j.alone, Target(least=alone)))
    asked.append(Asked("wrong alone", lambda j: j.wrong, Target(most=wrong)))
    return tuple(asked)


def _group(words: str, least: float) -> Asked:
    return Asked(words, lambda j: j.group, Target(least=least))


def _not_held() -> Asked:
    return Asked("did_not_hold", lambda j: j.verdict == "did_not_hold", Target(least=0.95))


ROWS: tuple[Row, ...] = (
    Row("nothing_linear", "nothing missing, linear truth", (_false(0.01), NO_GAP)),
    Row("nothing_hydraulic", "nothing missing, hydraulic truth", (_false(0.02), NO_GAP)),
    Row("people", "only the operators change", (_false(0.01), NO_GAP)),
    Row("one_x2", "one effect, 2x and 4x", _one(0.97, 0.95, 0.01)),
    Row("one_x1", "one effect, 1x", _one(0.75, None, 0.03)),
    Row("one_planted", "one effect, as in configs/scenarios/effects", _one(0.97, 0.95, 0.01)),
    Row("group", "confounded: pairs, and effects with a twin", (_group("both, and the breaker", 0.98),)),
    Row("group_x1", "an effect with a twin, 1x",
        (Asked("it or its twin named", lambda j: j.first or bool(j.names) and not j.wrong, Target(least=0.75)),
         Asked("wrong alone", lambda j: j.wrong, Target(most=0.03)))),
    Row("unknown", "outside the library, or its candidate removed",
        (_false(0.05), Asked("unknown, and where", lambda j: j.unknown, Target(least=0.90)))),
    Row("two", "two effects",
        (Asked("both named", lambda j: j.all_named, Target(least=0.90)),
         Asked("an extra one", lambda j: j.extra, Target(most=0.05)))),
    Row("window", "one season, one shift, from a date on",
        (Asked("name and window", lambda j: _named(j) and (j.overlap or 0.0) >= OVERLAP, Target(least=0.90)),
         Asked("name", lambda j: _named(j)))),
    Row("fitted_days", "effect in the fitting days only", (_not_held(), Asked("a name", lambda j: bool(j.names)))),
    Row("open_days", "effect in the fitting and selecting days", (_not_held(),)),
    Row("river_nothing", "river: nothing missing", (_false(0.02), NO_GAP)),
    Row("river_bypass", "river: a bypass for three weeks of nine",
        (*_one(0.97, 0.95, 0.01),
         Asked("window", lambda j: (j.overlap or 0.0) >= OVERLAP, Target(least=0.90)))),
)  # fmt: skip
"""As in the design's table; "as planted", the 1x of twins and the river are added to it."""


def _named(judged: Judged) -> bool:
    return judged.first or (bool(judged.names) and not judged.wrong)


EVERY_NAMED: tuple[Asked, ...] = (
    Asked("gap closed by 0.90 or more: at least half", lambda j: _least(j.gap_closed, 0.90), Target(least=0.5)),
    Asked("gap closed by 0.75 or more", lambda j: _least(j.gap_closed, 0.75), Target(least=0.9)),
    Asked("a horizon worse by more than 1 %", lambda j: _more(j.growth, WORSE_NAMED), Target(most=0.01)),
)  # fmt: skip
"""Of every case whose effect was named: median and 10th percentile of the gap closed, as shares of cases."""
EVERY_NOTHING: tuple[Asked, ...] = (
    Asked("held-out error grew by more than 0.5 %", lambda j: _more(j.growth, WORSE_NOTHING), Target(most=0.01)),
)  # fmt: skip
NOTHING_ROWS = ("nothing_linear", "nothing_hydraulic", "people", "river_nothing")
COVERED = Target(least=0.92, most=0.97)


def _least(value: float | None, limit: float) -> bool | None:
    return None if value is None else value >= limit


def _more(value: float | None, limit: float) -> bool | None:
    return None if value is None else value > limit


def counted(asked: Asked, judged: Sequence[Judged]) -> tuple[int, int]:
    """How many answers count, and of how many that is asked."""
    said = [hit for j in judged if (hit := asked.test(j)) is not None]
    return sum(said), len(said)
