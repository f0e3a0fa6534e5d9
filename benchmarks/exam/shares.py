"""Compute shares with their intervals, and compare them with targets."""

import math
from dataclasses import dataclass

Z = 1.959964


def wilson(hits: int, n: int) -> tuple[float, float]:
    """Return Wilson's 95 % interval of a share.

    Source: Wilson (1927), JASA 22, 209-212.

    Examples
    --------
    >>> [round(v, 3) for v in wilson(0, 60)]
    [0.0, 0.06]
    """
    if n == 0:
        return 0.0, 1.0
    p = hits / n
    middle = (p + Z * Z / (2 * n)) / (1 + Z * Z / n)
    half = Z * math.sqrt(p * (1 - p) / n + Z * Z / (4 * n * n)) / (1 + Z * Z / n)
    return max(middle - half, 0.0), min(middle + half, 1.0)


@dataclass(frozen=True)
class Target:
    """Target of a share: within [least, most]."""

    least: float = 0.0
    most: float = 1.0

    @property
    def words(self) -> str:
        """Target as text."""
        if self.least > 0.0 and self.most < 1.0:
            return f"{self.least:.2f} to {self.most:.2f}"
        return f"<= {self.most:.2f}" if self.most < 1.0 else f">= {self.least:.2f}"

    def verdict(self, hits: int, n: int) -> str:
        """Return whether the interval lies within the target, outside it, or on both sides of a limit.

        Examples
        --------
        >>> Target(most=0.01).verdict(0, 400), Target(least=0.97).verdict(60, 100)
        ('reached', 'short by 0.37')
        >>> Target(least=0.97).verdict(20, 20)
        'too few to decide (met so far)'
        """
        low, high = wilson(hits, n)
        if n and self.least <= low and high <= self.most:
            return "reached"
        share = hits / n if n else float("nan")
        off = max(self.least - share, share - self.most)
        miss = f"{'above' if share > self.most else 'short'} by {off:.2f}"
        if n and (high < self.least or low > self.most):
            return miss
        if not n:
            return "too few to decide"
        return f"too few to decide ({'met' if off <= 0 else miss} so far)"


def written(hits: int, n: int) -> str:
    """Format a share: hits, number, interval."""
    if n == 0:
        return "-"
    low, high = wilson(hits, n)
    return f"{hits}/{n} = {hits / n:.2f} ({low:.2f}-{high:.2f})"
