"""The candidate's desk: logs and the nominal reach come in, an answer goes out.

This module runs in a process that simulates nothing. It knows neither cases nor what was planted.
"""

import datetime as dt
import json
import time
from dataclasses import dataclass, field
from typing import Any

import numpy as np
from numpy.typing import NDArray

from rivid.config import Config, parse
from rivid.core.hydraulics import propose_delays
from rivid.diagnosis.data import Record, as_record
from rivid.diagnosis.response.base import Response

Floats = NDArray[np.float64]
REFUSAL = "does not show"
"""In what the workflow reports when its guard refuses a name."""


@dataclass(frozen=True, eq=False)
class Logs:
    """What a diagnosis is given.

    Attributes
    ----------
    dates : tuple of datetime.date
    seconds : ndarray, shape (n,)
        Sample times after local midnight [s].
    inflow, output : ndarray, shape (days, n)
        u_Qi [m3/s]; level [m] or a river's discharge [m3/s].
    outflow : ndarray, shape (days, n), or None
        u_Qo [m3/s]; None for a river.
    config : dict
        The configuration that a user would write: `[reach]` and `[diagnose]`.
    """

    dates: tuple[dt.date, ...]
    seconds: Floats
    inflow: Floats
    outflow: Floats | None
    output: Floats
    config: dict[str, Any] = field(default_factory=dict)

    @property
    def settings(self) -> Config:
        """The configuration, checked."""
        return parse(self.config, Config, "exam")


def record_of(logs: Logs) -> Record:
    """Days in rows, with the lead time that `rivid diagnose` gives them."""
    reach = logs.settings.reach
    proposal = propose_delays(
        reach.discharge_range, length=reach.length, width=reach.width, depth=reach.depth,
        sample_time=reach.sample_time, kind=reach.kind,
    )  # fmt: skip
    return as_record(
        logs.dates, logs.seconds, logs.inflow, logs.outflow, logs.output, sample_time=reach.sample_time,
        delay=proposal.d_max // 2, kind=reach.kind,
    )  # fmt: skip


def responses(logs: Logs, record: Record) -> tuple[Response, ...]:
    """The candidates that `rivid diagnose` would choose among."""
    from rivid.diagnosis.choice import responses_of

    return responses_of(logs.settings, record)


def answer(logs: Logs) -> dict[str, Any]:
    """The diagnosis of some logs, as `diagnosis.json` has it, and how long it took [s].

    Returns
    -------
    dict
        With `seconds`, and in `refused` what the guard refused; `error` where the diagnosis failed.
    """
    from rivid.diagnosis import workflow
    from rivid.diagnosis.choice import gauge_floor_of, library_of

    began = time.perf_counter()
    refused: list[str] = []
    try:
        record, settings = record_of(logs), logs.settings
        told, _ = workflow.diagnose(
            record, responses(logs, record), library_of(settings), most=settings.diagnose.most_effects,
            gauge_floor=gauge_floor_of(settings, record),
            report=lambda text: refused.append(text) if REFUSAL in text else None,
        )  # fmt: skip
        said: dict[str, Any] = json.loads(told.to_json())
    except Exception as error:  # a diagnosis that fails is an answer, and a wrong one
        said = {"error": f"{type(error).__name__}: {error}"[:300]}
    said["refused"] = refused
    said["seconds"] = round(time.perf_counter() - began, 1)
    return said
