"""Define the shares of the exam and their targets."""

from collections.abc import Callable, Sequence
from dataclasses import dataclass

from scipy.stats import binom

from benchmarks.exam.judging import Judged
from benchmarks.exam.shares import Target

Test = Callable[[Judged], bool | None]
"""Whether an answer is a hit; None if it does not count for the share."""
WORSE = 0.01
"""Growth of the error on the held-out days, at a horizon, above which a name makes a forecast worse."""
DOUBT = 0.01
"""Probability that :func:`Asked.refused` refuses a share that is exactly on its target."""


@dataclass(frozen=True)
class Asked:
    """Share of the answers.

    Attributes
    ----------
    group, words : str
    test : callable
    target : Target or None
        None for a share without a target.
    """

    group: str
    words: str
    test: Test
    target: Target | None = None

    def counted(self, judged: Sequence[Judged]) -> tuple[int, int]:
        """Return the number of hits, and the number of answers that count."""
        hits = [hit for j in judged if (hit := self.test(j)) is not None]
        return sum(hits), len(hits)

    def refused(self, judged: Sequence[Judged]) -> bool:
        """Return whether a share as bad as this is almost impossible if the target is just reached."""
        hits, n = self.counted(judged)
        if self.target is None or n == 0:
            return False
        few = self.target.least > 0.0 and binom.cdf(hits, n, self.target.least) < DOUBT
        many = self.target.most < 1.0 and binom.sf(hits - 1, n, self.target.most) < DOUBT
        return bool(few or many)


def _of(kinds: str, test: Callable[[Judged], bool], low: float = 0.0, high: float = 1e9) -> Test:
    """Restrict a test to some kinds, and to sizes from `low` to below `high`."""

    def one(j: Judged) -> bool | None:
        if j.kind not in kinds.split() or not low <= (0.0 if j.times is None else j.times) < high:
            return None
        return test(j)

    return one


NOTHING, ONE, GROUP, OUT, TWO = (
    "nothing missing, or only operators change", "one effect", "confounded",
    "outsider, or the true cause removed", "two effects",
)  # fmt: skip


def _named(j: Judged) -> bool:
    return bool(j.names) or j.verdict == "error"


def _worse(j: Judged, growth: float | None) -> bool | None:
    return None if growth is None or not j.names else growth > WORSE


ROWS: tuple[Asked, ...] = (
    Asked(NOTHING, "any name", _of("nothing operators", _named), Target(most=0.01)),
    Asked(NOTHING, "no_gap", _of("nothing operators", lambda j: j.verdict == "no_gap")),
    Asked(ONE, ">= 2x, separable: first", _of("separable", lambda j: j.first, 2.0), Target(least=0.97)),
    Asked(ONE, ">= 2x, separable: alone", _of("separable", lambda j: j.alone, 2.0), Target(least=0.93)),
    Asked(ONE, ">= 2x, separable: wrong", _of("separable", lambda j: j.wrong, 2.0), Target(most=0.01)),
    Asked(ONE, "1x to 2x: found", _of("separable", lambda j: j.found, 1.0, 2.0), Target(least=0.70)),
    Asked(ONE, "1x to 2x: wrong", _of("separable", lambda j: j.wrong, 1.0, 2.0), Target(most=0.01)),
    Asked(GROUP, ">= 2x: the group holds it", _of("confounded", lambda j: j.held, 2.0), Target(least=0.98)),
    Asked(
        GROUP, ">= 2x: not larger than its twins",
        lambda j: j.close if j.kind == "confounded" and j.held and (j.times or 0.0) >= 2.0 else None,
        Target(least=0.90),
    ),
    Asked(GROUP, ">= 2x: wrong", _of("confounded", lambda j: j.wrong, 2.0)),
    Asked(GROUP, "1x to 2x: the group holds it", _of("confounded", lambda j: j.held, 1.0, 2.0)),
    Asked(OUT, "named all the same", _of("outside removed", _named), Target(most=0.05)),
    Asked(OUT, ">= 2x: unknown", _of("outside removed", lambda j: j.unknown, 2.0), Target(least=0.90)),
    Asked(OUT, "1x to 2x: unknown", _of("outside removed", lambda j: j.unknown, 1.0, 2.0)),
    Asked(TWO, "both >= 2x: both", _of("two", lambda j: j.every, 2.0), Target(least=0.90)),
    Asked(TWO, "both >= 2x: a third", _of("two", lambda j: j.extra, 2.0), Target(most=0.03)),
    Asked(TWO, "the smaller 1x to 2x: both", _of("two", lambda j: j.every, 1.0, 2.0)),
    Asked(TWO, "one of them confounded: both held", _of("two_close", lambda j: j.held, 2.0)),
    Asked("all", "named: a horizon worse by > 1 %", lambda j: _worse(j, j.growth), Target(most=0.03)),
    Asked("all", "named: a horizon worse by > 1 %, also than with the truth", lambda j: _worse(j, j.beyond)),
    Asked("all", "failed", lambda j: j.verdict == "error"),
)  # fmt: skip
"""Rows of the table of targets; some shares have no target."""
COVERED = Target(least=0.92, most=0.97)
CLOSED = (0.95, 0.80)
"""Targets of the median and the tenth percentile of the closed gap, as a share of what the truth would
close."""
RELIABLE = 0.05
"""Tolerance of the share of right names from their probability, in each tenth."""
