"""Answer an exam season: from the logs and the nominal reach to a diagnosis.

This module runs in a process that simulates nothing. It has no access to the worlds and the hidden effects.
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
    """Input of a diagnosis.

    Attributes
    ----------
    dates : tuple of datetime.date
    seconds : ndarray, shape (n,)
        Sample times after local midnight [s].
    inflow, output : ndarray, shape (days, n)
        u_Qi [m3/s]; level [m], or discharge of a river [m3/s].
    outflow : ndarray, shape (days, n), or None
        u_Qo [m3/s]; None for a river.
    config : dict
        The user's configuration: `[reach]` and `[diagnose]`.
    """

    dates: tuple[dt.date, ...]
    seconds: Floats
    inflow: Floats
    outflow: Floats | None
    output: Floats
    config: dict[str, Any] = field(default_factory=dict)

    @property
    def settings(self) -> Config:
        """Validated configuration."""
        return parse(self.config, Config, "exam")


def record_of(logs: Logs) -> Record:
    """Return the days as rows, with the lead time of `rivid diagnose`."""
    settings = logs.settings
    T_s, kind = settings.reach.sample_time, settings.reach.kind
    every = joined(settings, T_s)
    return as_record(
        logs.dates, logs.seconds, logs.inflow, logs.outflow, logs.output, sample_time=T_s,
        lead=lead_of(settings, logs.inflow, every * T_s), kind=kind, every=every,
    )  # fmt: skip


def _diagnosed(logs: Logs, most: int | None = None, known: Sequence[dict[str, Any]] = ()) -> dict[str, Any]:
    from rivid.diagnosis import workflow
    from rivid.diagnosis.choice import gauge_floor_of, library_of, responses_of

    record, settings = record_of(logs), logs.settings
    classes = effect_classes()
    found, _ = workflow.diagnose(
        record, responses_of(settings, record), library_of(settings),
        most=settings.diagnose.most_effects if most is None else most,
        gauge_floor=gauge_floor_of(settings, record), start=tuple(build(table, classes) for table in known),
    )  # fmt: skip
    document: dict[str, Any] = json.loads(found.to_json())
    return document


def answer(logs: Logs) -> dict[str, Any]:
    """Diagnose logs; return the content of `diagnosis.json` and the duration.

    Returns
    -------
    dict
        With `seconds` [s]; only `error` and `seconds` if the diagnosis failed.
    """
    began = time.perf_counter()
    try:
        found = _diagnosed(logs)
    except Exception as error:  # a failed diagnosis is a wrong answer
        found = {"error": f"{type(error).__name__}: {error}"[:300]}
    found["seconds"] = round(time.perf_counter() - began, 1)
    return found


def floor(logs: Logs, known: Sequence[dict[str, Any]]) -> list[float] | None:
    """Return the errors on the held-out days, by horizon, of a model that starts with the hidden effects.

    Parameters
    ----------
    logs : Logs
    known : sequence of dict
        The effects as tables, with their drawn events.

    Returns
    -------
    list of float or None
        None if the model cannot be calibrated.
    """
    try:
        gap = _diagnosed(logs, 0, known).get("gap")
    except RividError:
        return None
    return None if gap is None else list(gap["rmse_baseline"])
