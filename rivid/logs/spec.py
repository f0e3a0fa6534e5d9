"""What the configuration declares about the logs, as one small hashable value."""

from dataclasses import dataclass
from hashlib import sha256
from typing import Literal

from rivid.config import FLOWS, UNITS, Config

MICRO = 1_000_000
"""Times are whole microseconds of UTC since 1970: exact, and quick to compare."""

ON_TIME = 0.01
"""A sample this part of T_s late still counts for its instant: clocks are rounded to ms or s."""


@dataclass(frozen=True)
class Signal:
    """One canonical column and the columns of the log it is the sum of.

    Attributes
    ----------
    name : str
        u_Qi, u_Qo, h_L or Q_L.
    sources : tuple of str
        Columns of the log.
    factor : float
        From the log's unit to m3/s or m.
    shift : int
        What to take off its times [us]: the interval where the stamp stands at its end.
    spacing : int
        Expected time between two values [us].
    held : bool
        A command holds until the next one; a measured quantity is interpolated.
    supposed : bool
        Whether the shift is T_s only because no interval is declared: the log must then come every T_s.
    """

    name: str
    sources: tuple[str, ...]
    factor: float
    shift: int
    spacing: int
    held: bool
    supposed: bool = False


@dataclass(frozen=True)
class Spec:
    """All that reading needs to know; equal specs read a file alike."""

    signals: tuple[Signal, ...]
    output: str
    time: tuple[str, ...]
    time_format: str | None
    time_zone: str | None
    ambiguous: Literal["error", "first", "second", "order"]
    separator: str
    decimal: str
    thousands: str
    encoding: str
    skip_rows: int
    unit_rows: int
    repeated_header: Literal["error", "drop"]
    missing: tuple[str, ...]
    sentinels: tuple[float, ...]
    not_sentinels: tuple[float, ...]
    period: float
    max_gap: int
    max_filled: float

    def __hash__(self) -> int:
        return hash((self.time, self.period, self.time_zone))  # quick: few specs live at a time

    @property
    def sources(self) -> list[str]:
        """Columns of numbers that are read, each once."""
        return list(dict.fromkeys(name for signal in self.signals for name in signal.sources))

    @property
    def tolerance(self) -> int:
        """How late a sample may be and still count for its instant [us]."""
        return int(ON_TIME * self.period * MICRO)

    @property
    def latest(self) -> int:
        """How long after a day's end its values may be stamped [us]."""
        return max(signal.shift for signal in self.signals)

    @property
    def digest(self) -> str:
        """Changes whenever a file would be read otherwise."""
        return sha256(repr(self).encode()).hexdigest()


_last: tuple[Config, Spec] | None = None


def spec_of(config: Config) -> Spec:
    """What `config` declares; the last answer is kept, as a batch asks for the same one all the time."""
    global _last
    if _last is None or _last[0] is not config:
        _last = (config, _build(config))
    return _last[1]


def _build(config: Config) -> Spec:
    given, reach = config.input, config.reach
    names = ("u_Qi", "u_Qo", "h_L") if reach.kind == "pool" else ("u_Qi", "Q_L")
    signals = []
    for name in names:
        column = getattr(given, name)
        if name == "u_Qo" and not column:
            continue  # `u_Qo = ""`: the outflow is not logged
        sources = (column or name,) if isinstance(column or name, str) else tuple(column)
        interval = given.interval.get(name)
        spacing = round((interval or reach.sample_time) * MICRO)
        ends = given.stamp.get(name) == "end"
        unit = given.units.get(name, "m" if name == "h_L" else "m3/s")
        signals.append(
            Signal(
                name=name,
                sources=sources,
                factor=UNITS["flow" if name in FLOWS else "level"][unit],
                shift=spacing if ends else 0,
                spacing=spacing,
                held=name in ("u_Qi", "u_Qo"),
                supposed=ends and interval is None,
            )
        )
    return Spec(
        signals=tuple(signals),
        output=reach.output,
        time=(given.time,) if isinstance(given.time, str) else tuple(given.time),
        time_format=given.time_format,
        time_zone=given.time_zone,
        ambiguous=given.ambiguous,
        separator=given.separator,
        decimal=given.decimal,
        thousands=given.thousands,
        encoding=given.encoding,
        skip_rows=given.skip_rows,
        unit_rows=given.unit_rows,
        repeated_header=given.repeated_header,
        missing=tuple(given.missing),
        sentinels=tuple(given.sentinels),
        not_sentinels=tuple(given.not_sentinels),
        period=reach.sample_time,
        max_gap=round(given.max_gap * MICRO),
        max_filled=given.max_filled,
    )
