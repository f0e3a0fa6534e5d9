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

AS_GOOD = 2.0
"""Nats a selecting day by which a later candidate must be ahead of one that is preferred to it."""
PROMISE = 0.6
"""Share of what a response is behind that one effect must promise: it is tried at one size only."""
FEW = 12
"""Fitting days from which every third is fitted to first."""


@dataclass(frozen=True, eq=False)
class Calibrated:
    """A candidate, calibrated.

    Attributes
    ----------
    model : Model
    linear : Linear
    evaluation : Evaluation
    behind : float
        By how much the selecting days are less likely than under the best candidate [nats].
    """

    model: Model
    linear: Linear
    evaluation: Evaluation
    behind: float = 0.0

    @property
    def as_good(self) -> bool:
        """Whether it is near enough to the best."""
        return self.lacks <= 0.0

    @property
    def lacks(self) -> float:
        """What it must gain on the selecting days to be near enough [nats]."""
        return self.behind - AS_GOOD * max(int(self.linear.split.select.sum()), 1)

    def lives_up(self, promise: float) -> bool:
        """Whether an effect that gains so much on the selecting days [nats] makes up for what it lacks."""
        return promise >= min(self.lacks, PROMISE * self.behind)


def calibrated(
    record: Record,
    dealt: Split,
    candidates: Sequence[Model],
    trim: float,
    report: Callable[[str], None] = lambda _: None,
) -> tuple[list[Calibrated], tuple[str, ...]]:
    """Calibrate the candidates, and say how far each is behind the best.

    Parameters
    ----------
    record : Record
    dealt : Split
    candidates : sequence of Model
        In order of preference, not calibrated.
    trim : float
        Share of the noisiest days that count for nothing.
    report : callable

    Returns
    -------
    list of Calibrated
        In the same order, to the first that is within :data:`AS_GOOD` a day of the best.
    tuple of str
        What those said that cannot be run.

    Raises
    ------
    RividError
        Where no candidate can be calibrated; with what the first one said.

    Notes
    -----
    By likelihood, not by the error some hours ahead: this is mostly the unknown inflow's and hardly differs
    between a good response and a poor one. A candidate that is behind may still be the right one, if what it
    lacks is what the logs lack: coefficients enough take a slow gate or a late wave upon themselves.
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
    done = [replace(one, behind=float(gains.max() - gain)) for one, gain in zip(done, gains, strict=True)]
    last = next(i for i, one in enumerate(done) if one.as_good)
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
"""Of a river's arrivals, first guess, as a share of its delay."""


def responses_of(config: Config, record: Record) -> tuple[Response, ...]:
    """Nominal responses of the configured reach, in order of preference.

    A pool: Saint-Venant, the integrator with its delay, the same with fronts, FIRs on both flows. A river: a
    diffusive wave.

    Raises
    ------
    ConfigError
        Where the geometry gives none.
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
    """The first of them: Saint-Venant for a pool, a diffusive wave for a river."""
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
    said = config.diagnose
    return HydraulicResponse.nominal(
        reach.length, reach.width, depth, level, sample_time=reach.sample_time, flow=flow, slope=said.slope,
        manning=said.manning,
    )  # fmt: skip


def library_of(config: Config) -> dict[str, type[Effect]]:
    """The effects that may be named."""
    said = config.diagnose
    classes = effect_classes(said.effects_file)
    for name in said.exclude:
        if name not in classes:
            raise ConfigError(
                f"diagnose.exclude: no effect is called {name!r}: expected {', '.join(classes)}"
            )
    return {name: one for name, one in classes.items() if name not in said.exclude}


def gauge_floor_of(config: Config, record: Record) -> float:
    """Least gauge noise [m or m3/s]: that of the reading's step, configured or seen in the readings."""
    step = config.diagnose.gauge_step
    if step is None:
        moves = np.abs(np.diff(record.output[record.used]))
        moves = moves[moves > 1e-6]
        step = float(np.quantile(moves, 0.05)) if len(moves) else 0.0
    return float(step / np.sqrt(12.0))
