"""Model in the simulator, limits of its noise, and the gap: the error of forecasts some hours ahead.

A forecast of h hours starts from the filtered state of the noise at its origin and then runs free.
"""

from dataclasses import dataclass, replace
from typing import Literal, NamedTuple

import numpy as np
from numpy.typing import ArrayLike

from rivid.diagnosis.data import Record
from rivid.diagnosis.noise.model import NoiseModel, fit_noise
from rivid.diagnosis.response.base import Response
from rivid.effects import Effect, changes_of
from rivid.errors import RividError
from rivid.reach.changes import Changes
from rivid.types import DAY, HOUR, Floats

HOURS = (1.0, 4.0, 24.0)  # horizons of the gap [h]
NEAR = 0.25
"""Additional horizon for materiality [h]: the error of a slow gate is over within a quarter of an hour."""
EVERY, START = HOUR, HOUR / 2.0
"""Time between forecast origins, and time before the first one of a row for the filter to settle [s]."""


NoiseKind = Literal["plain", "wind", "flow", "gauge"]
"""Noise of usual weather and gauge; with wind as well; an unknown flow of any size; an unknown gauge
error."""
WEATHER = 0.025  # largest plausible unlogged inflow over the usual flow [-]: weather makes 0.3 to 2 %
MEMORY = (HOUR / 2.0, DAY)  # limits of the memory of the weather [s]
METER = 0.005  # largest plausible standard deviation of a logged flow over the usual flow [-]
RATING = 0.02
"""Largest plausible white noise of a river gauge over the usual flow: a few mm of level and the rating."""
MISFIT = 0.3  # largest plausible misfit: fronts that are early or late by this number of samples
GAUGE = 0.015  # largest plausible white noise of a gauge [m]
WHITE, LASTING = 0.5, (0.1, 1.0)
"""Least white part of a reading's rounding error, and limits of its correlated part, over step / sqrt(12): a
reading in steps keeps its error until the level has moved by a step. Noise of half a step makes it white."""
WAVE = 0.5  # least wave of an inflow [samples], which shows from one on
WIND = (0.3 * HOUR, DAY)  # limits of the memory of a wind set-up [s]


class DayErrors(NamedTuple):
    """Sum of squared forecast errors and number of forecasts of each day, shape (horizons, days) each."""

    squares: Floats
    counts: Floats

    def rmse(self, days: ArrayLike | None = None) -> Floats:
        """Return the RMSE of each horizon over some days, shape (horizons,); NaN without forecasts."""
        chosen = slice(None) if days is None else np.asarray(days)
        counts = self.counts[:, chosen].sum(axis=1)
        squares = self.squares[:, chosen].sum(axis=1)
        means = np.divide(squares, counts, out=np.full(len(counts), np.nan), where=counts > 0)
        return np.asarray(np.sqrt(means))


def residual_of(record: Record, baseline: Floats) -> Floats:
    """Return measured minus simulated output, NaN where nothing was measured; shape (days, n)."""
    return np.where(np.isfinite(record.output), record.output - baseline, np.nan)


