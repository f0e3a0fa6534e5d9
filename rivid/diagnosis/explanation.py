"""Explanation of the logs: response, effects and noise, fitted together, with a score on held-out days.

The fit takes Levenberg-Marquardt steps on the posterior of the parameters of response and effects; noise and
day weights are refitted between steps. The score of a day is the log density of its samples, predicted by the
fit without the day's block (:mod:`rivid.diagnosis.predictive`), minus the price of its events and what events
of the impossible sign would gain.
"""

import datetime as dt
from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace
from functools import partial
from typing import Any, Literal, NamedTuple

import numpy as np
from numpy.typing import DTypeLike

from rivid.diagnosis.data import Record
from rivid.diagnosis.events import Events, find_events
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
UNSET: Any = None  # value of what fitted and scored compute, before they do


class Way(NamedTuple):
    """An extension of an explanation by an effect."""

    name: str
    grow: Callable[..., "Explanation | None"]
    columns: Floats | None = None  # of the effect's trial, (k, days, n)


@dataclass(frozen=True, eq=False)
class Explanation:
    """A fitted explanation, or the draft of one; arrays have a row for each day of the record."""

    model: Model
    unknown: Unknown = ""
    log_prior: float = 0.0  # of its names and windows [nats]
    # (days, n): measured minus simulated minus `coded`, NaN where nothing was measured
    residual: Floats = UNSET
    # Design matrix columns in single precision: change of the simulated output per unit of each free
    # parameter of the response (p, days, n), shared by explanations, and of the effects (q, days, n).
    shared: Floats = UNSET
    own: Floats = UNSET
    sd: Floats = UNSET  # (p + q,): prior standard deviations of these parameters
    weights: Floats = UNSET  # (days,): of the days in the fit; 0 on sealed days
    # Effects outside the simulator (events, coded day by day, and level noises), and the events.
    others: tuple[Effect, ...] = ()
    events: tuple[Events, ...] = ()
    bonus: Floats | None = None  # (days,): gain of log density by a noise outside the filter [nats]
    inflation: float = 1.0  # variance of block scores of the added effect over that of the noise model
    parent: "Explanation | None" = None  # explanation that this one extends by an effect or unknown cause
    way: Way | None = None  # that made it from its parent, and can extend the parent's rivals
    defect: Floats = UNSET  # (days, n): what the output adds to that of the cheaper response
    density: Floats = UNSET  # (days,): log density of each day by the fit without its block
    errors: DayErrors = UNSET  # of forecasts by the same fits, at HORIZONS
    change: Floats = UNSET  # (days, k): change of the parameters without the block of each day
    standard_errors: Floats = UNSET  # (k,): of the parameters, scatter between blocks included

    def extended(self, log_prior: float, **changes: Any) -> "Explanation":
        """Return the draft of an explanation that extends this one, for :func:`fitted`."""
        return replace(self, parent=self, log_prior=log_prior, inflation=1.0, way=None, **changes)

    @property
    def noise(self) -> NoiseModel:
        """Fitted noise model."""
        assert self.model.noise is not None
        return self.model.noise

    @property
    def columns(self) -> Floats:
        """Change of the simulated output per unit of each free parameter, shape (p + q, days, n)."""
        return np.concatenate([self.shared, self.own])

    @property
    def predicted(self) -> Floats:
        """Residual of each day under the fit without its block, shape (days, n)."""
        left, p = self.residual, len(self.shared)
        for change, columns in ((self.change[:, :p], self.shared), (self.change[:, p:], self.own)):
            left = left - np.einsum("dk,kdn->dn", change, columns, optimize=True)
        return np.asarray(left)

    def whitened(self, record: Record) -> tuple[Callable[[Floats], Floats], Floats]:
        """Return a function that whitens values (k, days, n) on the fitted days, and the whitened columns.

        Days are multiplied by the square roots of their weights, columns by the prior standard deviations.
        """
        opened = self.weights > 0.0
        few, root = record.take(opened), np.sqrt(self.weights[opened])[:, None]
        seen = np.where(few.used, self.residual[opened], np.nan)

        def white(values: Floats) -> Floats:
            return self.noise.whiten(values[:, opened], like=seen, activity=few.activity) * root

        return white, white(self.columns) * self.sd[:, None, None]

    @property
    def whole(self) -> Model:
        """Model with the events as effects in the simulator."""
        events = tuple(e for e in self.others if e.found_as not in LEVEL_NOISES)
        model = self.model
        return replace(model, effects=(*model.effects, *events), free=(*model.free, *((),) * len(events)))

    def errors_of(self, index: int) -> dict[tuple[str, int | None], float]:
        """Return standard errors of an effect's free values, by parameter and index in a tuple."""
        own = self.standard_errors[len(self.model.reach.parameters) :].tolist()
        slots = self.model.slots()
        return {key: error for (i, key, _), error in zip(slots, own, strict=False) if i == index}

    @property
    def added(self) -> Effect | None:
        """Effect that the explanation adds to its parent, or None."""
        before = (0, 0) if self.parent is None else self.parent.count
        if self.count[0] > before[0]:
            return self.model.effects[-1]
        return self.others[-1] if self.count[1] > before[1] else None

    @property
    def count(self) -> tuple[int, int]:
        """Number of named effects in the simulator and outside it."""
        inside, outside = (sum(bool(e.name) for e in some) for some in (self.model.effects, self.others))
        return inside, outside

    @property
    def effects(self) -> tuple[Effect, ...]:
        """All effects, in the simulator and outside it."""
        return (*self.model.effects, *self.others)

    @property
    def names(self) -> tuple[str, ...]:
        """Names of the effects that have one."""
        return tuple(effect.name for effect in self.effects if effect.name)

    def active(self, record: Record, effect: Effect) -> Bools:
        """Return the days on which an effect of the explanation acts, shape (days,)."""
        if effect.found_as in LEVEL_NOISES:
            return np.ones(record.days, bool)
        coded = [e for e in self.others if e.found_as not in LEVEL_NOISES]
        for other, found in zip(coded, self.events, strict=True):
            if other is effect:
                return np.asarray(found.coded.any(axis=1))
        if effect.dates is None:
            return np.ones(record.days, bool)
        last = effect.dates[1] + dt.timedelta(days=int(effect.set_right))  # reset at the next midnight
        return np.array([effect.dates[0] <= day <= last for day in record.dates])

    @property
    def coded(self) -> Floats:
        """Sum of the output of all events, shape (days, n)."""
        return sum((found.coded for found in self.events), np.zeros(self.residual.shape))

    @property
    def price(self) -> Floats:
        """Price of the events that begin on each day, shape (days,) [nats]."""
        days = len(self.residual)
        price = np.zeros(days)
        for found in self.events:
            price += found.price * np.bincount([e.day for e in found.events], minlength=days)
        return price


