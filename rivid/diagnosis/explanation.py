"""An explanation of the logs: a response, effects and a noise, fitted together, and its score on held-out
days.

The fit takes Levenberg-Marquardt steps on the posterior of the parameters of response and effects; noise and
day weights are refitted between steps. The score of a day is the log density of its samples, predicted by
the fit without the day's block (:mod:`rivid.diagnosis.predictive`), less the price of its events.
"""

import datetime as dt
from collections.abc import Sequence
from dataclasses import dataclass, replace
from typing import Any, Literal, NamedTuple

import numpy as np
from numpy.typing import DTypeLike

from rivid.diagnosis.data import Record
from rivid.diagnosis.events import Events
from rivid.diagnosis.fit import ENOUGH, HOURS, NEAR, TRIES, WIDE, DayErrors, Model, day_errors, residual_of
from rivid.diagnosis.noise.model import NoiseModel, day_weights
from rivid.diagnosis.predictive import day_densities, held_out, information, step_within
from rivid.diagnosis.response.base import vector_of
from rivid.effects import LEVEL_NOISES, Effect
from rivid.errors import RividError
from rivid.reach.saint_venant.flow import side_by_side
from rivid.types import Bools, Floats, Ints

Unknown = Literal["", "flow", "gauge", "dynamics"]
HORIZONS = (NEAR, *HOURS)


@dataclass(frozen=True, eq=False)
class Explanation:
    """A fitted explanation; arrays have a row for each day of the record."""

    model: Model
    unknown: Unknown
    log_prior: float  # of its names and windows [nats]
    residual: Floats  # (days, n): measured less simulated and coded, NaN where nothing was measured
    # (p, days, n) and (q, days, n): change of the simulated output for one unit of each free parameter of the
    # response, which explanations share, and of the effects, in single precision; and prior standard
    # deviations of all, (p + q,).
    shared: Floats
    own: Floats
    sd: Floats
    weights: Floats  # (days,): of the fit; 0 on sealed days
    # Effects that the simulator does not hold: events, coded day by day, and noises; with the events.
    others: tuple[Effect, ...] = ()
    events: tuple[Events, ...] = ()
    bonus: Floats | None = None  # (days,): log density that a noise outside the filter gains [nats]
    inflation: float = 1.0  # variance of blocks' scores of what it adds, over that of the noise model
    parent: "Explanation | None" = None  # what it extends by its last effect, or by something unknown
    density: Floats | None = None  # (days,): log density of each day, predicted by the fit without its block
    errors: DayErrors | None = None  # of forecasts by that fit, at HORIZONS
    change: Floats | None = None  # (days, k): of the parameters, to the fit without the block of each day
    standard_errors: Floats | None = None  # (k,): of the parameters, the scatter of blocks included

    @property
    def noise(self) -> NoiseModel:
        """The fitted noise."""
        assert self.model.noise is not None
        return self.model.noise

    @property
    def columns(self) -> Floats:
        """Change of the simulated output for one unit of each free parameter, shape (p + q, days, n)."""
        return np.concatenate([self.shared, self.own])

    @property
    def predicted(self) -> Floats:
        """Residual of each day by the fit without its block, shape (days, n)."""
        assert self.change is not None
        left, p = self.residual, len(self.shared)
        for change, columns in ((self.change[:, :p], self.shared), (self.change[:, p:], self.own)):
            left = left - np.einsum("dk,kdn->dn", change, columns, optimize=True)
        return np.asarray(left)

    @property
    def whole(self) -> Model:
        """The model with the events in the simulator."""
        events = tuple(e for e in self.others if e.found_as not in LEVEL_NOISES)
        model = self.model
        return replace(model, effects=(*model.effects, *events), free=(*model.free, *((),) * len(events)))

    def errors_of(self, index: int) -> dict[tuple[str, int | None], float]:
        """Standard errors of the free numbers of an effect, by name and place in it."""
        assert self.standard_errors is not None
        own = self.standard_errors[len(self.model.reach.parameters) :].tolist()
        slots = self.model.slots()
        return {key: error for (i, key, _), error in zip(slots, own, strict=False) if i == index}

    @property
    def added(self) -> Effect | None:
        """The effect that it has more than its parent."""
        before = (0, 0) if self.parent is None else self.parent.count
        if self.count[0] > before[0]:
            return self.model.effects[-1]
        return self.others[-1] if self.count[1] > before[1] else None

    @property
    def count(self) -> tuple[int, int]:
        """Effects in the simulator and outside it."""
        inside, outside = (sum(bool(e.name) for e in some) for some in (self.model.effects, self.others))
        return inside, outside

    @property
    def effects(self) -> tuple[Effect, ...]:
        """Its effects."""
        return (*self.model.effects, *self.others)

    @property
    def names(self) -> tuple[str, ...]:
        """Names of its effects that have one."""
        return tuple(effect.name for effect in self.effects if effect.name)

    def active(self, record: Record, effect: Effect) -> Bools:
        """Days on which one of its effects acts, shape (days,)."""
        if effect.found_as in LEVEL_NOISES:
            return np.ones(record.days, bool)
        coded = [e for e in self.others if e.found_as not in LEVEL_NOISES]
        for other, found in zip(coded, self.events, strict=True):
            if other is effect:
                return np.asarray(found.coded.any(axis=1))
        if effect.dates is None:
            return np.ones(record.days, bool)
        last = effect.dates[1] + dt.timedelta(days=int(effect.set_right))  # the midnight shows what has grown
        return np.array([effect.dates[0] <= day <= last for day in record.dates])

    @property
    def coded(self) -> Floats:
        """Output of the events, shape (days, n)."""
        return sum((found.coded for found in self.events), np.zeros(self.residual.shape))

    @property
    def price(self) -> Floats:
        """Of the events that begin on each day, shape (days,) [nats]."""
        days = len(self.residual)
        price = np.zeros(days)
        for found in self.events:
            price += found.price * np.bincount([e.day for e in found.events], minlength=days)
        return price


