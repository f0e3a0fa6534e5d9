"""The library as columns: what each effect would do to the output, for a small or usual size of it.

A trial is one or more instances of an effect. Its columns are what the baseline gains by them, per unit of
what is estimated; a coefficient and a window make an effect of it again. Effects whose size does not act in
proportion (lags, clocks, basins) have a trial for each of a few sizes.
"""

import datetime as dt
from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace
from typing import Any

import numpy as np

from rivid.diagnosis.data import Record
from rivid.diagnosis.score import Dates
from rivid.effects import CATALOGUE, Effect
from rivid.types import DAY, Floats

HOURS_A_DAY = 24
RIVER = {
    "lateral_inflow",
    "diurnal_inflow",
    "unlogged_upstream_release",
    "inflow_gain_error",
    "clock_offset",
    "flow_dependent_delay",
    "wave_attenuation",
}
"""Effects of the catalogue that make sense without an outflow and a level."""
Window = tuple[tuple[dt.date, dt.date] | None, tuple[float, float] | None]


@dataclass(frozen=True)
class Trial:
    """An effect to try.

    Attributes
    ----------
    name : str
        Canonical name.
    label : str
        Which of its trials.
    effects : tuple of Effect
        An instance for each column; none where the columns come from the step response, hour by hour.
    sizes : tuple of float
        What each instance is, in units of its coefficient.
    make : callable
        Coefficients, shape (k,), to the effect.
    free : tuple of str
        Parameters to refit once it is in.
    dates : {"all", "from", "until", "between"}
        Windows to scan.
    sign : {-1, 0, 1}
        Of its one coefficient.
    hourly : {"", "up", "down"}
        Columns hour by hour from the step response of a flow at the upstream or the downstream dam.
    """

    name: str
    label: str
    effects: tuple[Effect, ...]
    sizes: tuple[float, ...]
    make: Callable[[Floats], Effect]
    free: tuple[str, ...]
    dates: Dates = "all"
    sign: int = 0
    hourly: str = ""


def new(effect: Callable[..., Effect], **values: Any) -> Effect:
    """An instance; of which parameters is known only when it runs."""
    return effect(**values)


def clipped(effect: type[Effect], name: str, value: float) -> float:
    """A value inside the limits of an effect's parameter."""
    said = effect.parameters()[name]
    return float(min(max(value, said.low), said.high))


def _label(values: dict[str, Any]) -> str:
    def text(value: Any) -> str:
        return " to ".join(f"{v:g}" for v in value) if isinstance(value, tuple) else f"{value:g}"

    return ", ".join(f"{name} {text(value)}" for name, value in values.items())


def with_window(effect: Effect, window: Window) -> Effect:
    """The effect within dates and hours; unchanged where it is always there or has its own."""
    dates, hours = window
    if not effect.windowed:
        return effect
    return replace(effect, dates=dates or effect.dates, hours=hours or effect.hours)


def one(effect: type[Effect], key: str, unit: float, fixed: dict[str, Any], **rest: Any) -> Trial:
    """A trial of one coefficient that is a parameter itself."""

    def make(c: Floats) -> Effect:
        return new(effect, **fixed, **{key: clipped(effect, key, float(c[0]))})

    label = _label(fixed) or key
    small = new(effect, **fixed, **{key: unit})
    return Trial(effect.name, label, (small,), (unit,), make, (key, *rest.pop("also", ())), **rest)


def scaled(effect: type[Effect], key: str, size: float, fixed: dict[str, Any], **rest: Any) -> Trial:
    """A trial at one size; its coefficient is the share of that size."""

    def make(c: Floats) -> Effect:
        share = float(np.clip(c[0], 0.3, 2.5))
        return new(effect, **fixed, **{key: clipped(effect, key, share * size)})

    label = _label({**fixed, key: size})
    at = new(effect, **fixed, **{key: size})
    return Trial(effect.name, label, (at,), (1.0,), make, (key, *rest.pop("also", ())), sign=1, **rest)


def pool_trials(classes: dict[str, type[Effect]], sample_time: float) -> list[Trial]:
    """Trials of a pool, in the order of the catalogue; effects of users at their usual size.

    Parameters
    ----------
    classes : dict
        Effects to try, by name; from :func:`rivid.effects.effect_classes`.
    sample_time : float
        T_s [s]; clocks are tried at its multiples.
    """
    found: list[Trial] = []
    for name, effect in classes.items():
        found += _of(name, effect, sample_time)
    return found


