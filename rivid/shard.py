"""Shards: one part of a run for each of many jobs, the parts told apart by what they hold alone."""

import datetime as dt
from dataclasses import dataclass

from rivid.errors import ConfigError

BLOCK = 32
"""Days in a row that stay together: neighbours share files and windows."""

MOST = 100_000


@dataclass(frozen=True)
class Shard:
    """Part `index` of `count`, counted from 1.

    Examples
    --------
    >>> Shard.parse("3/16")
    Shard(index=3, count=16)
    """

    index: int
    count: int

    @classmethod
    def parse(cls, text: str) -> "Shard":
        """Read I/N.

        Raises
        ------
        ConfigError
            Where it is not two whole numbers with 1 <= I <= N.
        """
        first, slash, second = text.partition("/")
        if slash and first.isascii() and first.isdigit() and second.isascii() and second.isdigit():
            if 1 <= int(first[:9]) <= int(second[:9]) <= MOST and len(first + second) < 19:
                return cls(int(first), int(second))
        raise ConfigError(
            f"--shard {text}: expected I/N with 1 <= I <= N <= {MOST:,}, for example 3/16; "
            "a job array that counts from 0 adds 1"
        )

    @property
    def name(self) -> str:
        """For names of files."""
        return f"{self.index}-of-{self.count}"

    def __str__(self) -> str:
        return f"{self.index}/{self.count}"

    def holds(self, date: dt.date) -> bool:
        """Whether a day is of this shard; whatever other days there are."""
        return date.toordinal() // BLOCK % self.count == self.index - 1

    def holds_place(self, place: int) -> bool:
        """Whether the reach at this place, counted from 0, is of this shard."""
        return place % self.count == self.index - 1
