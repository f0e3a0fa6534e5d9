"""The model in the simulator and its fit, and the gap: the error of the simulation some hours ahead.

Calibration takes Levenberg-Marquardt steps on the posterior of the parameters of response and effects
together; noise and day weights are refitted between steps, and a step is kept only if the cost falls.

Near the fit, the residual of a model with further columns is

    z' = z - J b - C c,

J the response's parameters (with their priors), C the columns of a candidate. Noise and day weights are
refitted with it, so that a candidate competes with an unknown inflow that shrinks as it explains more.

The error h hours ahead: at an origin the state of the noise is what the filter knows; from there the
simulation runs on its own.
"""

from collections.abc import Callable
from dataclasses import dataclass, replace
from typing import NamedTuple

import numpy as np
from numpy.typing import ArrayLike

from rivid.diagnosis.blocks import Split
from rivid.diagnosis.data import Record
from rivid.diagnosis.noise.model import NoiseModel, day_weights, fit_noise
from rivid.diagnosis.response.base import Response, sensitivities, vector_of
from rivid.effects import Effect, changes_of
from rivid.errors import RividError
from rivid.reach.changes import Changes
from rivid.types import Floats

HOURS = (1.0, 4.0, 24.0)
"""Horizons [h]."""
EVERY = 27
"""Samples between origins: about an hour at 133 s."""
START = 12
"""Samples before the first origin of a row: half an hour for the filter to settle."""


class DayErrors(NamedTuple):
    """Squared errors, shape (horizons, days): their sum over a day's origins, and how many there are."""

    squares: Floats
    counts: Floats

    def rmse(self, days: ArrayLike | None = None) -> Floats:
        """Root mean square error of each horizon over some days, shape (horizons,); NaN without origins."""
        chosen = slice(None) if days is None else np.asarray(days)
        counts = self.counts[:, chosen].sum(axis=1)
        squares = self.squares[:, chosen].sum(axis=1)
        means = np.divide(squares, counts, out=np.full(len(counts), np.nan), where=counts > 0)
        return np.asarray(np.sqrt(means))


def residual_of(record: Record, baseline: Floats) -> Floats:
    """Measured less simulated, NaN where nothing was measured; shape (days, n)."""
    return np.where(np.isfinite(record.output), record.output - baseline, np.nan)


def day_errors(
    record: Record, residual: Floats, noise: NoiseModel, hours: tuple[float, ...] = HOURS
) -> DayErrors:
    """Errors of the simulation at each horizon [h], of targets that the record uses.

    `residual` (days, n) is that of :func:`residual_of`; origins lie in the lead time too, so that a horizon
    crosses midnight.
    """
    days, n = residual.shape
    squares, counts = np.zeros((len(hours), days)), np.zeros((len(hours), days))
    for i, horizon in enumerate(hours):
        steps = max(round(horizon * 3600.0 / record.sample_time), 1)
        first = min(START, n - steps - 1)
        if first < 0:
            continue
        every = EVERY if steps < n // 2 else max(EVERY // 3, 1)
        errors = noise.forecast_errors(residual, steps, every=every, first=first)
        targets = np.arange(first, n - steps, every) + steps
        known = np.isfinite(errors) & record.used[:, targets]
        squares[i] = np.where(known, errors**2, 0.0).sum(axis=1)
        counts[i] = known.sum(axis=1)
    return DayErrors(squares, counts)


ODD = 4.0
"""Largest gain of a day, in gains of the usual day."""
REFITS = 2
"""Turns of least squares and noise for a candidate."""