STEPS = 60
"""Most steps of a fit; few take as many."""
FRESH = 12
"""How often the columns of a fit that others extend are computed anew. Where it ends before its optimum, an
effect that leads it on gains what is not its own: with one computation and 20 steps nothing missing was 1,700
nats below its optimum in an uneven channel, and a leak led the way to it. With two for the fits of names with
their own response, a true leak got a second, false name in another."""
RELIABLE = 0.25
"""Least part of its promise that a step keeps where the columns hold; below, a trust region shrinks (Nocedal
and Wright, 2006, Algorithm 4.1)."""


def fitted(
    model: Model,
    record: Record,
    open_days: Bools,
    *,
    unknown: Unknown = "",
    log_prior: float = 0.0,
    start: Explanation | None = None,
    parent: Explanation | None = None,
    inflation: float = 1.0,
    others: tuple[Effect, ...] = (),
    events: tuple[Events, ...] = (),
    steps: int = STEPS,
    fresh: int = 0,
    enough: float = ENOUGH,
    rough: bool = False,
) -> Explanation:
    """Fit a model, from where it is, and its noise to the open days (days,); raises where it carries none.

    Parameters
    ----------
    start : Explanation, optional
        A fit near by: its columns of the response's parameters and, for the first steps, its noise and
        weights are used. By default columns are computed, and the noise fitted, at the start.
    parent : Explanation, optional
        What this one extends.
    inflation : float
        Of what it adds; see :func:`rivid.diagnosis.search.inflation_of`.
    others, events : tuple
        Events and noises outside the simulator.
    steps : int
        Most steps.
    fresh : int
        How often the columns are computed anew at most: after the first step, and where steps with those at
        hand gain less than `enough` or :data:`RELIABLE` of what they promise.
    enough : float
        A fit ends where new columns gain less [nats].
    rough : bool
        Whether the noise at the end is the one near that of the last step.
    """
    p, few = len(model.reach.parameters), record.take(open_days)
    sd = np.concatenate([[f.sd for f in model.reach.parameters], WIDE * model.scales()])
    middle = np.concatenate([[f.mean for f in model.reach.parameters], model.values()])
    coded = sum((found.coded for found in events), np.zeros(record.time.shape))
    base = model.baseline(few)
    z = residual_of(few, base) - coded[open_days]
    shared = None if start is None else start.shared
    J = model.jacobian(few, base, None if shared is None else shared[:, open_days])
    same = start is not None and start.model.noise_kind == model.noise_kind
    damping, weights, stale = LEAST_DAMPING, None, start is not None
    for step in range(steps):
        seen = np.where(few.used, z, np.nan)
        if same and start is not None and step < FIXED:
            noise, weights = start.noise, start.weights[open_days]
        else:
            noise, weights = _noise(model, few, seen, weights, alone=model.noise is not None)
        model = replace(model, noise=noise)
        root, off = np.sqrt(weights)[:, None], (_values(model) - middle) / sd
        squares, g, G = (np.tensordot(weights, part, 1) for part in _information(noise, seen, J, few))
        g, G = g * sd - off, G * (sd[:, None] * sd) + np.eye(len(sd))
        cost, fell, promised = 0.5 * float(squares + off @ off), 0.0, 0.0
        low, high = _room(model, sd)
        for turn in range(TRIES if stale else FRESH_TRIES):
            move = step_within(G + damping * np.diag(np.diag(G)), g, low, high)
            promised = float(g @ move - 0.5 * move @ G @ move)  # the gain, where the columns hold
            if promised < (LEAST_STEP if turn < TRIES else ENOUGH):
                break
            try:
                other = _moved(model, move * sd)
                base_other = other.baseline(few)
                z_other = residual_of(few, base_other) - coded[open_days]
                w = noise.whiten(np.where(few.used, z_other, np.nan), activity=few.activity)
            except RividError:  # an impossible flow: a shorter step
                damping = max(8.0 * damping, 1e-2)
                continue
            off = (_values(other) - middle) / sd
            fell = cost - 0.5 * float(((w * root) ** 2).sum() + off @ off)
            if fell > 0.0:
                moved = _values(other) - _values(model)
                J = _secant(J, moved / sd, sd, base_other - base)
                model, z, base = other, z_other, base_other
                damping = max(damping / 8.0, LEAST_DAMPING)
                break
            damping = max(8.0 * damping, 1e-2)
        damping = min(damping, 1.0)
        least = max(enough, RELIABLE * promised if fresh > 0 else 0.0)
        if same and step < FIXED or fell >= least and (step > 0 or fresh == 0):
            stale = True
            continue
        if fresh == 0 or not stale and fell < enough:
            break
        del J
        J, shared, stale, fresh = model.jacobian(few, base), None, False, fresh - 1
        damping = LEAST_DAMPING
    noise, weights = _noise(model, few, np.where(few.used, z, np.nan), weights, alone=rough)
    model, sealed = replace(model, noise=replace(noise, recall=model.recall(few))), ~open_days
    if sealed.any():
        rest = record.take(sealed)
        base = model.baseline(rest)
        left = residual_of(rest, base) - coded[sealed]
        other_J = model.jacobian(rest, base, None if shared is None else shared[:, sealed])
    else:
        left, other_J = z[:0], J[:, :0]
    whole = np.zeros(record.days)
    whole[open_days] = weights
    if shared is None:
        shared = _joined(open_days, J[:p], other_J[:p], np.float32)
    return Explanation(
        model, unknown, log_prior, _joined(open_days, z, left), shared,
        _joined(open_days, J[p:], other_J[p:], np.float32), sd, whole, others, events, parent=parent,
        inflation=inflation,
    )  # fmt: skip


