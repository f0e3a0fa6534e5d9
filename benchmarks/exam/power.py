"""What 80 % power needs: the sizes of the exam, from what the logs can tell of each effect.

About a season with nothing missing, calibrated, an effect of size s changes the output by z(s); whitened, and
without what the response's parameters can do as well, |z(s)| is how many standard errors it is away from
nothing. The size is where |z(s)| is :data:`NEEDED`, on the days that fit and select.

That is what gauge and weather ask. Timing and storage are asked more by the misfit of a plain response to an
uneven reach, whose fronts come a little early here and late there: :data:`MISFIT` is by how much, from the
figures in :data:`GIVEN`, which were measured with such misfit. Events pay for the search of their places.

Noises have no column. Wind: where the noise with a level part is expected to be ahead of the plain one by
NEEDED^2 / 2 in log-likelihood. A seiche: the same from the spectra, by Whittle's likelihood, above white gauge
noise.

Usage: python -m benchmarks.exam.power, which writes benchmarks/exam/sizes.toml
"""

from collections.abc import Callable
from typing import Any

import numpy as np

from benchmarks.exam.answering import record_of, responses
from benchmarks.exam.cases import ROOT, SIZE_OF, SIZES_FILE, Case, resized
from benchmarks.exam.planting import plant, scenario_of
from rivid.diagnosis.blocks import split
from rivid.diagnosis.choice import gauge_floor_of
from rivid.diagnosis.fit import Linear, Model, calibrate
from rivid.diagnosis.noise.model import fit_noise
from rivid.effects import Effect, effect_classes
from rivid.effects.level import Seiche
from rivid.errors import RividError

NEEDED = 4.3
"""Standard errors: 3.5 for one name in 21 at 1 %, both signs, and 0.84 for 80 % power."""
SEED = 11
GIVEN = {
    "diurnal_inflow": 0.3,
    "unlogged_upstream_release": 0.5,
    "outflow_lag": 140.0,
    "clock_offset": 80.0,
    "storage_area_slope": 0.25,
}
"""Sizes that were measured before, with misfit; what is computed stands beside them for comparison."""


MISFIT = {
    "outflow_lag": 18.0, "clock_offset": 18.0, "flow_dependent_delay": 18.0, "wave_attenuation": 18.0,
    "gate_deadband": 18.0, "gate_rate_limit": 18.0, "storage_area_slope": 8.0, "side_storage": 8.0,
}  # fmt: skip
"""How many times the size that noise alone asks: 140 s of lag are 17 times, 80 s of a clock 21 times, 0.25 of
slope 8 times as much."""
EVENT = 12.0
"""What each event must gain for itself, as its place is searched for [nats]."""
EVENTS_A_DAY = {"rain_inflow": 8.0 / 30.0, "unlogged_downstream_release": 8.0, "sensor_step": 1.0 / 60.0}
WALK_LIMIT = 1e-3
"""Of the level's random walk where wind is tried [m per sample]: it would swallow the wind."""
FAR = 30.0
"""Of the planted size, at most."""


def crossing(distance: Callable[[float], float], needed: float) -> float:
    """The factor of the planted size at which the distance is what is needed, by halving its logarithm."""
    low, high = 1.0 / 3000.0, FAR
    for _ in range(14):
        middle = float(np.sqrt(low * high))
        low, high = (low, middle) if distance(middle) > needed else (middle, high)
    return float(np.sqrt(low * high))


def calibrated() -> tuple[Model, Linear]:
    """The fitted model of a season with nothing missing, and its linearisation."""
    logs = plant(Case("power", "power", "uneven", 1), SEED).logs
    record = record_of(logs)
    dealt = split(record.dates)
    model = Model(
        responses(logs, record)[0], None, record.usual_output, record.usual_flow,
        gauge_floor_of(logs.settings, record),
    )  # fmt: skip
    fit = np.flatnonzero(dealt.fit)
    for rows in (fit[::3], fit):
        model = calibrate(model, record.take(rows))
    return model, model.linear(record, dealt)


