"""What both reaches share sample by sample: the gate downstream and the people who command it, as arrays."""

from typing import NamedTuple

import numpy as np
from numpy.typing import ArrayLike, NDArray

from rivid.errors import RividError
from rivid.reach.changes import Changes

Floats = NDArray[np.float64]


class GateArrays(NamedTuple):
    """:class:`rivid.reach.changes.Gate` on the time grid; arrays of shape (days, n)."""

    plain: bool
    dead_band: Floats
    rate: Floats
    lag: Floats
    factor: Floats
    head: Floats
    reference: float


class ExchangeArrays(NamedTuple):
    """Leaks and ponds on the time grid.

    `loss` and `exchange` have the shape (leaks or ponds, days, n), the references and areas (leaks,) and
    (ponds,).
    """

    loss: Floats
    reference: Floats
    exchange: Floats
    area: Floats


class People(NamedTuple):
    """Who commands the outflow; arrays of shape (n,).

    Attributes
    ----------
    inflow : ndarray
        Announced inflow command [m3/s].
    disturbance : ndarray
        What the gauge reads above the water [m]: noise, and what effects make of it.
    aim : ndarray
        Level aimed at by whoever is on duty [m].
    feedforward, level_gain : ndarray
        K_Q [-] and K_h [m2/s] of whoever is on duty.
    wait : ndarray
        Longest time to the next look, were there one at this sample [s].
    dead_band, trim_time, notice, quantum, lowest : float
        See :class:`rivid.reach.operators.OperatorSettings`.
    gauge_quantum : float
        Step of the reading [m]; 0 for none.
    """

    inflow: Floats
    disturbance: Floats
    aim: Floats
    feedforward: Floats
    level_gain: Floats
    wait: Floats
    dead_band: float
    trim_time: float
    notice: float
    quantum: float
    lowest: float
    gauge_quantum: float


NOBODY = People(*(np.empty(0),) * 6, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0)
"""The outflow commands are given."""


def on_grid(what: str, values: ArrayLike, shape: tuple[int, ...]) -> Floats:
    """Values for every sample of a (days, n) grid, finite or infinite but not NaN.

    Raises
    ------
    RividError
        Where they do not fit the grid.
    """
    given = np.asarray(values, float)
    try:
        rows = np.array(np.broadcast_to(given, shape), order="C")
    except ValueError:
        raise RividError(f"{what} has shape {given.shape}: expected {shape} like the inflow") from None
    if np.isnan(rows).any():
        day, k = np.argwhere(np.isnan(rows))[0]
        raise RividError(f"{what} is {rows[day, k]} in row {day}, sample {k}: expected a number")
    return rows


def gate_arrays(changes: Changes, shape: tuple[int, ...]) -> GateArrays:
    """The changes' gate on a (days, n) grid."""
    gate = changes.gate
    if changes.gate_is_plain:  # one row of nothing: the loops do not look at it
        return GateArrays(True, *(np.zeros((1, 1)),) * 5, 0.0)
    return GateArrays(
        False,
        on_grid("the gate's dead-band", gate.dead_band, shape),
        on_grid("the gate's rate", gate.rate, shape),
        on_grid("the gate's lag", gate.lag, shape),
        on_grid("the gate's factor", gate.factor, shape),
        on_grid("the gate's head gain", gate.head, shape),
        float(gate.reference),
    )


def exchange_arrays(changes: Changes, shape: tuple[int, ...]) -> ExchangeArrays:
    """The changes' leaks and ponds on a (days, n) grid."""
    leaks, ponds = changes.leaks, changes.ponds
    loss, exchange = np.empty((len(leaks), *shape)), np.empty((len(ponds), *shape))
    for j, leak in enumerate(leaks):
        loss[j] = on_grid("a leak's loss", leak.loss, shape)
    for j, pond in enumerate(ponds):
        exchange[j] = on_grid("a pond's exchange", pond.exchange, shape)
    return ExchangeArrays(
        loss, np.array([a.reference for a in leaks]), exchange, np.array([a.area for a in ponds], float)
    )