def _joined(open_days: Bools, opened: Floats, sealed: Floats, dtype: DTypeLike = float) -> Any:
    """Arrays (..., days, n) of the open days and of the sealed ones, as one of all days."""
    whole = np.empty((*opened.shape[:-2], len(open_days), opened.shape[-1]), dtype)
    whole[..., open_days, :], whole[..., ~open_days, :] = opened, sealed
    return whole


def _information(
    noise: NoiseModel, seen: Floats, columns: Floats, record: Record
) -> tuple[Floats, Floats, Floats]:
    """Information of each day, whitened some days at a time: unknown dynamics have a hundred columns."""
    parts = []
    for days in np.array_split(np.arange(len(seen)), len(seen) // 16 + 1):
        z, activity = seen[days], None if record.activity is None else record.activity[days]
        X = noise.whiten(columns[:, days], like=z, activity=activity)
        parts.append(information(noise.whiten(z, activity=activity), X))
    squares, g, G = (np.concatenate(part) for part in zip(*parts, strict=True))
    return squares, g, G


LEAST_STEP = 0.05
"""Least gain of a step [nats]: without it the values are a third of a standard error away."""
FRESH_TRIES = 12
"""Most tries of a step by fresh columns, the last with a damping of ten million: after :data:`TRIES` a fit
ended where it began, 12,000 nats below its optimum, in a pool of which the waves return in step."""
LEAST_DAMPING = 1e-4
"""Least damping of a step, in diagonals of the information; the first is tried with it: at ten times as much
depth and banks, which data hardly separate, took 16 steps to where they now are after 3."""
FIXED = 2
"""Steps with the noise of the start: far from the fit a new noise would take what the steps should."""


def _values(model: Model) -> Floats:
    """Values of all free parameters, of the response on their scale."""
    return np.concatenate([vector_of(model.reach), model.values()])


def _moved(model: Model, move: Floats) -> Model:
    """The model at other values of its free parameters, within their limits."""
    p, there = len(model.reach.parameters), _values(model) + move
    return replace(model, reach=model.reach.with_parameters(there[:p])).with_values(there[p:])


def _room(model: Model, sd: Floats) -> tuple[Floats, Floats]:
    """Least and greatest step of each parameter, in prior standard deviations.

    All stay within their limits, those of the response within :data:`LONGEST` too; an hour has no limit.
    """
    free, at = model.reach.parameters, _values(model)
    low, high = np.full(len(sd), -np.inf), np.full(len(sd), np.inf)
    for i, one in enumerate(free):
        low[i] = max((one.low - at[i]) / sd[i], -LONGEST)
        high[i] = min((one.high - at[i]) / sd[i], LONGEST)
    for i, (effect, (name, _), value) in enumerate(model.slots(), len(free)):
        limits = model.effects[effect].parameters()[name]
        if name != "hour":
            low[i], high[i] = (limits.low - value) / sd[i], (limits.high - value) / sd[i]
    return low, high


LONGEST = 2.0
"""Longest step of a parameter of the response, in prior standard deviations: its columns hold near by."""


def _secant(J: Floats, x: Floats, sd: Floats, change: Floats) -> Floats:
    """Columns J (k, days, n) that agree with the change of the output by a step of x standard deviations.

    The least change of them that does: Broyden (1965).
    """
    missed = change - np.tensordot(x * sd, J, 1)
    return J + np.multiply.outer(x / (sd * max(float(x @ x), 1e-12)), missed)


def _noise(
    model: Model, record: Record, seen: Floats, weights: Floats | None, alone: bool
) -> tuple[NoiseModel, Floats]:
    """Noise of a record's days, and their weights with it."""
    noise = model.fit_noise(seen, record, weights, alone)
    more = day_weights(noise.whiten(seen, activity=record.activity))
    return noise, more if weights is None else np.sqrt(weights * more)  # in full they would go to and fro


TURNS, LASTS = 12, 30.0
"""Turns of :func:`settled`, and samples that a misfit of the response lasts. In a pool that waves cross in
1.5 samples fits from the nominal channel and six draws ended 340 nats or more below the truth; with 10
samples one chain in two reached it, with 30 or 100 nearly all. Of ten such pools two remain more than 100
nats below it after twelve turns; after eight the worst was 1,104 below, then 673."""


def settled(model: Model, record: Record, number: int) -> Model:
    """A model at the response to which its priors settle on all days of a record, to begin a fit there.

    Waves to and fro make a posterior of many narrow maxima, in which steps along local columns end. Here the
    columns are those of a linear regression of the output on the parameters, over draws from a normal
    distribution: at first the prior, then the posterior by the regression, until it stays. What the
    regression leaves, by its curvature and at its best, is the variance of the output; it lasts
    :data:`LASTS` samples. So the distribution narrows as far only as the output is linear across it.

    Parameters
    ----------
    model : Model
        Only its response is changed; effects stay at their values.
    record : Record
    number : int
        Starts the draws.

    Returns
    -------
    Model
        `model` itself where too few draws carry the flows for a regression.

    Notes
    -----
    Source: the posterior linearisation filter, by statistical linear regression (Garcia-Fernandez, Svensson,
    Morelande and Sarkka 2015), here with draws, each with its mirror image.
    """
    free = model.reach.parameters
    mean, sd, low, high = (np.array([getattr(p, key) for p in free]) for key in ("mean", "sd", "low", "high"))
    rng, k, noise = np.random.default_rng(number), len(free), model.noise
    at, spread = np.zeros(k), np.eye(k)  # in prior standard deviations

    def left(x: Floats) -> Floats | None:
        try:
            one = replace(model, reach=model.reach.with_parameters(mean + sd * x))
            return np.where(record.used, residual_of(record, one.baseline(record)), np.nan)
        except RividError:
            return None

    for _ in range(TURNS):
        draws = rng.standard_normal((k + 2, k)) @ np.linalg.cholesky(spread).T
        x = np.clip(at + np.concatenate([draws, -draws]), (low - mean) / sd, (high - mean) / sd)
        runs = [left(one) for one in x]
        kept = [i for i, run in enumerate(runs) if run is not None]
        if len(kept) < k + 2:
            return model
        x, z = x[kept], np.stack([run for run in runs if run is not None])
        middle = left(at)
        seen = z.mean(axis=0) if middle is None else middle
        noise = replace(model, noise=noise).fit_noise(seen, record, None)
        white = noise.whiten(z, like=seen, activity=record.activity)[:, record.used]
        here, off = white.mean(axis=0), x - x.mean(axis=0)
        slopes = np.linalg.lstsq(off, white - here, rcond=None)[0]
        G, g = slopes @ slopes.T, slopes @ here
        bent = ((white - here - off @ slopes) ** 2).sum() / (len(x) - k)
        best = here - np.linalg.lstsq(G, g, rcond=None)[0] @ slopes
        size = max(LASTS * float(bent + best @ best) / len(here), 1.0)
        spread = np.linalg.inv(G / size + np.eye(k))
        at = np.clip(spread @ (G @ x.mean(axis=0) - g) / size, (low - mean) / sd, (high - mean) / sd)
    return replace(model, reach=model.reach.with_parameters(mean + sd * at))


BRIEF = 3
"""Steps of a fit after which many are compared."""
FINALISTS = 3
"""Fits that are not compared before they end, and values of an effect from which it is scanned."""


class Fit(NamedTuple):
    """A fit to some days, its likelihood [nats a day] and the place of its model among those tried."""

    likely: float
    number: int
    one: Explanation


def best_fits(models: Sequence[Model], record: Record, *, fresh: int) -> list[Fit]:
    """Fits of models to all days of a record, the best one first.

    Of many the likeliest third after a few steps is fitted on, and of these again (successive halving:
    Jamieson and Talwalkar 2016). Raises where none of them carries the flows.
    """
    if len(models) <= FINALISTS:
        return fits(models, record, fresh=fresh)
    begun = fits(models, record, steps=BRIEF)
    while (kept := max(len(begun) // 3, FINALISTS)) > FINALISTS:
        begun = _fitted_on(begun[:kept], record, fresh=1, steps=2 * BRIEF)
    return _fitted_on(begun[:kept], record, fresh=fresh)


def _fitted_on(begun: Sequence[Fit], record: Record, *, fresh: int, steps: int = STEPS) -> list[Fit]:
    models, starts = [fit.one.model for fit in begun], [fit.one for fit in begun]
    found = fits(models, record, starts, fresh=fresh, steps=steps)
    return [fit._replace(number=begun[fit.number].number) for fit in found]


def fits(
    models: Sequence[Model],
    record: Record,
    starts: Sequence[Explanation | None] | None = None,
    *,
    fresh: int = 0,
    steps: int = STEPS,
) -> list[Fit]:
    """Fits of models that carry the flows to all days of a record, each from a fit near by, the best first.

    Raises where none of them carries the flows.
    """
    every = np.ones(record.days, bool)
    near: list[NoiseModel | None] = [None]  # the noise of the first fit starts those of the others

    def fit(number: int) -> Fit | RividError:
        start, model = None if starts is None else starts[number], models[number]
        model = replace(model, noise=model.noise or near[0])
        try:
            one = fitted(model, record, every, start=start, fresh=fresh, steps=steps, rough=True)
        except RividError as error:
            return error
        seen = np.where(record.used, one.residual, np.nan)
        return Fit(float(one.noise.log_likelihood(seen, record.activity).mean()), number, one)

    first = fit(0)
    near[0] = None if isinstance(first, RividError) else first.one.noise
    made = [first, *side_by_side(fit, range(1, len(models)))]
    found = [one for one in made if isinstance(one, Fit)]
    if not found:
        raise next(one for one in made if isinstance(one, RividError))
    return sorted(found, key=lambda one: -one.likely)


def scored(one: Explanation, record: Record, blocks: Ints, tails: float) -> Explanation:
    """The explanation with its score: density and errors of each day, predicted without its block.

    `blocks` (days,) are those of the days, `tails` the degrees of freedom of the days' common size.
    """
    noise = one.noise
    seen = np.where(record.used, one.residual, np.nan)
    r = noise.whiten(seen, activity=record.activity)
    found = _information(noise, seen, one.columns, record)
    low, high = _room(one.model, one.sd)
    p, far = len(one.shared), 1.0 / WIDE  # columns of an effect hold no farther than its own size
    low[p:], high[p:] = np.maximum(low[p:], -far), np.minimum(high[p:], far)
    off = np.zeros(len(one.sd))
    off[:p] = vector_of(one.model.reach) - [f.mean for f in one.model.reach.parameters]
    within = one.sd * low, one.sd * high
    squares, log_det, change, errors = held_out(*found, one.sd**-2.0, blocks, one.weights, off, within)
    plain = noise.log_likelihood(seen, record.activity) + 0.5 * (r * r).sum(axis=1)
    density = day_densities(squares, log_det, plain, (r != 0.0).sum(axis=1), tails)
    density = density - one.price + (0.0 if one.bonus is None else one.bonus)
    one = replace(one, density=density, change=change, standard_errors=errors)
    if one.parent is not None and one.bonus is not None and one.parent.bonus is None:
        return replace(one, errors=one.parent.errors)  # no filter here forecasts a swing
    return replace(one, errors=day_errors(record, one.predicted, noise, HORIZONS))


TAILS = (3.0, 6.0, 12.0, 25.0, 50.0, 100.0, 1000.0)
"""Degrees of freedom that are tried."""


def tails_of(one: Explanation, record: Record) -> float:
    """The degrees of freedom of greatest likelihood of the open days' common sizes."""
    seen = np.where(record.used, one.residual, np.nan)
    r = one.noise.whiten(seen, activity=record.activity)
    chosen = (one.weights > 0.0) & (r != 0.0).any(axis=1)
    squares, counts = (r * r).sum(axis=1)[chosen], (r != 0.0).sum(axis=1)[chosen]
    nothing = np.zeros(len(squares))
    return max(TAILS, key=lambda t: float(day_densities(squares, nothing, nothing, counts, t).sum()))