def of_column(effect: Effect, model: Model, linear: Linear) -> float:
    """Standard errors between an effect and nothing."""
    record = linear.record
    rows = linear.split.fit | linear.split.select
    z = model.baseline(record, (effect,)) - model.baseline(record)
    like, noise = linear.used(linear.residual)[rows], model.noise
    assert noise is not None
    z = noise.whiten(z[rows][None], like=like)[0].ravel()
    X = noise.whiten(linear.columns[:, rows], like=like).reshape(len(linear.columns), -1)
    X = X * linear.prior_sd[:, None]
    left = z - X.T @ np.linalg.solve(X @ X.T + np.eye(len(X)), X @ z)
    return float(np.linalg.norm(left))


def of_wind(effect: Effect, model: Model, linear: Linear) -> float:
    """The same of wind: from what a noise with a level part is ahead of one without."""
    record, noise = linear.record, model.noise
    assert noise is not None
    rows = linear.split.fit | linear.split.select
    drawn = model.baseline(record, (effect,)) - model.baseline(record)
    z = (linear.used(linear.residual) + drawn)[rows]
    plain, windy = (
        fit_noise(
            z, record.sample_time, noise.surface_area, gauge_floor=model.gauge_floor, level=level,
            starts=(noise,), walk_limit=WALK_LIMIT,
        )
        for level in (False, True)
    )  # fmt: skip
    ahead = float(windy.log_likelihood(z).sum() - plain.log_likelihood(z).sum())
    return float(np.sqrt(2.0 * max(ahead, 0.0)))


def of_seiche(effect: Effect, model: Model, linear: Linear) -> float:
    """The same of a seiche: Whittle's likelihood ratio of its spectrum above the gauge's."""
    record, noise = linear.record, model.noise
    assert noise is not None and isinstance(effect, Seiche)
    rows = linear.split.fit | linear.split.select
    swing = effect.autoregression(record.sample_time)
    n = int(record.used[rows].sum())
    turn = np.exp(-2j * np.pi * np.arange(1, n // 2) / n)
    a1, a2 = swing.coefficients
    power = swing.innovation**2 / np.abs(1.0 - a1 * turn - a2 * turn**2) ** 2
    ratio = 1.0 + power / (noise.gauge_sd**2 + 1e-12)
    return float(np.sqrt(2.0 * (ratio - 1.0 - np.log(ratio)).sum()))


Rule = Callable[[Effect, Model, Linear], float]


def measured() -> dict[str, float]:
    """The size of each effect."""
    model, linear = calibrated()
    classes, found = effect_classes(), {}
    for name, keys in SIZE_OF.items():
        table = scenario_of(Case("power", "power", f"effects/{name}", 1)).effects[0]
        rule = {"wind_setup": of_wind, "seiche": of_seiche}.get(name, of_column)

        def distance(factor: float, table: dict[str, Any] = table, rule: Rule = rule) -> float:
            try:
                return rule(classes[table["name"]].from_table(resized(table, factor)), model, linear)
            except RividError:  # beyond its limits
                return float("inf")

        events = EVENTS_A_DAY.get(name, 0.0) * int((linear.split.fit | linear.split.select).sum())
        needed, misfit = float(np.sqrt(NEEDED**2 + 2.0 * EVENT * events)), MISFIT.get(name, 1.0)
        if name == "gate_deadband":  # a band below the smallest move does nothing: of its standard errors
            needed, misfit = needed * misfit, 1.0
        factor = misfit * crossing(distance, needed)
        value = resized(table, factor)[keys[0]]
        found[name] = float(np.max(value))
        print(f"{name}: {keys[0]} = {found[name]:.3g}, {factor:.2g} of the planted one", flush=True)
    return found


def main() -> None:
    """Measure, and write the file."""
    found = measured()
    lines = [
        "# What 80 % power needs of each effect, in the unit of its size: 1x of the exam. Written by",
        "# `python -m benchmarks.exam.power`; where a figure was measured before, that one stands.",
        "",
        "[sizes]",
    ]
    for name, keys in SIZE_OF.items():
        given = GIVEN.get(name)
        size = found[name] if given is None else given
        note = f"  # {keys[0]}" + ("" if given is None else f"; computed: {found[name]:.2g}")
        lines.append(f"{name} = {float(f'{size:.2g}')}{note}")
    SIZES_FILE.write_text("\n".join(lines) + "\n", encoding="utf-8")
    print(f"written: {SIZES_FILE.relative_to(ROOT)}")


if __name__ == "__main__":
    main()