STEPS = 60  # maximum number of steps of a fit; few fits need as many
FRESH = 12
"""Most recomputations of the columns of a fit that others extend. If it stops before its optimum, an effect
that moves it on is credited with the rest of the gain. With one computation and 20 steps the fit without
effects stopped 1,700 nats below its optimum in an uneven channel, and a leak gained these. With two, for fits
of names with their own response, a true leak in another channel got a second, false name."""
UNREAL = 0.5
"""Largest difference of the gains by the cheaper and by the costly response, over that by the cheaper one.
Beyond it, and beyond what :data:`FRESH` computations of columns may leave, the cheaper one becomes finer:
without, three of nine fits ended 800 to 2,300 nats lower."""
BACK = (0.0, 0.5, 0.75, 1.0)
"""Shares of the way back to the last fit that the costly response carried. A pool of 46 days had a fit in
which two days nearly ran dry: without, no further effect and no unknown cause could be fitted beside it."""
RELIABLE = 0.25
"""Smallest ratio of actual to predicted gain of a step at which the columns are still valid; a trust region
shrinks below it (Nocedal and Wright, 2006, Algorithm 4.1)."""


def fitted(
    model: Model,
    record: Record,
    open_days: Bools,
    *,
    draft: Explanation | None = None,  # gives what is not fitted: unknown cause, prior, events, parent
    start: Explanation | None = None,
    steps: int = STEPS,  # maximum number of steps
    fresh: int = 0,  # maximum number of recomputations of the columns
    enough: float = ENOUGH,  # the fit ends when a step with new columns gains less [nats]
    quick: bool = False,  # whether the final noise is fitted from that of the last step alone
) -> Explanation:
    """Fit a model and its noise to the open days (days,), starting at the model's values.

    `start` may be a fit of a similar model: its columns of the response's parameters and, for the first
    steps, its noise and weights are used. Otherwise columns are computed, and the noise fitted, at the start.
    Columns are recomputed after the first step, and when a step gains less than `enough` or
    :data:`RELIABLE` of its predicted gain. In a step the output changes as that of the cheaper response
    (:attr:`Response.rough`) does; what the costly one adds is computed with new columns and before the end.
    Where the gains of both differ, steps that make the costly one worse are taken back, and for new columns
    the cheaper one becomes finer (:attr:`Response.finer`).
    Raises RividError if the reach cannot carry the flows.
    """
    p, few = len(model.reach.parameters), record.take(open_days)
    sd = np.concatenate([[f.sd for f in model.reach.parameters], WIDE * model.scales()])
    middle = np.concatenate([[f.mean for f in model.reach.parameters], model.values()])
    draft = draft or Explanation(model)
    coded = sum((found.coded for found in draft.events), np.zeros(record.time.shape))
    fixed = coded[open_days]
    if start is None:
        base, defect = model.fine(few)
    else:
        defect = start.defect[open_days]
        base = model.rough.baseline(few) + defect
    exact = start is None or model.rough is model  # whether the defect is that of the present values
    known = model, base, defect, exact  # the last ones for which it was, or those of the start
    shared = None if start is None else start.shared
    columns = J = model.jacobian(few, base - defect, None if shared is None else shared[:, open_days])
    same = start is not None and start.model.noise_kind == model.noise_kind
    damping, weights, stale, corrected = LEAST_DAMPING, None, start is not None, False

    def left_by(base: Floats) -> Floats:
        return np.where(few.used, residual_of(few, base) - fixed, np.nan)

    def cost_of(model: Model, base: Floats) -> float:
        w = noise.whiten(left_by(base), activity=few.activity) * root
        off = (_values(model) - middle) / sd
        return 0.5 * float((w * w).sum() + off @ off)

    def carried() -> tuple[Model, Floats, Floats]:
        """Return the model, its baseline and defect, or those nearest to it that the costly response carries.

        Steps are taken with the cheaper response, which has fewer places to run dry.
        """
        back = _values(known[0]) - _values(model)
        for share in BACK:
            other = _moved(model, share * back) if share else model
            try:
                return other, *other.fine(few, None if share else base - defect)
            except RividError as error:
                refused = error
        raise refused

    for step in range(steps):
        seen = left_by(base)
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
            promised = float(g @ move - 0.5 * move @ G @ move)  # predicted gain
            # after the costly response was computed a step has to be worth another computation
            if promised < (enough if corrected else LEAST_STEP if turn < TRIES else ENOUGH):
                break
            try:
                other = _moved(model, move * sd)
                base_other = other.rough.baseline(few) + defect
                fell = cost - cost_of(other, base_other)
            except RividError:  # the flow is impossible: a shorter step
                damping = max(8.0 * damping, 1e-2)
                continue
            if fell > 0.0:
                moved = _values(other) - _values(model)
                J = _secant(J, moved / sd, sd, base_other - base)
                model, base, exact = other, base_other, other.rough is other
                damping = max(damping / 8.0, LEAST_DAMPING)
                break
            damping = max(8.0 * damping, 1e-2)
        damping = min(damping, 1.0)
        least = max(enough, RELIABLE * promised if fresh > 0 else 0.0)
        if same and step < FIXED or fell >= least and (step > 0 or fresh == 0):
            stale, corrected = True, False
            continue
        ended = fresh == 0 or not stale and fell < enough
        if ended and (exact or corrected):
            break
        if not exact:
            before_it, exact = defect, True
            model, base, defect = carried()
            hoped = cost_of(model, base - defect + before_it)
            # the steps must gain what the costly response gains
            before, real = cost_of(*known[:2]), cost_of(model, base)
            if abs(real - hoped) > max(UNREAL * (before - hoped), FRESH * ENOUGH):
                if real > before:
                    model, base, defect, exact = known
                finer = model.reach.finer if fresh > 0 else model.reach
                if finer is not model.reach:
                    model, ended = replace(model, reach=finer), False
                    base, exact = base if exact else model.baseline(few), True
                    defect = base - model.rough.baseline(few)
                elif real > before:
                    break
            known = model, base, defect, exact
        if ended:
            corrected = True
            continue
        del J, columns
        columns = J = model.jacobian(few, base - defect)
        shared, stale, fresh = None, False, fresh - 1
        damping = LEAST_DAMPING
    if not exact:
        model, base, defect = carried()
    # Not as updated along the steps: after a short step such an update is mostly numerical error.
    del J
    if shared is not None:
        columns = model.jacobian(few, base - defect, shared[:, open_days])
    z = residual_of(few, base) - fixed
    noise, weights = _noise(model, few, left_by(base), weights, alone=quick)
    model, sealed = replace(model, noise=replace(noise, recall=model.recall(few))), ~open_days
    if sealed.any():
        rest = record.take(sealed)
        base, more = model.fine(rest)
        left = residual_of(rest, base) - coded[sealed]
        other_J = model.jacobian(rest, base - more, None if shared is None else shared[:, sealed])
    else:
        left, other_J, more = z[:0], columns[:, :0], defect[:0]
    whole = np.zeros(record.days)
    whole[open_days] = weights
    if shared is None:
        shared = _joined(open_days, columns[:p], other_J[:p], np.float32)
    return replace(
        draft, model=model, residual=_joined(open_days, z, left), shared=shared,
        own=_joined(open_days, columns[p:], other_J[p:], np.float32), sd=sd, weights=whole, bonus=None,
        defect=_joined(open_days, defect, more, np.float32),
    )  # fmt: skip