def _of(name: str, effect: type[Effect], T_s: float) -> list[Trial]:
    match name:
        case "lateral_inflow":
            return [one(effect, "inflow", 1.0, {}, dates="between")]
        case "diurnal_inflow":
            return [_diurnal(effect)]
        case "unlogged_upstream_release":
            return [_by_hours(effect, "up", {})]
        case "unlogged_downstream_release":
            return [_by_hours(effect, "down", {"per_day": 0.0})]
        case "leakage":
            return [one(effect, "loss", 10.0, {}, sign=1)]
        case "inflow_gain_error" | "outflow_gain_error":
            shifts = [(5.0, 13.0), (13.0, 21.0), (21.0, 5.0)]
            return [
                one(effect, "error", 0.02, {}, dates="between"),
                *(one(effect, "error", 0.02, {"hours": hours}) for hours in shifts),
            ]
        case "gate_head_effect":
            return [one(effect, "gain", 0.05, {}, sign=1)]
        case "storage_area_slope":
            return [one(effect, "slope", 0.1, {})]
        case "side_storage":
            return [
                scaled(effect, "area", area, {"exchange": exchange}, also=("exchange",))
                for area in (1e5, 3e5)
                for exchange in (20.0, 100.0)
            ]
        case "flow_dependent_delay":
            return [one(effect, "delay", sign * 0.5, {}, sign=sign) for sign in (-1, 1)]
        case "wave_attenuation":
            return [scaled(effect, "spread", s, {}) for s in (300.0, 900.0)]
        case "outflow_lag":
            return [scaled(effect, "lag", s, {}) for s in (200.0, 600.0, 1500.0)]
        case "clock_offset":
            steps = (-4.0, -1.0, 1.0, 4.0)
            return [scaled(effect, "offset", k * T_s, {}, dates="between") for k in steps]
        case "gate_deadband":
            return [scaled(effect, "band", s, {}) for s in (3.0, 8.0)]
        case "gate_rate_limit":
            return [scaled(effect, "rate", s, {}) for s in (0.02, 0.08)]
        case "sensor_drift":
            return [one(effect, "drift", 0.005, {}, dates="between")]
        case "rain_inflow" | "sensor_step" | "wind_setup" | "seiche":
            return []  # events, and noises: found otherwise
    return _of_a_user(effect)


def _diurnal(effect: type[Effect]) -> Trial:
    def make(c: Floats) -> Effect:
        hour = float(np.mod(np.arctan2(c[1], c[0]) * 24.0 / (2.0 * np.pi), 24.0))
        size = clipped(effect, "amplitude", float(np.hypot(*c)))
        return new(effect, amplitude=size, hour=hour)

    parts = tuple(new(effect, amplitude=1.0, hour=hour) for hour in (0.0, 6.0))
    return Trial(effect.name, "24 h", parts, (1.0, 1.0), make, ("amplitude", "hour"), dates="between")


def _by_hours(effect: type[Effect], dam: str, fixed: dict[str, Any]) -> Trial:
    def make(c: Floats) -> Effect:
        return new(effect, **fixed, size=clipped(effect, "size", float(c[0])))

    return Trial(effect.name, "hours", (), (), make, ("size",), dates="between", sign=1, hourly=dam)


def _of_a_user(effect: type[Effect]) -> list[Trial]:
    """An effect that rivid does not know: at its usual size, all its single numbers free."""
    usual = effect.defaults()
    free = tuple(key for key, value in usual.items() if isinstance(value, float | int) and value != 0)
    if set(effect.parameters()) - set(usual) or not free:
        return []
    first = free[0]

    def make(c: Floats) -> Effect:
        return new(effect, **{first: clipped(effect, first, float(c[0]) * float(usual[first]))})

    return [Trial(effect.name, "usual size", (effect(),), (1.0,), make, free)]


def hour_columns(record: Record, kernel: Floats) -> Floats:
    """Output for 1 m3/s in each hour of the day, from the response to a step; shape (24, days, n).

    Parameters
    ----------
    record : Record
    kernel : ndarray, shape (n,)
        Output at each sample after 1 m3/s set in.

    Notes
    -----
    The reach is taken as linear here; what is found is fitted in the simulator afterwards.
    """
    days, n = record.time.shape
    pulse = np.diff(kernel, prepend=0.0)
    columns = np.empty((HOURS_A_DAY, days, n))
    hour = np.mod(record.time, DAY) / 3600.0
    for h in range(HOURS_A_DAY):
        on = ((hour >= h) & (hour < h + 1)).astype(float)
        size = 1 << (2 * n - 1).bit_length()
        spectrum = np.fft.rfft(on, size, axis=1) * np.fft.rfft(pulse, size)
        columns[h] = np.fft.irfft(spectrum, size, axis=1)[:, :n]
    return columns


def columns_of(trial: Trial, baseline: Callable[[Sequence[Effect]], Floats], before: Floats) -> Floats:
    """Columns of a trial that has instances, shape (k, days, n): what the baseline gains by each.

    Parameters
    ----------
    trial : Trial
    baseline : callable
        Output for further effects, shape (days, n).
    before : ndarray, shape (days, n)
        Output without them.
    """
    return np.stack(
        [
            (baseline((effect,)) - before) / size
            for effect, size in zip(trial.effects, trial.sizes, strict=True)
        ]
    )


def trials_of(classes: dict[str, type[Effect]], record: Record) -> list[Trial]:
    """Trials that make sense for a record: a river reach has no outflow and no level."""
    found = pool_trials(classes, record.sample_time)
    if record.kind == "pool":
        return found
    return [t for t in found if t.name in RIVER or t.name not in CATALOGUE]
