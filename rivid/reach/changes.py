"""Changes of a reach: flows, gates, storage, gauge.

Commands are logged, flows are real: a change is the difference between the two. Arrays are on the time grid
of the simulation; an array of one value holds for all samples.
"""

from collections.abc import Iterable
from dataclasses import dataclass, field
from typing import Any

import numpy as np

from rivid.errors import RividError
from rivid.types import Floats


def _check_place(what: str, place: float) -> None:
    if not 0.0 <= place <= 1.0:
        raise RividError(f"{what} at place {place}: expected 0 (upstream) to 1 (downstream)")


@dataclass(frozen=True, eq=False)
class AddedFlow:
    """A flow that enters the reach other than through the dams.

    Parameters
    ----------
    place : float
        Where: 0 at the upstream dam, 1 at the downstream one.
    flow : ndarray, shape of the time grid
        Flow [m3/s], held over each sample; negative is a loss.
    """

    place: float
    flow: Floats

    def __post_init__(self) -> None:
        _check_place("an added flow", self.place)


@dataclass(frozen=True, eq=False)
class Leak:
    """A loss that grows with the level: ``loss (level - reference)``."""

    place: float  # 0 upstream to 1 downstream
    loss: Floats  # [m3/s per m], shape of the time grid
    reference: float  # level without loss [m]

    def __post_init__(self) -> None:
        _check_place("a leak", self.place)


@dataclass(frozen=True, eq=False)
class Pond:
    """Storage connected to the reach: ``exchange (level - level of the pond)``."""

    place: float  # 0 upstream to 1 downstream
    area: float  # surface of the pond [m2]
    exchange: Floats  # [m3/s per m], shape of the time grid

    def __post_init__(self) -> None:
        _check_place("a pond", self.place)
        if not self.area > 0:
            raise RividError(f"a pond of {self.area} m2: expected a positive area")


def _constant(value: float) -> Any:
    """A field of one value, which holds for all samples."""
    return field(default_factory=lambda: np.full(1, value))


@dataclass(frozen=True, eq=False)
class Gate:
    """How the real outflow follows its command; first the dead-band, then the rate, the lag, the factors."""

    dead_band: Floats = _constant(0.0)  # the gate stays while the command is less away from it [m3/s]
    rate: Floats = _constant(np.inf)  # fastest move [m3/s per s]
    lag: Floats = _constant(0.0)  # time constant with which the flow follows the gate [s]
    factor: Floats = _constant(1.0)  # real flow over the gate's [-]
    head: Floats = _constant(0.0)  # relative gain of the flow for each metre above `reference` [1/m]
    reference: float = 0.0  # [m]
    start: Floats = _constant(np.inf)  # position at the first sample of a row [m3/s]; inf: the command


@dataclass(frozen=True, eq=False)
class Changes:
    """All changes of a reach; none by default.

    Parameters
    ----------
    inflow : ndarray or None
        The real inflow [m3/s] where it is not what the log holds.
    gate : Gate
        The downstream dam.
    added : tuple of AddedFlow
    leaks : tuple of Leak
    ponds : tuple of Pond
    area_slope : float
        Relative change of the water surface for each metre of level above `area_reference` [1/m].
    area_reference : float
        [m].
    gauge : ndarray
        Reading of the gauge minus true level [m], or discharge [m3/s].
    rating : ndarray
        Discharge that a river's gauge reads over the true one, less 1 [-].
    well : ndarray
        Time constant of the gauge's stilling well, beside its usual one [s].
    """

    inflow: Floats | None = None
    gate: Gate = field(default_factory=Gate)
    added: tuple[AddedFlow, ...] = ()
    leaks: tuple[Leak, ...] = ()
    ponds: tuple[Pond, ...] = ()
    area_slope: float = 0.0
    area_reference: float = 0.0
    gauge: Floats = _constant(0.0)
    rating: Floats = _constant(0.0)
    well: Floats = _constant(0.0)

    @property
    def gate_is_plain(self) -> bool:
        """Whether the real outflow is the command."""
        g = self.gate
        still = (g.dead_band == 0.0).all() and (g.lag == 0.0).all() and (g.head == 0.0).all()
        return bool(still and (g.factor == 1.0).all() and np.isinf(g.rate).all())


NO_CHANGES = Changes()


def together(changes: Iterable[Changes]) -> Changes:
    """Several changes at once, their maps of the inflow applied in turn: the last real inflow holds.

    Flows, leaks and ponds are collected; factors multiply; dead-bands, lags and slopes add; the slowest rate
    and the lowest start of the gate hold. RividError where two changes refer to different levels.
    """
    parts = list(changes)
    gates = [c.gate for c in parts]
    reference = _one_level("head", [(g.reference, bool((g.head != 0).any())) for g in gates])
    result = Gate()
    for gate in gates:
        result = Gate(
            result.dead_band + gate.dead_band, np.minimum(result.rate, gate.rate), result.lag + gate.lag,
            result.factor * gate.factor, result.head + gate.head, reference,
            np.minimum(result.start, gate.start),
        )  # fmt: skip
    return Changes(
        inflow=next((c.inflow for c in reversed(parts) if c.inflow is not None), None),
        gate=result,
        added=tuple(a for c in parts for a in c.added),
        leaks=tuple(a for c in parts for a in c.leaks),
        ponds=tuple(a for c in parts for a in c.ponds),
        area_slope=sum(c.area_slope for c in parts),
        area_reference=_one_level("area", [(c.area_reference, c.area_slope != 0) for c in parts]),
        gauge=np.asarray(sum((c.gauge for c in parts), start=np.zeros(1))),
        rating=np.asarray(sum((c.rating for c in parts), start=np.zeros(1))),
        well=np.asarray(sum((c.well for c in parts), start=np.zeros(1))),
    )


def _one_level(what: str, references: list[tuple[float, bool]]) -> float:
    levels = {level for level, used in references if used}
    if len(levels) > 1:
        raise RividError(f"changes of the {what} refer to levels {sorted(levels)}: expected one level")
    return levels.pop() if levels else 0.0