def _joined(open_days: Bools, opened: Floats, sealed: Floats, dtype: DTypeLike = float) -> Any:
    """Join arrays (..., days, n) of the open days and of the sealed ones in one of all days."""
    whole = np.empty((*opened.shape[:-2], len(open_days), opened.shape[-1]), dtype)
    whole[..., open_days, :], whole[..., ~open_days, :] = opened, sealed
    return whole


def _information(
    noise: NoiseModel, seen: Floats, columns: Floats, record: Record
) -> tuple[Floats, Floats, Floats]:
    """Compute each day's information; days are whitened in groups, as unknown dynamics have 100 columns."""
    parts = []
    for days in np.array_split(np.arange(len(seen)), len(seen) // 16 + 1):
        z, activity = seen[days], None if record.activity is None else record.activity[days]
        X = noise.whiten(columns[:, days], like=z, activity=activity)
        parts.append(information(noise.whiten(z, activity=activity), X))
    squares, g, G = (np.concatenate(part) for part in zip(*parts, strict=True))
    return squares, g, G


LEAST_STEP = 0.05  # smallest predicted gain of a step [nats]: a third of a standard error from the optimum
FRESH_TRIES = 12
"""Maximum number of dampings tried in a step with new columns; the last is ten million. With :data:`TRIES` a
fit stopped at its start, 12,000 nats below its optimum, in a pool where reflected waves return in phase."""
LEAST_DAMPING = 1e-4
"""Smallest damping of a step, relative to the diagonal of the information; the first step uses it. With ten
times as much, depth and banks, which data hardly separate, took 16 steps instead of 3."""
FIXED = 2
"""Steps with the noise of `start`: far from the fit a refitted noise would absorb what the steps should."""


def _values(model: Model) -> Floats:
    """Return the values of all free parameters; those of the response are on their scale."""
    return np.concatenate([vector_of(model.reach), model.values()])


def _moved(model: Model, move: Floats) -> Model:
    """Return the model with its free parameters moved by `move`, within their limits."""
    p, there = len(model.reach.parameters), _values(model) + move
    return replace(model, reach=model.reach.with_parameters(there[:p])).with_values(there[p:])


def _room(model: Model, sd: Floats) -> tuple[Floats, Floats]:
    """Return the smallest and largest step of each parameter, in prior standard deviations."""
    # Steps respect the limits of all parameters but hours, and LONGEST for those of the response.
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
"""Longest step of a response parameter, in prior standard deviations: its columns are valid locally."""


def _secant(J: Floats, x: Floats, sd: Floats, change: Floats) -> Floats:
    """Update columns J (k, days, n) to the output change of a step of x prior standard deviations."""
    # It is the smallest such update: Broyden (1965).
    missed = change - np.tensordot(x * sd, J, 1)
    return J + np.multiply.outer(x / (sd * max(float(x @ x), 1e-12)), missed)


def _noise(
    model: Model, record: Record, seen: Floats, weights: Floats | None, alone: bool
) -> tuple[NoiseModel, Floats]:
    """Fit the noise of a record's days, and weigh the days by it."""
    noise = model.fit_noise(seen, record, weights, alone)
    more = day_weights(noise.whiten(seen, activity=record.activity))
    return noise, more if weights is None else np.sqrt(weights * more)  # undamped they would oscillate


TURNS, LASTS = 12, 30.0
"""Iterations of :func:`settled`, and samples for which a response error lasts. In a pool that waves cross in
1.5 samples, fits from the nominal channel and six draws ended 340 nats or more below the true parameters.
With 10 samples half of the chains reached these, with 30 or 100 nearly all. Of ten such pools two remain more
than 100 nats below after twelve iterations; the worst was 1,104 below after eight, 673 after twelve."""


def settled(model: Model, record: Record, number: int) -> Model:
    """Return a model with a response to start a fit from, by iterated linear regression on a record.

    Reflected waves give the posterior many narrow maxima, where steps along local columns end. Here columns
    are those of a linear regression of the output on the parameters, over draws from a normal distribution:
    first the prior, then the posterior of the last regression, for :data:`TURNS` iterations. The residuals of
    the regression, due to curvature and at its best fit, give the variance of the output, with a correlation
    time of :data:`LASTS` samples. So the distribution narrows only as far as the output is linear across it.

    Only the response of `model` is changed, and nothing if too few draws can carry the flows for a
    regression; `number` is the seed of the draws. Source: the posterior linearisation filter, by statistical
    linear regression (Garcia-Fernandez, Svensson, Morelande and Sarkka 2015), here with draws, each with its
    mirror image.
    """
    free = model.reach.parameters
    mean, sd, low, high = (np.array([getattr(p, key) for p in free]) for key in ("mean", "sd", "low", "high"))
    rng, k, noise = np.random.default_rng(number), len(free), model.noise
    at, root = np.zeros(k), np.eye(k)  # in prior standard deviations

    def left(x: Floats) -> Floats | None:
        try:
            one = replace(model, reach=model.reach.with_parameters(mean + sd * x))
            return np.where(record.used, residual_of(record, one.baseline(record)), np.nan)
        except RividError:
            return None

    for _ in range(TURNS):
        draws = rng.standard_normal((k + 2, k)) @ root.T
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
        # Columns that differ by rounding have no normal equations in floating point.
        U, sizes, V = np.linalg.svd(slopes.T, full_matrices=False)
        U *= sizes > 1e-15 * sizes[0]
        bent = ((white - here - off @ slopes) ** 2).sum() / (len(x) - k)
        best = here - U @ (U.T @ here)
        size = max(LASTS * float(bent + best @ best) / len(here), 1.0)
        steep = sizes / np.sqrt(size)
        width = 1.0 / np.sqrt(1.0 + steep**2)
        root = V.T * width
        at = x.mean(axis=0) - root @ (width * (V @ x.mean(axis=0) + steep * (U.T @ here) / np.sqrt(size)))
        at = np.clip(at, (low - mean) / sd, (high - mean) / sd)
        root = np.linalg.qr(root.T)[1].T
        root *= np.sign(np.diag(root))
    return replace(model, reach=model.reach.with_parameters(mean + sd * at))


def fits(models: Sequence[Model], record: Record, *, fresh: int) -> list[Explanation]:
    """Fit each model that can carry the flows to all days, and one has to; return the likeliest fit first."""
    every = np.ones(record.days, bool)

    def fit(model: Model, noise: NoiseModel | None = None) -> Explanation | RividError:
        try:
            model = replace(model, noise=model.noise or noise)
            return fitted(model, record, every, fresh=fresh, quick=True)
        except RividError as error:
            return error

    first = fit(models[0])  # its noise is the start for the others
    noise = None if isinstance(first, RividError) else first.noise
    made = [first, *side_by_side(partial(fit, noise=noise), models[1:])]
    found = [one for one in made if isinstance(one, Explanation)]
    if not found:
        raise next(one for one in made if isinstance(one, RividError))
    return sorted(found, key=lambda one: -likelihood(one, record))


def _sums(one: Explanation, record: Record) -> tuple[Floats, Floats, Floats]:
    """Return squares and number of each day's innovations, and the log density of zeros, (days,) each."""
    seen = np.where(record.used, one.residual, np.nan)
    r = one.noise.whiten(seen, activity=record.activity)
    squares = (r * r).sum(axis=1)
    return squares, (r != 0.0).sum(axis=1), one.noise.log_likelihood(seen, record.activity) + 0.5 * squares


def likelihood(one: Explanation, record: Record) -> float:
    """Return the mean log density of a fit's own days, with their common scales [nats]."""
    # A missing effect can make some of them far noisier.
    squares, counts, plain = _sums(one, record)
    return float(day_densities(squares, 0.0 * squares, plain, counts, tails_of(one, record)).mean())


def scored(one: Explanation, record: Record, blocks: Ints, tails: float) -> Explanation:
    """Score an explanation: log density and errors of each day, predicted by the fit without its block.

    `blocks` (days,) are those of the days, `tails` the degrees of freedom of the days' common scale.
    """
    noise = one.noise
    seen = np.where(record.used, one.residual, np.nan)
    found = _information(noise, seen, one.columns, record)
    low, high = _room(one.model, one.sd)
    p, far = len(one.shared), 1.0 / WIDE  # an effect's columns are valid up to its own size
    low[p:], high[p:] = np.maximum(low[p:], -far), np.minimum(high[p:], far)
    off = np.zeros(len(one.sd))
    off[:p] = vector_of(one.model.reach) - [f.mean for f in one.model.reach.parameters]
    within = one.sd * low, one.sd * high
    squares, log_det, change, errors = held_out(*found, one.sd**-2.0, blocks, one.weights, off, within)
    _, counts, plain = _sums(one, record)
    density = day_densities(squares, log_det, plain, counts, tails)
    density = density - one.price + (0.0 if one.bonus is None else one.bonus)
    one = replace(one, density=density, change=change, standard_errors=errors)
    if one.parent is not None and one.bonus is not None and one.parent.bonus is None:
        return replace(one, errors=one.parent.errors)  # the filter does not forecast a swing
    return replace(one, errors=day_errors(record, one.predicted, noise, HORIZONS))


def without_mirrored(
    one: Explanation, record: Record, opened: Bools, blocks: Ints, tails: float
) -> Explanation:
    """Reduce the score of an explanation by the gain of events of the opposite sign in its residual."""
    # Heavy-tailed noise has events as well, but of both signs, while rain takes no water away. Events of the
    # impossible sign gain what noise gives to the explanation's own events, which pay it in equal parts.
    seen, density = np.where(record.used, one.residual, np.nan), one.density
    follows = np.append(False, np.diff(record.day_number) == 1)
    for events in one.events:
        if not events.kind.sign:
            continue
        found = find_events(
            seen, one.noise.whiten, replace(events.kind, sign=-events.kind.sign), record.sample_time,
            lead=record.lead, follows=follows,
        )  # fmt: skip
        more = replace(one, residual=one.residual - found.coded, events=(*one.events, found))
        more = scored(more, record, blocks, tails)
        gained = max(float((more.density - one.density)[opened].sum()), 0.0)
        days = np.bincount([event.day for event in events.events], minlength=record.days) * opened
        density = density - gained * days / max(days.sum(), 1)
    return replace(one, density=density)


TAILS = (3.0, 6.0, 12.0, 25.0, 50.0, 100.0, 1000.0)  # degrees of freedom that are tried


def tails_of(one: Explanation, record: Record) -> float:
    """Return the degrees of freedom of greatest likelihood for the common scales of the open days."""
    squares, counts, _ = _sums(one, record)
    chosen = (one.weights > 0.0) & (counts > 0)
    squares, counts, nothing = squares[chosen], counts[chosen], np.zeros(int(chosen.sum()))
    return max(TAILS, key=lambda t: float(day_densities(squares, nothing, nothing, counts, t).sum()))