@dataclass(frozen=True, eq=False)
class Linear:
    """A model about which candidates are tried."""

    record: Record
    split: Split
    residual: Floats  # (days, n): measured less simulated; NaN where nothing was measured
    # (p, days, n) The response's parameters: change of the simulated output for one unit of each.
    columns: Floats
    prior_sd: Floats  # (p,): prior standard deviation of each, and its present value less the prior's mean
    deviation: Floats
    noise: NoiseModel
    gauge_floor: float  # lower limit of the gauge noise [m or m3/s]
    level_noise: bool = False  # whether the noise has a level part (wind)

    def used(self, residual: Floats) -> Floats:
        """A residual with NaN where a sample is not used."""
        return np.where(self.record.used, residual, np.nan)

    def less(self, columns: Floats) -> "Linear":
        """The same with a column (days, n) subtracted from the residual."""
        return replace(self, residual=self.residual - columns)


@dataclass(frozen=True, eq=False)
class Evaluation:
    """The model refitted with some columns."""

    coefficients: Floats  # (k,): of the columns
    shift: Floats  # (p,): change of the response's parameters, and their standard errors
    shift_errors: Floats
    residual: Floats  # (days, n)
    noise: NoiseModel
    likelihood: Floats  # (days,): log-likelihood of each day
    # Half the squared deviations of the response's parameters from their priors, in standard deviations.
    penalty: float
    errors: DayErrors
    weights: Floats  # (days,)


def least_squares(
    model: Linear, columns: Floats | None, noise: NoiseModel, weights: Floats
) -> tuple[Floats, Floats, Floats]:
    """Coefficients of response and candidate, (p + k,), their standard errors, and the residual with them.

    Of the fitting days, with weights (days,); `columns` has the shape (k, days, n), or None.
    """
    p = len(model.columns)
    C = model.columns if columns is None else np.concatenate([model.columns, columns])
    z = model.used(model.residual)
    rows = model.split.fit
    root = np.sqrt(weights[rows])[:, None]
    X = (noise.whiten(C[:, rows], like=z[rows]) * root).reshape(len(C), -1)
    r = (noise.whiten(z[rows]) * root).ravel()
    scale = np.maximum(np.sqrt((X * X).mean(axis=1)), 1e-9)  # a column may be zero on these days
    X /= scale[:, None]
    G, g = X @ X.T, X @ r
    prior = 1.0 / (model.prior_sd * scale[:p]) ** 2
    G[np.arange(p), np.arange(p)] += prior
    g[:p] -= prior * model.deviation * scale[:p]
    G[np.diag_indices(len(G))] += 1e-9 * np.diag(G) + 1e-12  # columns that are nearly one, or nothing
    inverse = np.linalg.inv(G)
    b = inverse @ g / scale
    left = (r - X.T @ (b * scale)).reshape(rows.sum(), -1)
    block = np.unique(model.split.block[rows], return_inverse=True)[1]
    daily = np.einsum("jdn,dn->dj", X.reshape(len(C), *left.shape), left)
    scores = np.zeros((block.max() + 1, len(C)))
    np.add.at(scores, block, daily)
    scatter = inverse @ (scores.T @ scores) @ inverse  # where the blocks scatter more
    error = np.sqrt(np.maximum(np.maximum(np.diag(inverse), np.diag(scatter)), 0.0)) / scale
    return b, error, model.residual - np.tensordot(b, C, 1)


def evaluate(
    model: Linear,
    columns: Floats | None = None,
    *,
    level_noise: bool | None = None,
    walk_limit: float | None = None,
    thorough: bool = False,
) -> Evaluation:
    """Refit response, columns and noise on the fitting days, and evaluate all days.

    Parameters
    ----------
    model : Linear
    columns : ndarray of shape (k, days, n), optional
    level_noise : bool, optional
        Another noise than the model's.
    walk_limit : float, optional
        Upper limit of the level's random walk [m per sample].
    thorough : bool
        Whether the noise is fitted from all starts: with a slow flow as candidate the noise may be far from
        that without it.
    """
    record, fit = model.record, model.split.fit
    level = model.level_noise if level_noise is None else level_noise
    noise = model.noise
    weights = np.ones(record.days)  # the candidate itself may make a day noisy
    if columns is None:
        weights = day_weights(noise.whiten(model.used(model.residual)))
    for turn in range(REFITS):
        *_, left = least_squares(model, columns, noise, weights)
        seen = model.used(left)
        noise = fit_noise(
            seen[fit], record.sample_time, noise.surface_area, weights=weights[fit], level=level,
            gauge_floor=model.gauge_floor, starts=(noise,), walk_limit=walk_limit,
            alone=(turn == 0 or not thorough) and level == model.level_noise and walk_limit is None,
        )  # fmt: skip
        weights = day_weights(noise.whiten(seen))
    b, error, left = least_squares(model, columns, noise, weights)
    p = len(model.columns)
    shift = b[:p]
    moved = (model.deviation + shift) / model.prior_sd
    return Evaluation(
        b[p:], shift, error[:p], left, noise, noise.log_likelihood(model.used(left)),
        0.5 * float(moved @ moved), day_errors(record, left, noise), weights,
    )  # fmt: skip


