"""How the output answers a step of flow at a place: the kernel of events and of hours of the day."""

from dataclasses import replace

import numpy as np

from rivid.diagnosis.data import Record
from rivid.diagnosis.response.base import Response
from rivid.reach.changes import AddedFlow, Changes
from rivid.types import Floats

TRIAL = 1.0
"""Step of the added flow [m3/s]."""


def step_response(response: Response, record: Record, place: float) -> Floats:
    """Change of the output at each sample after 1 m3/s more enters at a place, about the usual flow.

    Parameters
    ----------
    response : Response
    record : Record
        Its grid, usual flow and output are taken.
    place : float
        0 at the upstream dam, 1 at the downstream one.

    Returns
    -------
    ndarray, shape (n,)
        [m per m3/s], or for a river reach [-].
    """
    n = record.time.shape[1]
    level, flow = record.usual_output, record.usual_flow
    steady = np.full((1, n + 1), flow)
    still = replace(
        record, dates=record.dates[:1], time=record.sample_time * np.arange(n + 1.0)[None], inflow=steady,
        outflow=steady if record.kind == "pool" else np.zeros((1, n + 1)),
        output=np.full((1, n + 1), level), used=np.ones((1, n + 1), bool),
    )  # fmt: skip
    later = np.concatenate([[0.0], np.full(n, TRIAL)])[None]  # the start is steady without it
    more = Changes(added=(AddedFlow(place, later),))
    answer = response.simulate(still, more) - response.simulate(still, Changes())
    return np.asarray(answer[0, 1:] / TRIAL)


def kernels_of(response: Response, record: Record) -> dict[str, Floats]:
    """Step responses: an inflow at the upper dam and in the middle, a release at the lower dam."""
    return {
        "up": step_response(response, record, 0.0),
        "middle": step_response(response, record, 0.5),
        "down": -step_response(response, record, 1.0),
    }