def day_errors(
    record: Record, residual: Floats, noise: NoiseModel, hours: tuple[float, ...] = HOURS
) -> DayErrors:
    """Compute forecast errors at each horizon [h] for targets at used samples."""
    # `residual` (days, n) is from residual_of. Origins may lie in the lead time, so that forecasts cross
    # midnight.
    days, n = residual.shape
    squares, counts = np.zeros((len(hours), days)), np.zeros((len(hours), days))
    usual = max(round(EVERY / record.sample_time), 1)
    for i, horizon in enumerate(hours):
        steps = max(round(horizon * HOUR / record.sample_time), 1)
        # A day ahead, origins are few and all in the lead time.
        near = steps < n // 2
        blind = record.blind if near else 0
        first = min(blind + max(round(START / record.sample_time), 1), n - steps - 1)
        if first < 0:
            continue
        every = usual if near else max(usual // 3, 1)
        clear = np.where(np.arange(n) >= blind, residual, np.nan)
        errors = noise.forecast_errors(clear, steps, every=every, first=first, activity=record.activity)
        targets = np.arange(first, n - steps, every) + steps
        known = np.isfinite(errors) & record.used[:, targets]
        squares[i] = np.where(known, errors**2, 0.0).sum(axis=1)
        counts[i] = known.sum(axis=1)
    return DayErrors(squares, counts)


OFF, SOME = 0.01, 4
"""Shift of the observed level [m], and number of days, from which the decay of a level error is estimated."""
WIDE = 10.0  # prior standard deviation of an effect's parameter over its size (scales): nearly flat
ENOUGH = 1.0  # A fit ends when a step reduces the cost by less [nats]
DIFFERENCE = 0.05  # step of an effect's parameter over its size, by which its column is computed
TRIES = 4
"""Dampings tried in a step: from 1e-4 to 0.64, which is 61 % of a Newton step in uncorrelated parameters."""


@dataclass(frozen=True, eq=False)
class Model:
    """A response with effects and noise."""

    reach: Response
    noise: NoiseModel | None  # none before the first fit
    level: float  # reference of level- and flow-dependent effects [m], [m3/s]
    flow: float
    gauge_floor: float  # lower limit of the gauge noise
    effects: tuple[Effect, ...] = ()
    free: tuple[tuple[str, ...], ...] = ()  # fitted parameters of each effect
    noise_kind: NoiseKind = "plain"

    def fit_noise(
        self, residual: Floats, record: Record, weights: Floats | None, alone: bool = True,
        memory: float = MEMORY[1],
    ) -> NoiseModel:  # fmt: skip
        """Fit noise of the model's kind to a residual (days, n); with `alone` from the present noise only.

        `memory` is the upper limit of the memory of the weather [s].
        """
        level = self.noise_kind in ("wind", "gauge")
        white = 1.0 if self.reach.surface_area is None else WHITE
        return fit_noise(
            residual, record.sample_time, self.reach.surface_area, weights=weights, level=level,
            gauge_floor=white * self.gauge_floor, activity=record.activity, alone=alone,
            within=self.plausible(record, memory), starts=() if self.noise is None else (self.noise,),
        )  # fmt: skip

    def plausible(self, record: Record, memory: float = MEMORY[1]) -> dict[str, tuple[float, float]]:
        """Return limits of the noise's fields: usual weather and gauge, except for what is unknown."""
        flow, T = max(abs(self.flow), 1e-9), record.sample_time
        wave = {"wave": (WAVE * T, max(T, self.reach.longest_wave))}
        if self.reach.surface_area is None:
            known = {
                "level_sd": (0.0, WEATHER * flow),
                "level_memory": (MEMORY[0], memory),
                "gauge_sd": (0.0, max(RATING * flow, 2.0 * self.gauge_floor)),
            }
            # an unknown flow may change at once
            return {} if self.noise_kind in ("flow", "gauge") else known | wave
        limits = wave | {"gauge_sd": (0.0, max(GAUGE, 2.0 * self.gauge_floor))}
        if self.noise_kind != "flow":
            limits |= {"inflow_sd": (0.0, WEATHER * flow), "inflow_memory": (MEMORY[0], memory)}
        if self.noise_kind in ("plain", "wind"):
            limits["misfit"] = (0.0, MISFIT)
        if self.noise_kind != "gauge":  # unlogged flow has a memory, however large it is
            limits["walk_sd"] = (0.0, METER * flow * T / self.reach.surface_area)
        if self.noise_kind in ("plain", "flow") and self.gauge_floor > 0.0:
            limits["level_sd"] = (LASTING[0] * self.gauge_floor, LASTING[1] * self.gauge_floor)
            limits["level_memory"] = (0.0, HOUR)
        if self.noise_kind == "wind":
            limits["level_memory"] = WIND
        return limits

    def changes(self, record: Record) -> Changes:
        """Return the changes that the effects make on a record."""
        return changes_of(self.effects, record.world(self.level, self.flow))

    def baseline(self, record: Record) -> Floats:
        """Return the output about the observed output, shape (days, n)."""
        return self.reach.baseline(record, self.changes(record))

    @property
    def rough(self) -> "Model":
        """The model with the cheaper response."""
        rough = self.reach.rough
        return self if rough is self.reach else replace(self, reach=rough)

    def fine(self, record: Record, plain: Floats | None = None) -> tuple[Floats, Floats]:
        """Return the baseline, and what it adds to that of the cheaper response; shape (days, n) each.

        `plain` may be the latter, if it is known.
        """
        base, rough = self.baseline(record), self.rough
        if rough is self:
            return base, 0.0 * base
        return base, base - (rough.baseline(record) if plain is None else plain)

    def recall(self, record: Record) -> float:
        """Return the share of a level error that remains after a sample; 1 with most effects."""
        # It is estimated from baselines of some days with the observed level shifted by OFF.
        changes = self.changes(record)
        follows = changes.leaks or changes.ponds or changes.area_slope or changes.gate.head.any()
        if record.kind == "river" or not follows:
            return 1.0
        few = record.take(np.linspace(0, record.days - 1, min(record.days, SOME)).astype(int))
        off = replace(few, output=few.output + OFF)
        rough = self.rough
        bare = replace(rough, effects=(), free=())
        try:
            more, plain = (one.baseline(off) - one.baseline(few) for one in (rough, bare))
        except RividError:
            return 1.0
        steps = min(max(round(HOURS[1] * HOUR / record.sample_time), 1), few.time.shape[1] - 1)
        fallen = float(np.median((plain - more)[:, steps])) / OFF  # as the shift stays, the decay is linear
        return float(1.0 - min(max(fallen / steps, 0.0), 0.95))

    def values(self) -> Floats:
        """Return the free values of the effects, shape (q,)."""
        return np.array([value for _, _, value in self.slots()])

    def slots(self) -> list[tuple[int, tuple[str, int | None], float]]:
        """List the free values of the effects: index of the effect, (parameter, index in a tuple), value."""
        slots: list[tuple[int, tuple[str, int | None], float]] = []
        for i, (effect, names) in enumerate(zip(self.effects, self.free, strict=True)):
            for name in names:
                value = getattr(effect, name)
                if isinstance(value, tuple):
                    slots += [(i, (name, k), float(v)) for k, v in enumerate(value)]
                else:
                    slots.append((i, (name, None), float(value)))
        return slots

    def scales(self) -> Floats:
        """Return a usual size of each free value, shape (q,)."""
        sizes = []
        for i, (name, _), value in self.slots():
            usual = self.effects[i].defaults().get(name, 1.0)
            usual = (float(np.max(np.abs(usual))) if np.size(usual) else 0.0) or 1.0
            sizes.append(max(abs(value), 0.2 * usual, 1e-9))
        return np.array(sizes)

    def with_values(self, values: Floats) -> "Model":
        """Return the model with other free values, clipped to the effects' limits."""
        effects = list(self.effects)
        for (i, (name, k), _), value in zip(self.slots(), values.tolist(), strict=True):
            limits = effects[i].parameters()[name]
            if name == "hour":
                value %= 24.0
            value = min(max(value, limits.low), limits.high)
            if k is None:
                effects[i] = replace(effects[i], **{name: value})
            else:
                whole = list(getattr(effects[i], name))
                whole[k] = value
                effects[i] = replace(effects[i], **{name: tuple(whole)})
        return replace(self, effects=tuple(effects))

    def jacobian(self, record: Record, base: Floats, shared: Floats | None = None) -> Floats:
        """Compute the columns (p + q, days, n) of all free parameters by the cheaper response.

        `base` is its baseline; `shared` may be the columns of the response.
        """
        p, values, rough = len(self.reach.parameters), self.values(), self.rough
        if shared is not None and not len(values):
            return np.asarray(shared, float)
        columns = np.empty((p + len(values), *base.shape))
        columns[:p] = rough.reach.slopes(record, base, self.changes(record)) if shared is None else shared
        for j, scale in enumerate(self.scales()):
            for share in (DIFFERENCE, -DIFFERENCE):  # a step down from the upper limit
                moved = self.with_values(values + share * scale * (np.arange(len(values)) == j))
                step = moved.values()[j] - values[j]
                if abs(step) >= 1e-3 * scale:
                    break
            columns[p + j] = (moved.rough.baseline(record) - base) / step
        return columns
