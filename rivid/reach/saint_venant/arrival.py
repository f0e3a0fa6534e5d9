"""When a small wave arrives: the characteristic through a steady flow."""

import numpy as np
from numpy.typing import ArrayLike

from rivid.core.hydraulics import GRAVITY
from rivid.reach.saint_venant.channel import Channel
from rivid.reach.saint_venant.flow import simulate
from rivid.types import Floats


def arrival_time(channel: Channel, flow: ArrayLike, level: ArrayLike) -> Floats:
    """Travel time of a small wave from the upstream dam to the gauge [s].

    Parameters
    ----------
    channel : Channel
    flow : array_like, shape (days,)
        Steady discharge [m3/s].
    level : array_like, shape (days,)
        Level at x = L [m].

    Returns
    -------
    ndarray, shape (days,)
        ``integral dx / (v + sqrt(g A / B))`` along the steady profile.

    Raises
    ------
    RividError
        Where there is no subcritical steady flow.

    Notes
    -----
    Source: the celerity v + c of (3) and (4), with A / B for the depth of a section that is no rectangle.
    """
    q = np.atleast_1d(np.asarray(flow, float))
    levels = np.broadcast_to(np.asarray(level, float), q.shape)
    steady = simulate(channel, np.zeros((len(q), 1)), q[:, None], q[:, None], levels)
    area = steady.end.area
    width = channel.width(channel.level(area))
    celerity = q[:, None] / area + np.sqrt(GRAVITY * area / width)
    return np.asarray((channel.dx / celerity).sum(axis=1))
