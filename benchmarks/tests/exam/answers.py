"""Answers made by hand, as diagnosis.json has them, and a truth to judge them by."""

import datetime as dt
from typing import Any


def effect(
    name: str, *, tied=(), dates=None, hours=None, parameters=(), breaker=None, events=0
) -> dict[str, Any]:
    return {
        "name": name, "tied_with": list(tied), "breaker": breaker, "events": events,
        "where": {"dates": dates, "hours": hours, "regime": None},
        "parameters": [
            dict(zip(("name", "value", "low", "high", "unit"), p, strict=True)) for p in parameters
        ],
    }  # fmt: skip


def gap(base=(4.0, 8.0, 20.0), end=(2.0, 4.0, 10.0), steps=()) -> dict[str, Any]:
    return {"rmse_baseline": list(base), "rmse_augmented": list(end), "steps": list(steps)}


def answer(*effects, verdict=None, unknown=None, errors=None) -> dict[str, Any]:
    return {
        "verdict": verdict or ("explained" if effects else "no_gap"), "effects": list(effects),
        "unknown": unknown, "gap": errors or gap(), "reach_response": "saint-venant", "seconds": 1.0,
    }  # fmt: skip


def truth(*effects, days=60) -> dict[str, Any]:
    return {"effects": list(effects), "first_day": dt.date(2008, 1, 1).isoformat(), "days": days}
