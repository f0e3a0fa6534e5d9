"""The specification by which a log is read: `[input]`, and the signals that `[reach]` makes of it."""

from dataclasses import dataclass, field
from functools import cached_property
from hashlib import sha256

from rivid.config import FLOWS, UNITS, Config, InputConfig
from rivid.errors import ConfigError

MICRO = 1_000_000
"""Microseconds in a second: times are whole microseconds of UTC since 1970, exact and fast to compare."""

ON_TIME = 0.01
"""A sample this part of T_s late still counts for its instant: clocks are rounded to ms or s."""


@dataclass(frozen=True)
class Signal:
    """One canonical column and the columns of the log it is the sum of."""

    name: str  # u_Qi, u_Qo, h_L or Q_L
    sources: tuple[str, ...]  # columns of the log
    factor: float  # from the log's unit to m3/s or m
    shift: int  # subtracted from its times [us]: the interval where the stamp is at its end
    spacing: int  # expected time between two values [us]
    held: bool  # a command holds until the next one; a measured quantity is interpolated
    # whether the shift is T_s only because no interval is declared: the log must then come every T_s
    supposed: bool = False
    hold: int = 0  # longest time that a value logged by exception holds [us]; 0: values are logged regularly


@dataclass(frozen=True)
class Spec:
    """All that reading a log needs; equal specifications read a file alike."""

    input: InputConfig
    signals: tuple[Signal, ...]
    output: str  # the canonical column of the output, h_L or Q_L
    period: float  # T_s [s]
    # whether `[reach] sample_time` is declared; for messages only
    period_set: bool = field(default=True, repr=False, compare=False)

    def __hash__(self) -> int:
        return hash((self.period, self.input.time_zone))  # few specifications live at a time

    @cached_property
    def time(self) -> tuple[str, ...]:
        """Columns of the time, joined by a space."""
        return _listed(self.input.time)

    @cached_property
    def sources(self) -> tuple[str, ...]:
        """Columns of numbers that are read, or tags of the long layout, each once."""
        return tuple(dict.fromkeys(name for signal in self.signals for name in signal.sources))

    @cached_property
    def tags(self) -> tuple[str, ...]:
        """Columns of the tag of the long layout, joined by a space; empty where lines or names hold it."""
        return _listed(self.input.tag)

    @cached_property
    def flags(self) -> dict[str, str]:
        """Column of flags of each source; under "" the one of the whole row."""
        quality = self.input.quality
        if isinstance(quality, str):
            return {"": quality}
        flags: dict[str, str] = {}
        for signal in self.signals if quality else ():
            columns = _listed((quality or {}).get(signal.name))
            if columns and len(columns) != len(signal.sources):
                raise ConfigError(
                    f"[input.quality] {signal.name} has {len(columns)} columns of flags for the "
                    f"{len(signal.sources)} of [input] {signal.name}: expected one for each"
                )
            flags |= dict(zip(signal.sources, columns, strict=False))
        return flags

    @cached_property
    def zones(self) -> dict[str, int]:
        """UTC offset [s] by the name in the column of zones."""
        return {name: _seconds(offset) for name, offset in self.input.zones.items()}

    @cached_property
    def long(self) -> bool:
        """Whether a row has one value and its tag."""
        return self.input.layout == "long"

    @cached_property
    def plain(self) -> bool:
        """Whether a log has one header line, no comments, and no flags or zones of rows."""
        given = self.input
        odd = given.header_rows > 1 or given.columns or given.comment
        return not (self.long or odd or self.flags or given.zone_column)

    @cached_property
    def tolerance(self) -> int:
        """How late a sample may be and still count for its instant [us]."""
        return int(ON_TIME * self.period * MICRO)

    @cached_property
    def max_gap(self) -> int:
        """Longest gap that is bridged [us]."""
        return round(self.input.max_gap * MICRO)

    @cached_property
    def latest(self) -> int:
        """How long after a day's end its values may be stamped [us]."""
        return max(signal.shift for signal in self.signals)

    @property
    def digest(self) -> str:
        """Changes whenever a file would be read otherwise."""
        return sha256(repr(self).encode()).hexdigest()


_last: tuple[Config, Spec] | None = None


def spec_of(config: Config) -> Spec:
    """The specification in `config`, kept for the next call; ConfigError if flags do not match columns."""
    global _last
    if _last is None or _last[0] is not config:
        _last = (config, _build(config))
    return _last[1]


def _build(config: Config) -> Spec:
    given, reach = config.input, config.reach
    signals = []
    for name in ("u_Qi", "u_Qo", "h_L") if reach.kind == "pool" else ("u_Qi", "Q_L"):
        column = getattr(given, name)
        if name == "u_Qo" and not column:
            continue  # `u_Qo = ""`: the outflow is not logged
        interval = given.interval.get(name)
        spacing = round((interval or reach.sample_time) * MICRO)
        ends = given.stamp.get(name) == "end"
        unit = given.units.get(name, "m" if name == "h_L" else "m3/s")
        signals.append(
            Signal(
                name=name,
                sources=_listed(column or name),
                factor=UNITS["flow" if name in FLOWS else "level"][unit],
                shift=spacing if ends else 0,
                spacing=spacing,
                held=name in ("u_Qi", "u_Qo"),
                supposed=ends and interval is None,
                hold=round(given.hold.get(name, 0.0) * MICRO),
            )
        )
    declared = "sample_time" in reach.model_fields_set
    spec = Spec(given, tuple(signals), reach.output, reach.sample_time, declared)
    _ = spec.flags  # checks their number
    return spec


def _listed(columns: str | list[str] | None) -> tuple[str, ...]:
    return () if not columns else (columns,) if isinstance(columns, str) else tuple(columns)


def _seconds(offset: str) -> int:
    """Seconds of an offset like "-07:00"."""
    seconds = int(offset[1:3]) * 3600 + int(offset[4:]) * 60
    return -seconds if offset[0] == "-" else seconds
