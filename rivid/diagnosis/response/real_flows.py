"""The flows behind the logs, for responses linear in them: gates, leaks and ponds at the observed level.

A linear response knows no level of its own that could act back. The observed one is at hand, and it is the
course about which everything is linearised: a gate's head, a leak and a pond see that.
"""

from dataclasses import dataclass

import numpy as np
from numpy.typing import ArrayLike

from rivid.diagnosis.data import Record
from rivid.diagnosis.response.base import gauge_of
from rivid.errors import RividError
from rivid.reach.changes import AddedFlow, Changes
from rivid.reach.loop import exchange_arrays, gate_arrays, on_grid
from rivid.types import Floats


@dataclass(frozen=True, eq=False)
class RealFlows:
    """What really flows.

    Attributes
    ----------
    inflow, outflow : ndarray, shape (days, n)
        Through the dams, means of the samples [m3/s].
    added : tuple of AddedFlow
        Beside them; what leaks and ponds take is negative.
    storage : ndarray, shape (days, n)
        Water surface over the usual one [-].
    gauge : ndarray, shape (days, n)
        What the gauge gives above the water.
    """

    inflow: Floats
    outflow: Floats
    added: tuple[AddedFlow, ...]
    storage: Floats
    gauge: Floats


def real_flows(record: Record, changes: Changes) -> RealFlows:
    """The flows that changes make of the logs.

    Parameters
    ----------
    record : Record
    changes : Changes

    Raises
    ------
    RividError
        Where a river reach is given changes of a level, an outflow or a volume, which it has not; or arrays
        do not fit the record.
    """
    shape = record.time.shape
    inflow = record.inflow if changes.inflow is None else on_grid("the real inflow", changes.inflow, shape)
    added = tuple(AddedFlow(part.place, on_grid("an added flow", part.flow, shape)) for part in changes.added)
    gauge = gauge_of(record, changes)
    if record.kind == "river":
        named = (
            ("a gate", not changes.gate_is_plain), ("a leak", bool(changes.leaks)),
            ("a pond", bool(changes.ponds)), ("an area slope", changes.area_slope != 0.0),
        )  # fmt: skip
        for what, given in named:
            if given:
                raise RividError(
                    f"{what} in a river reach, which has no level: expected effects on its inflow, added "
                    "flows, or its gauge"
                )
        return RealFlows(inflow, record.outflow, added, np.ones(shape), gauge)
    level = filled(record.time, record.output - gauge, changes.area_reference)
    storage = 1.0 + changes.area_slope * (level - changes.area_reference)
    if not (storage > 0.0).all():
        raise RividError(
            f"area_slope = {changes.area_slope:g} per m leaves no water surface at the observed levels: "
            "expected a smaller one"
        )
    if changes.gate_is_plain and not changes.ponds:
        outflow, ponds = record.outflow, np.zeros((0, *shape))
    else:
        outflow, ponds = _gate_and_ponds(record, changes, level)
    taken = [AddedFlow(leak.place, leak.loss * (leak.reference - level)) for leak in changes.leaks]
    taken += [AddedFlow(pond.place, -into) for pond, into in zip(changes.ponds, ponds, strict=True)]
    return RealFlows(inflow, outflow, (*added, *taken), storage, gauge)


def filled(time: Floats, output: Floats, otherwise: float) -> Floats:
    """An output without gaps, straight lines across them, shape (days, n); `otherwise` on an empty row."""
    whole = output.copy()
    for row, at in zip(whole, time, strict=True):
        there = np.isfinite(row)
        row[~there] = np.interp(at[~there], at[there], row[there]) if there.any() else otherwise
    return whole


def volume(time: Floats, flow: Floats) -> Floats:
    """Volume that a held flow has passed at each sample since the row's first, shape (days, n) [m3]."""
    passed = np.zeros_like(flow)
    np.cumsum(flow[:, :-1] * np.diff(time, axis=1), axis=1, out=passed[:, 1:])
    return passed


def volume_before(time: Floats, flow: Floats, delay: ArrayLike) -> Floats:
    """That volume some time earlier; the first flow of a row holds before it.

    Parameters
    ----------
    time, flow : ndarray, shape (days, n)
        [s], [m3/s].
    delay : float
        How much earlier [s]; not negative.
    """
    passed = volume(time, flow)
    asked = time - np.asarray(delay, float)
    moved = np.empty_like(passed)
    for row in range(len(time)):
        moved[row] = np.interp(asked[row], time[row], passed[row])
    return np.asarray(moved + flow[:, :1] * np.minimum(asked - time[:, :1], 0.0))


def mean_before(time: Floats, passed: Floats) -> Floats:
    """Mean flow of the interval that ends at each sample, from a volume; the first repeats the second."""
    means = np.diff(passed, axis=1) / np.diff(time, axis=1)
    return np.concatenate([means[:, :1], means], axis=1)


def _gate_and_ponds(record: Record, changes: Changes, level: Floats) -> tuple[Floats, Floats]:
    from rivid.diagnosis.response.real_flows_kernel import follow

    shape = record.time.shape
    outflow, into = np.empty(shape), np.empty((len(changes.ponds), *shape))
    exchange = exchange_arrays(changes, shape)
    follow(
        np.diff(record.time, axis=1, append=record.time[:, -1:] + record.sample_time), record.outflow, level,
        gate_arrays(changes, shape), exchange.exchange, exchange.area, outflow, into,
    )  # fmt: skip
    return outflow, into