def limited(gain: Floats) -> Floats:
    """Gains of days [nats] with outliers limited; shape (days,)."""
    usual = ODD * float(np.median(np.abs(gain))) + 5.0
    return np.asarray(np.clip(gain, -usual, usual))


WIDE = 10.0
"""Prior standard deviation of an effect's parameter, in units of its value: nearly flat."""
ENOUGH = 2.0
"""Steps end when the cost falls by less [nats]."""
TRIES = 5
"""Dampings tried in a step."""
MOST_STEPS = 8
"""Two to four are usual."""


@dataclass(frozen=True, eq=False)
class Model:
    """A response with effects."""

    reach: Response
    noise: NoiseModel | None  # none before the first fit
    level: float  # reference of level- and flow-dependent effects [m], [m3/s]
    flow: float
    gauge_floor: float  # lower limit of the gauge noise
    effects: tuple[Effect, ...] = ()
    free: tuple[tuple[str, ...], ...] = ()  # fitted parameters of each
    level_noise: bool = False  # whether the noise has a level part

    def changes(self, record: Record, more: tuple[Effect, ...] = ()) -> Changes:
        """What the effects change on a record."""
        return changes_of((*self.effects, *more), record.world(self.level, self.flow))

    def baseline(self, record: Record, more: tuple[Effect, ...] = ()) -> Floats:
        """Output about the observed course, with further effects; shape (days, n)."""
        return self.reach.baseline(record, self.changes(record, more))

    def values(self) -> Floats:
        """The effects' free parameters, one after the other."""
        return np.array([value for _, _, value in self.slots()])

    def slots(self) -> list[tuple[int, tuple[str, int | None], float]]:
        """The effects' free numbers: which effect, which parameter and place in it, and the value."""
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
        """A usual size of each free number."""
        sizes = []
        for i, (name, _), value in self.slots():
            usual = self.effects[i].defaults().get(name, 1.0)
            usual = float(np.max(np.abs(usual))) if np.size(usual) else 1.0
            sizes.append(max(abs(value), 0.2 * usual, 1e-9))
        return np.array(sizes)

    def with_values(self, values: Floats) -> "Model":
        """The same with other values of the free numbers, held within the effects' limits."""
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

    def linear(self, record: Record, split: Split) -> Linear:
        """The model about which candidates are tried; columns of the effects' parameters included."""
        assert self.noise is not None
        start, columns = self.jacobian(record)
        sd = np.concatenate([[f.sd for f in self.reach.parameters], WIDE * self.scales()])
        off = [f.value - f.mean for f in self.reach.parameters]
        deviation = np.concatenate([off, np.zeros(len(self.values()))])
        return Linear(
            record,
            split,
            residual_of(record, start),
            columns,
            sd,
            deviation,
            self.noise,
            self.gauge_floor,
            self.level_noise,
        )

    def jacobian(self, record: Record) -> tuple[Floats, Floats]:
        """The baseline (days, n), and the columns of all free parameters, shape (p + q, days, n)."""
        values, scales = self.values(), self.scales()
        steps, candidates = np.empty(len(values)), []
        for j in range(len(values)):
            other = values.copy()
            other[j] += 0.05 * scales[j]
            moved = self.with_values(other)
            step = moved.values()[j] - values[j]
            if abs(step) < 1e-3 * scales[j]:  # at its upper limit: a step down
                other[j] = values[j] - 0.05 * scales[j]
                moved = self.with_values(other)
                step = moved.values()[j] - values[j]
            steps[j] = step
            candidates.append(moved.changes(record))
        start, slopes, differences = sensitivities(self.reach, record, candidates, self.changes(record))
        return start, np.concatenate([slopes, differences / steps[:, None, None]])


