"""Which reach responses are calibrated, and which of them describes the reach well enough.

The nominal responses follow from the configuration. The choice is by the likelihood of days that were not
used for fitting: a response that cannot follow the waves of a reach leaves residuals that look like effects,
and one with too many coefficients absorbs a true effect.
"""

from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace

import numpy as np

from rivid.config import Config
from rivid.core.hydraulics import travel_bounds
from rivid.diagnosis.blocks import Split
from rivid.diagnosis.data import Record
from rivid.diagnosis.fit import Evaluation, Linear, Model, calibrate, evaluate
from rivid.diagnosis.response.base import Response
from rivid.diagnosis.response.hydraulic import HydraulicResponse
from rivid.diagnosis.response.linear import Fronts, LinearPool
from rivid.diagnosis.response.river import RiverResponse
from rivid.effects import Effect, effect_classes
from rivid.errors import ConfigError, RividError

TOLERANCE = 2.0
"""Nats a selecting day by which a later candidate must be likelier than a preferred one."""
RECOVERED = 0.6
"""Share of a response's deficit that one effect must recover: effects are tried at one size only."""
FEW = 12
"""Fitting days from which the fit starts on every third."""


@dataclass(frozen=True, eq=False)
class Calibrated:
    """A candidate, calibrated."""

    model: Model
    linear: Linear
    evaluation: Evaluation
    deficit: float = 0.0  # log-likelihood of the selecting days below that of the best candidate [nats]

    @property
    def shortfall(self) -> float:
        """Gain on the selecting days that it needs to be accepted [nats]; 0 or less where it is."""
        return self.deficit - TOLERANCE * max(int(self.linear.split.select.sum()), 1)

    def acceptable(self, gain: float = 0.0) -> bool:
        """Whether it is accepted with an effect that gains so much on the selecting days [nats]."""
        return self.shortfall <= 0.0 or gain >= min(self.shortfall, RECOVERED * self.deficit)


def calibrated(
    record: Record,
    dealt: Split,
    candidates: Sequence[Model],
    trim: float,
    report: Callable[[str], None] = lambda _: None,
) -> tuple[list[Calibrated], tuple[str, ...]]:
    """Calibrate the candidates, and compare their likelihoods of the selecting days.

    Parameters
    ----------
    record : Record
    dealt : Split
    candidates : sequence of Model
        In order of preference, not calibrated.
    trim : float
        Share of the noisiest days left out of the fit.
    report : callable

    Returns
    -------
    list of Calibrated
        In the same order, up to the first within :data:`TOLERANCE` a day of the best.
    tuple of str
        Errors of those that cannot be run.

    Raises
    ------
    RividError
        Where no candidate can be calibrated; the error of the first one.

    Notes
    -----
    By likelihood, not by the error some hours ahead: this is mostly due to the unknown inflow and hardly
    differs between a good response and a poor one. A less likely candidate may still be the right one with an
    effect that the logs lack: many coefficients absorb a slow gate or a late wave.
    """
    done: list[Calibrated] = []
    refused: list[RividError] = []
    for model in candidates:
        report(f"calibrating the response: {model.reach.name}")
        try:
            done.append(_calibrated(model, record, dealt, trim, report))
        except RividError as error:
            refused.append(error)
    if not done:
        raise refused[0]
    gains = np.array([one.evaluation.likelihood[dealt.select].sum() for one in done])
    done = [replace(one, deficit=float(gains.max() - gain)) for one, gain in zip(done, gains, strict=True)]
    last = next(i for i, one in enumerate(done) if one.shortfall <= 0.0)
    return done[: last + 1], tuple(str(error) for error in refused)


def _calibrated(
    model: Model, record: Record, dealt: Split, trim: float, report: Callable[[str], None]
) -> Calibrated:
    fit = np.flatnonzero(dealt.fit)
    if len(fit) >= FEW:
        model = calibrate(model, record.take(fit[::3]), trim=trim, report=report)
    model = calibrate(model, record.take(fit), trim=trim, report=report)
    linear = model.linear(record, dealt)
    return Calibrated(model, linear, evaluate(linear))


def as_candidates(response: Response | Sequence[Response]) -> tuple[Response, ...]:
    """One response, or several in order of preference."""
    return tuple(response) if isinstance(response, Sequence) else (response,)


FALLBACKS: tuple[Fronts, ...] = ("none", "zero", "fir")
SPREAD = 0.3
"""Spread of a river's arrivals, first guess, as a share of its delay."""


def responses_of(config: Config, record: Record) -> tuple[Response, ...]:
    """Nominal responses of the configured reach, in order of preference.

    A pool: Saint-Venant, the integrator with its delay, the same with fronts, FIRs on both flows. A river: a
    diffusive wave.

    Raises
    ------
    ConfigError
        Where the geometry is impossible.
    """
    first = response_of(config, record)
    if record.kind == "river":
        return (first,)
    reach = config.reach
    bounds = travel_bounds(record.usual_flow, length=reach.length, width=reach.width, depth=reach.depth)
    rest = [
        LinearPool.nominal(record, fronts, surface_area=reach.surface_area, delay=float(bounds.gravity))
        for fronts in FALLBACKS
    ]
    return (first, *rest)


def response_of(config: Config, record: Record) -> Response:
    """The preferred response: Saint-Venant for a pool, a diffusive wave for a river."""
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
    depth = reach.depth if reach.bed_level is None else level - reach.bed_level
    if not depth > 0:
        raise ConfigError(
            f"reach.bed_level = {reach.bed_level} m: expected less than the usual level {level:.2f} m"
        )
    settings = config.diagnose
    return HydraulicResponse.nominal(
        reach.length, reach.width, depth, level, sample_time=reach.sample_time, flow=flow,
        slope=settings.slope, manning=settings.manning,
    )  # fmt: skip


def library_of(config: Config) -> dict[str, type[Effect]]:
    """The effects that may be named."""
    settings = config.diagnose
    classes = effect_classes(settings.effects_file)
    for name in settings.exclude:
        if name not in classes:
            raise ConfigError(
                f"diagnose.exclude: no effect is called {name!r}: expected {', '.join(classes)}"
            )
    return {name: one for name, one in classes.items() if name not in settings.exclude}


def gauge_floor_of(config: Config, record: Record) -> float:
    """Least gauge noise [m or m3/s]: that of the reading's step, configured or seen in the readings."""
    step = config.diagnose.gauge_step
    if step is None:
        moves = np.abs(np.diff(record.output[record.used]))
        moves = moves[moves > 1e-6]
        step = float(np.quantile(moves, 0.05)) if len(moves) else 0.0
    return float(step / np.sqrt(12.0))
