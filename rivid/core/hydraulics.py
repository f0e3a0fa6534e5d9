"""Section II of the paper: Froude number, wave celerity and the bounds of the travel time, (1)-(6).

A rectangular channel of mean width and depth; all arguments broadcast.
"""

from dataclasses import dataclass

import numpy as np
from numpy.typing import ArrayLike

from rivid.core.settings import MAX_ORDER
from rivid.errors import ConfigError
from rivid.types import Floats

GRAVITY = 9.80665
"""Acceleration of gravity [m/s2]."""

SLOW = 2.0
"""Latest arrival that a geometry allows, over the travel time of its wave. A gravity wave takes twice as long
only where the mean depth is a quarter, a kinematic wave only where the section is twice as large."""


@dataclass(frozen=True)
class TravelBounds:
    """Bounds (5) of the travel time of a wave down the reach."""

    discharge: Floats  # mean [m3/s]
    velocity: Floats  # mean flow velocity v* [m/s]
    froude: Floats  # Froude number F_o (4) [-]
    gravity: Floats  # travel time of a gravity wave [s], the lower bound
    kinematic: Floats  # travel time of a kinematic wave [s], the upper bound


@dataclass(frozen=True)
class DelayProposal:
    """What the hydraulics of a reach propose for its estimator; see :func:`propose_delays`."""

    d_min: int
    d_max: int
    order: int
    delay_scale: float
    wave: str


def travel_bounds(discharge: ArrayLike, *, length: float, width: float, depth: ArrayLike) -> TravelBounds:
    """Froude number and bounds of the travel time, (4)-(6).

    Parameters
    ----------
    discharge : array_like
        Mean discharge Q* [m3/s]; zero or less gives infinite kinematic times.
    length, width : float
        Reach length L and mean width l* [m].
    depth : array_like
        Mean depth z* [m].

    Returns
    -------
    TravelBounds
        Arrays of the broadcast shape. Where (5) does not hold (F_o >= 2) both bounds are NaN.

    Notes
    -----
    Source: equations (4), (5), (6). The gravity wave runs at ``v + sqrt(g z)``, which is
    ``(1 + 1/F_o) v`` without the division by a small v.

    Examples
    --------
    >>> b = travel_bounds([100, 800], length=8200, width=81.6, depth=4.9)
    >>> (b.gravity / 133).round(1)
    array([8.6, 6.9])
    """
    if not (length > 0 and width > 0):
        raise ConfigError(f"length = {length} m, width = {width} m: expected positive numbers")
    Q, z = np.broadcast_arrays(np.asarray(discharge, float), np.asarray(depth, float))
    with np.errstate(divide="ignore", invalid="ignore"):
        v = Q / (width * z)
        wave = np.sqrt(GRAVITY * z)
        F = v / wave
        fits = F < 2
        gravity = np.where(fits, length / (v + wave), np.nan)
        kinematic = np.where(fits, np.where(v > 0, length / (1.5 * v), np.inf), np.nan)
    return TravelBounds(Q.copy(), v, F, gravity, kinematic)


def wave_memory(discharge: float, *, width: float, depth: float, manning: float) -> float:
    """Time in which friction takes 63 % of the height of waves that run to and fro in a pool [s].

    Manning's friction takes momentum at the rate ``2 g n^2 v / R^(4/3)``, and waves lose height at half of
    it. Infinite without a flow.
    """
    velocity, radius = abs(discharge) / (width * depth), width * depth / (width + 2.0 * depth)
    rate = GRAVITY * manning**2 * velocity / radius ** (4.0 / 3.0)
    return float(1.0 / rate) if rate > 0.0 else float(np.inf)


def propose_delays(
    discharge_range: tuple[float, float],
    *,
    length: float,
    width: float,
    depth: float,
    sample_time: float,
    kind: str = "pool",
) -> DelayProposal:
    """Candidate delays and the scale of the Rayleigh prior from the reach's hydraulics.

    In a pool, held up by a dam, the first wave is the gravity wave (sections II and VI); in a free
    river of low Froude number the flow itself arrives with the kinematic wave. A travel time tau is a
    delay ``d = tau / T_s - 1``, since the inflow first acts at lag d + 1 (8).

    Parameters
    ----------
    discharge_range : (float, float)
        Lowest and highest usual discharge [m3/s].
    length, width, depth : float
        Reach length, mean width, mean depth [m].
    sample_time : float
        Sampling period T_s [s].
    kind : {"pool", "river"}
        Which wave carries the signal.

    Returns
    -------
    DelayProposal
        `delay_scale` is the middle of the delays over the range, to half a sample, because the mode of
        the Rayleigh prior is its scale. In a pool `d_max` is :data:`SLOW` longest delays and `order` twice
        `d_max`, as 15 and 30 are in the paper. In a river the kinematic wave is the slow bound already:
        `d_max` is its longest delay, and `order` leaves half as much again for the tail. `order` is
        shortened to the longest that estimators accept, as long as `d_max` fits.

    Examples
    --------
    >>> propose_delays((100, 800), length=8200, width=81.6, depth=4.9, sample_time=133)
    DelayProposal(d_min=1, d_max=15, order=30, delay_scale=6.5, wave='gravity')
    """
    bounds = travel_bounds(discharge_range, length=length, width=width, depth=depth)
    wave = "gravity" if kind == "pool" else "kinematic"
    tau = bounds.gravity if kind == "pool" else bounds.kinematic
    if not np.isfinite(tau).all():
        raise ConfigError(
            f"no travel time for discharges {discharge_range} m3/s in a channel {width} m wide and "
            f"{depth} m deep (Froude number {np.max(bounds.froude):.2g}): check [reach]"
        )
    delays = np.maximum(tau / sample_time - 1.0, 1.0)
    scale = max(round(2.0 * float(delays.mean())) / 2.0, 1.0)
    longest = float(delays.max())
    d_max = max(int(SLOW * longest) if kind == "pool" else int(np.ceil(longest)), 4)
    order = max(2 * d_max if kind == "pool" else d_max + d_max // 2, 12)
    if d_max + 3 <= MAX_ORDER:
        order = min(order, MAX_ORDER)
    return DelayProposal(1, d_max, order, scale, wave)
