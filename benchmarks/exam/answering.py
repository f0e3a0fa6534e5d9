"""The candidate's desk: logs and the nominal reach come in, an answer goes out.

This module runs in a process that simulates nothing. It knows neither worlds nor what was planted.
"""

import datetime as dt
import json
import time
from collections.abc import Sequence
from dataclasses import dataclass, field
from typing import Any

from rivid.config import Config, parse
from rivid.diagnosis.data import Record, as_record, joined, lead_of
from rivid.effects import build, effect_classes
from rivid.errors import RividError
from rivid.types import Floats


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
    settings = logs.settings
    T_s, kind = settings.reach.sample_time, settings.reach.kind
    every = joined(settings, T_s)
    return as_record(
        logs.dates, logs.seconds, logs.inflow, logs.outflow, logs.output, sample_time=T_s,
        lead=lead_of(settings, logs.inflow, every * T_s), kind=kind, every=every,
    )  # fmt: skip


def _diagnosed(logs: Logs, most: int | None = None, told: Sequence[dict[str, Any]] = ()) -> dict[str, Any]:
    from rivid.diagnosis import workflow
    from rivid.diagnosis.choice import gauge_floor_of, library_of, responses_of

    record, settings = record_of(logs), logs.settings
    classes = effect_classes()
    found, _ = workflow.diagnose(
        record, responses_of(settings, record), library_of(settings),
        most=settings.diagnose.most_effects if most is None else most,
        gauge_floor=gauge_floor_of(settings, record), start=tuple(build(table, classes) for table in told),
    )  # fmt: skip
    document: dict[str, Any] = json.loads(found.to_json())
    return document


def answer(logs: Logs) -> dict[str, Any]:
    """The diagnosis of some logs, as `diagnosis.json` has it, and how long it took [s].

    Returns
    -------
    dict
        With `seconds`; `error` where the diagnosis failed.
    """
    began = time.perf_counter()
    try:
        said = _diagnosed(logs)
    except Exception as error:  # a diagnosis that fails is an answer, and a wrong one
        said = {"error": f"{type(error).__name__}: {error}"[:300]}
    said["seconds"] = round(time.perf_counter() - began, 1)
    return said


def floor(logs: Logs, told: Sequence[dict[str, Any]]) -> list[float] | None:
    """Errors on the sealed days, by horizon, of a model that has the planted effects from the start.

    Parameters
    ----------
    logs : Logs
    told : sequence of dict
        The effects as tables, drawn events as they were drawn.

    Returns
    -------
    list of float or None
        None where that model cannot be calibrated.
    """
    try:
        gap = _diagnosed(logs, 0, told).get("gap")
    except RividError:
        return None
    return None if gap is None else list(gap["rmse_baseline"])
