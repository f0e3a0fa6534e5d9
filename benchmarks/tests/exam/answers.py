"""Hand-made answers with the structure of diagnosis.json, and truths to judge them by."""

from typing import Any


def effect(name: str, *, tied=(), parameters=(), events=0, probability=None) -> dict[str, Any]:
    return {
        "name": name, "tied_with": list(tied), "events": events, "probability": probability,
        "parameters": [
            dict(zip(("name", "value", "low", "high", "unit"), p, strict=True)) for p in parameters
        ],
    }  # fmt: skip


def gap(base=(4.0, 8.0, 20.0), end=(2.0, 4.0, 10.0), described=None) -> dict[str, Any]:
    return {"rmse_baseline": list(base), "rmse_augmented": list(end), "rmse_described": described}


def ranked(*pairs) -> list[dict[str, Any]]:
    return [{"names": list(names), "probability": p} for names, p in pairs]


def answer(*effects, verdict=None, errors=None, ranking=()) -> dict[str, Any]:
    return {
        "verdict": verdict or ("explained" if effects else "no_gap"), "effects": list(effects),
        "gap": errors or gap(), "seconds": 1.0, "ranking": list(ranking),
    }  # fmt: skip


WORLD = {
    "water": "box", "operators": "crew", "programme": "peaking", "sample_time_s": 133.0,
    "gauge_step_m": 0.01, "well_s": 0.0, "length_m": 8200.0, "days": 60, "weather_share": 0.01,
}  # fmt: skip


def truth(*effects, kind=None, times=None, rivals=None, excluded=(), allowed=()) -> dict[str, Any]:
    return {
        "seed": 0, "kind": kind or ("one" if len(effects) == 1 else "two" if effects else "nothing"),
        "effects": list(effects), "times": list(times or [4.0] * len(effects)), "rivals": rivals or {},
        "nats": [50.0] * len(effects),
        "excluded": list(excluded), "allowed": list(allowed), "first_day": "2008-01-01", "days": 60,
        "world": WORLD,
    }  # fmt: skip
