"""Nominal responses of a configured reach, the library of effects, and the lower limit of the gauge noise."""

import numpy as np

from rivid.config import Config
from rivid.core.hydraulics import travel_bounds
from rivid.diagnosis.data import Record
from rivid.diagnosis.response.base import Response
from rivid.diagnosis.response.hydraulic import FALL, HydraulicResponse
from rivid.diagnosis.response.linear import Fronts, LinearPool
from rivid.diagnosis.response.river import RiverResponse
from rivid.effects import Effect, effect_classes
from rivid.errors import ConfigError

FALLBACKS: tuple[Fronts, ...] = ("none", "fir")
SPREAD = 0.3
"""Initial standard deviation of a river's arrival times, as a share of its delay [-]."""


def responses_of(config: Config, record: Record) -> tuple[Response, ...]:
    """Return the competing nominal responses of the configured reach."""
    # For a pool: Saint-Venant, an integrator with delay, and the same with FIR filters on both flows for
    # unknown dynamics. For a river: a diffusive wave.
    first = response_of(config, record)
    if record.kind == "river":
        return (first,)
    reach = config.reach
    bounds = travel_bounds(record.usual_flow, length=reach.length, width=reach.width, depth=reach.depth)
    rest = [
        LinearPool.nominal(
            record, fronts, surface_area=reach.surface_area, delay=float(bounds.gravity),
            speed_share=float(bounds.froude / (1.0 + bounds.froude)),
        )
        for fronts in FALLBACKS
    ]  # fmt: skip
    return (first, *rest)


def response_of(config: Config, record: Record) -> Response:
    """Return the preferred response: Saint-Venant for a pool, a diffusive wave for a river."""
    reach, flow = config.reach, record.usual_flow
    if reach.kind == "river":
        bounds = travel_bounds(flow, length=reach.length, width=reach.width, depth=reach.depth)
        delay = float(np.sqrt(bounds.gravity * bounds.kinematic))
        if not np.isfinite(delay):
            raise ConfigError(
                f"[reach] gives no travel time at {flow:.0f} m3/s: expected length, width and depth of a "
                "flow below critical"
            )
        return RiverResponse.nominal(delay, SPREAD * delay, flow)
    level = record.usual_output
    settings, depth = config.diagnose, reach.depth
    if reach.bed_level is not None:  # depth at the dam: mean depth plus half of the fall
        deepest = level - reach.bed_level
        depth = (
            deepest / (1.0 + 0.5 * FALL)
            if settings.slope is None
            else deepest - 0.5 * settings.slope * reach.length
        )
        if not depth > 0:
            raise ConfigError(
                f"reach.bed_level = {reach.bed_level} m: expected less than the usual level {level:.2f} m by "
                "more than half of the fall of the bed ([diagnose] slope times the length)"
            )
    return HydraulicResponse.nominal(
        reach.length, reach.width, depth, level, sample_time=record.sample_time, flow=flow,
        slope=settings.slope, manning=settings.manning,
    )  # fmt: skip


def library_of(config: Config) -> dict[str, type[Effect]]:
    """Return the effects that may be named."""
    settings = config.diagnose
    classes = effect_classes(settings.effects_file)
    for name in settings.exclude:
        if name not in classes:
            raise ConfigError(
                f"diagnose.exclude: no effect is called {name!r}: expected {', '.join(classes)}"
            )
    return {name: one for name, one in classes.items() if name not in settings.exclude}


def gauge_floor_of(config: Config, record: Record) -> float:
    """Return the least gauge noise [m or m3/s] from the configured or estimated step of readings."""
    step = config.diagnose.gauge_step
    if step is None:
        moves = np.abs(np.diff(record.output[record.used]))
        moves = moves[moves > 1e-6]
        step = float(np.quantile(moves, 0.05)) if len(moves) else 0.0
    return float(step / np.sqrt(12.0))