def calibrate(
    model: Model,
    record: Record,
    *,
    steps: int = MOST_STEPS,
    trim: float = 0.0,
    report: Callable[[str], None] = lambda _: None,
) -> Model:
    """Fit all free parameters and the noise to the days of a record.

    `trim` is the share of the noisiest days left out: an effect on many days bends the response.
    """
    model = replace(model, reach=model.reach.settled(record))
    p = len(model.reach.parameters)
    sd = np.concatenate([[f.sd for f in model.reach.parameters], WIDE * model.scales()])
    middle = np.concatenate([[f.mean for f in model.reach.parameters], model.values()])

    def left(of: Model) -> Floats:
        return np.where(record.used, residual_of(record, of.baseline(record)), np.nan)

    def at(of: Model) -> Floats:
        return np.concatenate([vector_of(of.reach), of.values()])

    z = left(model)
    damping = 1e-2
    for step in range(steps):
        noise = fit_noise(
            z, record.sample_time, model.reach.surface_area, level=model.level_noise,
            gauge_floor=model.gauge_floor, starts=() if model.noise is None else (model.noise,),
            alone=model.noise is not None and step > 1,
        )  # fmt: skip
        model = replace(model, noise=noise)
        whitened = noise.whiten(z)
        weights = day_weights(whitened)
        if trim > 0.0:
            weights = np.where(weights < np.quantile(weights, trim), 0.0, weights)
            noise = fit_noise(
                z, record.sample_time, model.reach.surface_area, weights=weights, level=model.level_noise,
                gauge_floor=model.gauge_floor, starts=(noise,), alone=True,
            )  # fmt: skip
            model = replace(model, noise=noise)
            whitened = noise.whiten(z)
        root = np.sqrt(weights)[:, None]
        X = noise.whiten(model.jacobian(record)[1], like=z) * root
        X = X.reshape(len(sd), -1) * sd[:, None]  # in prior standard deviations
        here = at(model)
        off = (here - middle) / sd
        G, g = X @ X.T + np.eye(len(sd)), X @ (whitened * root).ravel() - off
        cost = 0.5 * float(((whitened * root) ** 2).sum() + off @ off)
        fell = 0.0
        for _ in range(TRIES):
            move = np.linalg.solve(G + damping * np.diag(np.diag(G)), g) * sd
            move[:p] = np.clip(move[:p], -2.0 * sd[:p], 2.0 * sd[:p])
            there = here + move
            try:
                other = replace(model, reach=model.reach.with_parameters(there[:p])).with_values(there[p:])
                z_other = left(other)
                w = noise.whiten(z_other) * root
            except RividError:  # an impossible flow: a shorter step
                damping *= 8.0
                continue
            off = (at(other) - middle) / sd
            now = 0.5 * float((w**2).sum() + off @ off)
            if now < cost:
                fell = cost - now
                model, z = other, z_other
                damping = max(damping / 6.0, 1e-4)
                break
            damping *= 8.0
        report(f"step {step + 1}: cost {cost:.0f}, less {fell:.1f}")
        if fell < ENOUGH:
            break
    return replace(
        model,
        noise=fit_noise(
            z, record.sample_time, model.reach.surface_area, level=model.level_noise,
            gauge_floor=model.gauge_floor, starts=() if model.noise is None else (model.noise,),
        ),
    )  # fmt: skip
