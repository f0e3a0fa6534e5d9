"""Probabilities of the explanations from their scores, material effects, and the names that follow.

Set by hand are the probability to name an effect alone, that of a group of names, and the least share of the
squared error that counts; and, until the exam has calibrated it, the exponent of the scores.
"""

from bisect import bisect_left, bisect_right
from collections import Counter
from collections.abc import Callable, Container, Sequence
from dataclasses import dataclass, field, replace
from functools import cached_property
from itertools import combinations

import numpy as np
from scipy.special import chdtrc

from rivid.diagnosis.blocks import Split
from rivid.diagnosis.data import Record
from rivid.diagnosis.explanation import HORIZONS, Explanation, Unknown, scored, tails_of, without_mirrored
from rivid.diagnosis.fit import MISFIT, WEATHER, DayErrors, Model, day_errors, residual_of
from rivid.diagnosis.noise.model import NoiseModel
from rivid.diagnosis.predictive import probabilities
from rivid.diagnosis.response.base import Response
from rivid.effects import LEVEL_NOISES, Effect
from rivid.effects.level import RatingShift, StillingWell
from rivid.errors import RividError
from rivid.types import Bools, Floats, Ints

ALONE = 0.95  # least probability at which an effect is named alone
TOGETHER = 0.95  # least probability of the smallest group of names together
MATERIAL = 0.10  # least share of the squared error, at one horizon, that an effect must remove to be named
TEMPER = 0.5
"""Exponent of the scores, divided by their inflation. Over 93 development seasons of 30 to 120 days the log
loss of names is 0.94 at 0.05, 0.92 at 0.1 and 0.2, 0.93 at 0.5 and 0.96 at 1: too flat to choose by. At 0.2
an earlier search lost two of three stretches of the bypass of Glen Canyon."""
UNKNOWN = 0.5
"""Least probability of an unknown cause at which it is the verdict: more probable than all names together."""
THIRD = 1.3
"""Half of the chi-square (one degree of freedom) that 2.5 of 24 variables exceed: the third largest gain per
unit of variance of the 24 effects of a pool if none acts. For the 11 effects of a river it is 0.7."""
HAIR = 1e-3
"""Score difference of effects that cannot be separated, so that the likelier one is named first [nats]."""
STRAINED = 1e-6
"""Prior probability of parameters farther from the configuration than the calibrated ones, below which these
compensate for something else. The priors are tolerances, not known distributions: hence far below 5 %."""
DOUBT = 0.05  # significance level of the tests that allow for the scatter between blocks
Core = tuple[tuple[str, ...], Unknown]
"""Names and unknown cause of an explanation."""
DRAWS = 2000  # bootstrap draws: they give a probability of 5 % to within 0.5 %
SEASONS = 24  # seasons simulated from a noise model: they give the variance to within 30 %


def block_sums(days: Floats, chosen: Bools, blocks: Ints) -> Floats:
    """Sum over the chosen days of each block: (..., days) to (..., blocks)."""
    label = np.unique(blocks[chosen], return_inverse=True)[1]
    out = np.zeros((*days.shape[:-1], int(label.max(initial=-1)) + 1))
    np.add.at(np.moveaxis(out, -1, 0), label, np.moveaxis(days[..., chosen], -1, 0))
    return out


def ranked(
    pool: Sequence[Explanation],
    chosen: Bools,
    blocks: Ints,
    extended: Container[tuple[str, ...]] | None = (),
) -> Floats:
    """Return the probability of each explanation, shape (explanations,).

    `extended` are the sorted names of the explanations beside which the search, which is over, tried further
    effects; None if it continues.

    If a response has the same error for days, scores scatter more than under the noise model: with c times
    the variance, gains by chance are c times as large. The likeliest explanations with one effect, two
    effects and so on divide the gains over the best unknown cause into steps. Each step is divided by the
    inflation of the explanation at its end, since earlier ones have their own scatter. Every explanation is
    put on this scale, whatever it extends: two with equal scores keep equal scores. Unknown causes have no
    inflation, since they model this scatter; explanations that score below the best unknown cause keep their
    scores. An error of the response that is the same on all days does not scatter: :func:`_gains_of_misfit`
    measures it.
    """
    scores = np.stack([block_sums(one.density, chosen, blocks) for one in pool])
    total = scores.sum(axis=1).tolist()
    bare = min(len(one.names) for one in pool)  # effects known from the start
    unknown = [i for i, o in enumerate(pool) if o.unknown in ("flow", "gauge") and len(o.names) == bare]
    least = max(unknown, key=lambda i: total[i]) if unknown else int(np.argmin(total))

    def level(one: Explanation) -> int:
        """Return the number of its effects; an unknown cause beside further effects counts as one more."""
        return len(one.names) + int(bool(one.unknown) and len(one.names) > bare)

    misfit = _gains_of_misfit(pool, total, extended)
    worth, known, reduced = scores.copy(), least, scores[least]
    for step in sorted({level(one) for one in pool}):
        lead = max((i for i, one in enumerate(pool) if level(one) == step), key=lambda i: total[i])
        doubt = max(pool[lead].inflation, TEMPER * misfit.get(len(set(pool[lead].names)), 0.0))
        for i in range(len(pool)):
            if total[known] < total[i] <= total[lead]:
                worth[i] = reduced + (scores[i] - scores[known]) / doubt
        if total[lead] > total[known]:
            known, reduced = lead, worth[lead]
    return probabilities(
        worth, [one.log_prior + log_places(one) for one in pool], parts=chosen.sum() / scores.shape[1],
        temper=TEMPER, draws=DRAWS,
    )  # fmt: skip


def _gains_of_misfit(
    pool: Sequence[Explanation], total: Sequence[float], extended: Container[tuple[str, ...]] | None
) -> dict[int, float]:
    """Estimate the variance of gains of absent effects, by the number of effects of an explanation.

    Beside all effects that act, another one gains where the response error resembles its column. Gains of one
    more effect over the likeliest explanation of each number of effects are chi-square variables times this
    variance. It follows from the third largest gain, as two effects may act. With fewer effects some that act
    are missing: the least variance of the larger numbers is used. Beside the most effects it is 0 if the
    likeliest is in `extended`, since nothing gained enough to be tried. Else nothing was tried: that beside
    one effect less is used, and none while the search continues. Effects confounded with one that gains more,
    and further stretches of the same effect, are not counted.
    """
    best: dict[Core, tuple[float, Explanation]] = {}
    for score, one in sorted(zip(total, pool, strict=True), key=lambda pair: pair[0]):
        best[tuple(sorted(one.names)), one.unknown] = score, one
    gains: dict[int, list[tuple[float, Explanation]]] = {}
    for (names, unknown), (score, one) in best.items():
        fewer = [key for key in best if key[1] == unknown and len(set(key[0])) == len(set(names)) - 1]
        less = [best[key][0] for key in fewer if [n for n in names if n in key[0]] == [*key[0]]]
        lead = max(fewer, key=lambda key: best[key][0], default=None)
        if less and lead and (score > best[lead][0] or Counter(lead[0]) <= Counter(names)):
            gains.setdefault(len(set(names)), []).append((score - max(less), one))
    variance: dict[int, float] = {}
    for number, many in gains.items():
        apart, larger = list[float](), list[Explanation]()
        for gain, one in sorted(many, key=lambda pair: -pair[0]):
            if not any({*o.names} == {*one.names} or alike(o, one) for o in larger):
                apart.append(gain)
            larger.append(one)
        variance[number] = max(apart[2], 0.0) / THIRD if len(apart) > 2 else 0.0
    first, last = min(gains, default=0), max(gains, default=0)
    if extended is not None:
        of_last = [(score, names) for (names, _), (score, _) in best.items() if len(set(names)) == last]
        if max(of_last, default=(0.0, ()))[1] in extended:
            variance[last + 1] = 0.0
        else:
            last -= 1
    return {
        number: min((v for n, v in variance.items() if n > max(first, min(number, last))), default=0.0)
        for number in variance
    }


def shares(one: Explanation, other: Explanation, chosen: Bools, blocks: Ints) -> tuple[Floats, Floats]:
    """Return the share of the squared error of `other` removed by `one`, (horizons,), and bootstrap draws."""
    with_, without = (block_sums(e.squares, chosen, blocks) for e in (one.errors, other.errors))
    count = with_.shape[1]
    weights = np.random.default_rng(0).dirichlet(np.ones(count), DRAWS)

    def share(a: Floats, b: Floats) -> Floats:
        return np.asarray(1.0 - a / np.where(b > 0.0, b, np.inf))

    return share(with_.sum(axis=1), without.sum(axis=1)), share(weights @ with_.T, weights @ without.T)


def as_volume(one: Explanation, other: Explanation) -> Explanation:
    """Scale level errors of `one` to the surface area of `other`, if this makes them smaller."""
    # If operators hold the level, the logged outflow follows the inflow: a response with too large a surface
    # area then forecasts the level better than the true one does.
    area, its = one.noise.surface_area, other.noise.surface_area
    if area is None or its is None or area >= its:
        return one
    return replace(one, errors=one.errors._replace(squares=one.errors.squares * (area / its) ** 2))


def removed(one: Explanation, other: Explanation, chosen: Bools, blocks: Ints) -> Bools:
    """Return at which horizons (horizons,) `one` removes a material share of the squared error of `other`."""
    share, draws = shares(one, other, chosen, blocks)
    return np.asarray((share >= MATERIAL) & (np.quantile(draws, DOUBT, axis=0) > 0.0))


def grows(one: Explanation, other: Explanation, chosen: Bools, blocks: Ints) -> bool:
    """Return whether an error an hour or more ahead grows materially from `other` to `one`."""
    _, draws = shares(as_volume(one, other), other, chosen, blocks)
    # A smaller growth is allowed: if operators react to the weather, a response biased by a missing effect
    # can forecast a day ahead better than the true one.
    return bool((np.quantile(draws, 1.0 - DOUBT, axis=0)[1:] < -MATERIAL).any())


def is_material(
    one: Explanation, other: Explanation, chosen: Bools, blocks: Ints, same: Explanation | None = None
) -> bool:
    """Return whether an explanation removes enough of another one's error and makes no horizon worse."""
    # Increases are judged against `same`, if given, since another response may differ in its volumes only;
    # those in a single block are not: they may be due to the weather of its days.
    enough = bool(removed(as_volume(one, other), other, chosen, blocks).any())
    several = len(np.unique(blocks[chosen])) > 1
    return enough and not (several and grows(one, other if same is None else same, chosen, blocks))


def harmless(one: Explanation, first: Explanation, chosen: Bools, blocks: Ints) -> bool:
    """Return whether an explanation with a name makes no forecast of an hour or more materially worse."""
    # An effect that biases the response can do so and still be likelier, by details within a sample.
    return not one.names or one is first or not grows(one, first, chosen, blocks)


def worse_on(one: Explanation, other: Explanation, chosen: Bools, blocks: Ints) -> bool:
    """Return whether days contradict an explanation: a lower score or a larger error, beyond the scatter."""
    from scipy.stats import t

    gain = block_sums(one.density - other.density, chosen, blocks)
    many = len(gain)
    # Few blocks have hardly a scatter: it must not be improbable by their score alone either.
    if TEMPER * float(gain.sum()) / one.inflation < np.log(DOUBT / (1.0 - DOUBT)):
        return True
    if many < 2:  # one block has no scatter
        return False
    share, draws = shares(as_volume(one, other), other, chosen, blocks)
    # Draws of few blocks scatter too little: corrected by their number and by Student's t.
    tests = len(share)  # the density, and all horizons but the first, share the significance level
    wide = float(t.ppf(1.0 - DOUBT / tests, many - 1)) * np.sqrt((many + 1.0) / (many - 1.0))
    unlikely = gain.mean() + wide * gain.std() / np.sqrt(many + 1.0) < 0.0
    return bool(unlikely or (share + wide * draws.std(axis=0) < 0.0)[1:].any())


def aligned(one: Explanation, record: Record, opened: Bools, blocks: Ints) -> Explanation:
    """Return an explanation with effect dates that begin and end on the likeliest sealed days."""
    # Open days do not show on which of the sealed days between two of them an effect begins or ends. The
    # score of the sealed days is reduced by the logarithm of the number of candidate days.
    for place, effect in enumerate(one.model.effects):
        for end in (0, 1) if effect.dates else ():
            able, tried = _ends(one.model.effects[place], end, record, opened), []
            for day in able if len(able) > 1 else ():
                effects = [*one.model.effects]
                dates = [*(effects[place].dates or ())]
                dates[end] = record.dates[day]
                effects[place] = replace(effects[place], dates=(dates[0], dates[1]))
                model = replace(one.model, effects=tuple(effects))
                try:
                    left = residual_of(record, model.baseline(record)) - one.coded
                except RividError:  # the reach cannot carry the flows
                    continue
                moved = replace(one, model=model, residual=left)
                tails = tails_of(moved, record)
                moved = scored(moved, record, blocks, tails)
                tried.append(without_mirrored(moved, record, opened, blocks, tails))
            if tried:
                one = max(tried, key=lambda each: float(each.density[~opened].sum()))
                chosen = np.isin(np.arange(record.days), able) & ~opened
                one = replace(one, density=one.density - np.log(len(able)) / chosen.sum() * chosen)
    return one


def _ends(effect: Effect, end: int, record: Record, opened: Bools) -> range:
    """Return rows on which an effect may begin (`end` 0) or end (1) without a change on open days."""
    assert effect.dates is not None
    rows = np.flatnonzero(opened)
    inside = [k for k in rows.tolist() if effect.dates[0] <= record.dates[k] <= effect.dates[1]]
    if not inside:
        return range(0)
    if end == 0:
        return range(int(rows[rows < inside[0]].max(initial=-1)) + 1, inside[0] + 1)
    return range(inside[-1], int(rows[rows > inside[-1]].min(initial=record.days)))


def strained(reach: Response) -> bool:
    """Return whether calibrated parameters contradict the configured geometry, by the chi-square test."""
    if reach.name != "saint-venant":  # others have no geometry
        return False
    off = np.array([(one.value - one.mean) / one.sd for one in reach.parameters])
    return bool(chdtrc(len(off), off @ off) < STRAINED)


def _lacking(model: Model, effects: tuple[Effect, ...]) -> Model:
    """Return a model without some of its effects."""
    kept = [(e, names) for e, names in zip(model.effects, model.free, strict=True) if not _among(e, effects)]
    return replace(model, effects=tuple(e for e, _ in kept), free=tuple(names for _, names in kept))


def _among(one: Effect, effects: Sequence[Effect]) -> bool:
    """Return whether an effect is one of some: two equal ones are two."""
    return any(one is other for other in effects)


def errors_without(
    one: Explanation, effects: tuple[Effect, ...], made: Floats, record: Record
) -> DayErrors:  # fmt: skip
    """Compute forecast errors without effects that make `made` (days, n) of the output."""
    noise, errors = one.noise, one.errors
    if noise.recall < 1.0 and any(_among(e, effects) for e in one.model.effects):
        # Level errors that decay with the effect, as with a leak, persist without it.
        noise = replace(noise, recall=_lacking(one.model, effects).recall(record))
        errors = day_errors(record, one.predicted, noise, HORIZONS)
    seen = np.where(np.isfinite(one.residual), made, np.nan)
    more = day_errors(record, seen, noise, HORIZONS)
    return errors._replace(squares=errors.squares + more.squares)


def made_alone(one: Explanation, effects: tuple[Effect, ...], record: Record) -> Floats | None:
    """Compute the part of the output of effects that no other parameter can reproduce, shape (days, n).

    None if none is in the simulator or an event, or if the reach cannot carry the flows without them.
    """
    model, coded = one.model, [e for e in one.others if e.found_as not in LEVEL_NOISES]
    parts = [f.coded for e, f in zip(coded, one.events, strict=True) if _among(e, effects)]
    if any(_among(e, effects) for e in model.effects):
        try:
            parts.append(model.rough.baseline(record) - _lacking(model, effects).rough.baseline(record))
        except RividError:
            return None
    if not parts:
        return None
    made = sum(parts[1:], parts[0])
    own = [not _among(model.effects[i], effects) for i, _, _ in model.slots()]
    kept = np.array([True] * len(one.shared) + own)
    # All other parameters are fitted to the output by one Gauss-Newton step.
    white, columns = one.whitened(record)
    X, r = columns[kept].reshape(int(kept.sum()), -1), white(made[None]).ravel()
    x = np.linalg.solve(X @ X.T + np.eye(len(X)), X @ r)
    return np.asarray(made - np.tensordot(x * one.sd[kept], one.columns[kept], 1))


@dataclass(frozen=True, eq=False)
class Study:
    """All explanations of a diagnosis, with their probabilities and the names that follow."""

    record: Record
    split: Split
    pool: tuple[Explanation, ...]  # all explanations, scored
    notes: tuple[str, ...]
    start: tuple[Effect, ...] = ()  # effects known from the start
    extended: Container[tuple[str, ...]] = ()  # sorted names beside which further effects were tried
    found: dict[Explanation, Core] = field(default_factory=dict)  # results of :meth:`_given`
    late: dict[Explanation, tuple[Effect, ...]] = field(default_factory=dict)  # of :meth:`stand_ins`
    # errors without the part of effects that no other parameter can reproduce; for all studies of a search
    without: dict[tuple[Explanation, tuple[Effect, ...]], DayErrors | None] = field(default_factory=dict)

    @cached_property
    def first(self) -> Explanation:
        """The best explanation with the initial effects only."""
        plain = (one for one in self.pool if one.parent is None and one.unknown != "dynamics")
        return max(plain, key=self.score)

    @cached_property
    def opened(self) -> Bools:
        """Days used to fit and score, shape (days,)."""
        return np.asarray(self.split.fit | self.split.select)

    @cached_property
    def ranking(self) -> tuple[tuple[Explanation, float], ...]:
        """The best explanation of each kind with its probability, most probable first."""
        pool, days = leading(self._counting, self.opened), (self.opened, self.split.block)
        lead = pool[int(np.argmax(ranked(pool, *days, self.extended)))]
        levelled = [self._levelled(one, lead) for one in pool]
        chances = ranked(levelled, *days, self.extended).tolist()
        return tuple(sorted(zip(pool, chances, strict=True), key=lambda pair: -pair[1]))

    def _levelled(self, one: Explanation, lead: Explanation) -> Explanation:
        """Return `one`, at the score of `lead` less :data:`HAIR` if response errors may separate the two."""
        # A response error can resemble the difference of two confounded effects with the same sign on all
        # days, so that no scatter reveals it. The score of unknown dynamics above that of `lead` shows its
        # size, and so does the front misfit that remains beside an effect on timing.
        behind = self.score(lead) - self.score(one)
        twin = alike(one, lead) and (behind < self._missed(lead) or self._partly_right(lead, one))
        if one.unknown != lead.unknown or behind <= HAIR or not (twin or self._balances(one, lead)):
            return one
        density = lead.density - HAIR / float(self.opened.sum())
        prior = min(one.log_prior, lead.log_prior)
        return replace(one, density=density, log_prior=prior, parent=lead.parent, inflation=lead.inflation)

    def _missed(self, one: Explanation) -> float:
        """Return the score of unknown dynamics above that of `one`: what its response lacks on all days."""
        flexible = (self.score(o) for o in self.pool if o.unknown == "dynamics")
        return max(flexible, default=-np.inf) - self.score(one)

    def _partly_right(self, lead: Explanation, other: Explanation) -> bool:
        """Return whether a timing effect that `other` lacks removes most of the front misfit, not all."""
        # Most is half of its square; the rest must be a material share. A clock offset fitted to ice on a
        # river removed three quarters. What `other` leaves beyond the rest may be a response error only where
        # it is no larger than the rest, which is one.
        differing = difference(other, lead)
        if differing is None or differing[1].family != "timing":
            return False
        less = self._less(lead, differing[1])
        before, left, its = (one.noise.misfit**2 for one in (less, lead, other))
        return MATERIAL * before < left <= 0.5 * before and its <= 2.0 * left

    def _balances(self, one: Explanation, lead: Explanation) -> bool:
        """Return whether explanations of a river differ by one balance shift each, possibly of the rating."""
        # The discharge is read from a rating, which may be wrong by any slow function of the stage: the
        # residual of a shift by a constant and a share is no evidence of water.
        differing = difference(one, lead)
        if self.record.kind != "river" or differing is None:
            return False
        shifts = {RatingShift.name, *RatingShift.confounded_with}
        if any(effect.hours or effect.name not in shifts for effect in differing):
            return False
        ratings = [lead, *(o for o in self.pool if (two := difference(o, lead)) and two[1] is differing[1])]
        return any(_within_limits(e) for o in ratings for e in o.effects if isinstance(e, RatingShift))

    @cached_property
    def _counting(self) -> tuple[Explanation, ...]:
        """Explanations that compete: harmless ones, and unknown dynamics that simulate materially better."""
        # A response with many coefficients is always likelier than equations, as none describes a front
        # exactly. It must remove a material share of the error of the best other explanation, at the nearest
        # horizon: at longer ones it infers unlogged flow from the operators' reaction to it.
        able = [one for one in self.pool if harmless(one, self.first, self.opened, self.split.block)]
        known = [one for one in able if one.unknown != "dynamics"]
        flexible = [one for one in self.pool if one.unknown == "dynamics"]
        if not flexible or not known:
            return tuple(able)
        pool, days = leading(known, self.opened), (self.opened, self.split.block)
        best = pool[int(np.argmax(ranked(pool, *days, self.extended)))]
        return (*known, *(one for one in flexible if removed(one, as_volume(best, one), *days)[0]))

    def _material(
        self, one: Explanation, other: Explanation, days: Bools, same: Explanation | None = None
    ) -> bool:
        return is_material(one, other, self.opened & days, self.split.block, same)

    def core(self, one: Explanation) -> Core:
        """Return the names that are material given those before them, and the unknown cause if material."""
        names, unknown = self._given(one)
        if one not in self.late:
            self.late[one] = self.stand_ins(one)
        late = Counter(effect.name for effect in self.late[one])
        return (tuple((Counter(names) - late).elements()), unknown or "flow") if late else (names, unknown)

    def _given(self, one: Explanation) -> Core:
        """Return the core before effects that stand for an unknown delay are taken out."""
        if one not in self.found:
            self.found[one] = self._core(one)
        return self.found[one]

    def _core(self, one: Explanation) -> Core:
        parent = one.parent
        if parent is None:
            return (), one.unknown
        names, unknown = self._given(parent)
        if one.added is None and one.unknown in ("", parent.unknown):
            return names, unknown
        if one.added is None:
            beyond = self.beyond(parent, MATERIAL, self.opened)
            if beyond or self.large(one) or self._returns(one, parent):
                return names, one.unknown
        if parent.parent is None and not parent.unknown:  # compare with the best response
            parent = self.first
        if one.added is None:
            active = np.ones(len(self.opened), bool)
            return names, one.unknown if self._material(one, parent, active) else unknown
        if self._adds(one, (one.added,), parent):
            names = (*names, one.added.name)
        # An effect may be material only beside the others: without them the response was biased.
        for effect in one.effects:
            known = effect.name in ("", *names) or effect is one.added or effect in self.start
            if not known and not effect.found_as and self._adds(one, (effect,), self._less(one, effect)):
                names = (*names, effect.name)
        # Delays on the same dates can reproduce each other, and be material together.
        rest = [e for e in one.model.effects if _delays(e) and e.name not in names and e not in self.start]
        for dates in sorted({e.dates for e in rest if e.dates}):
            pair = tuple(e for e in rest if e.dates == dates)
            if len(pair) > 1 and self._adds(one, pair, self._less(one, *pair)):
                names = (*names, *(e.name for e in pair))
        return names, unknown

    def stand_ins(self, one: Explanation) -> tuple[Effect, ...]:
        """Return the material effects of an explanation that stand for a delay of an unknown cause.

        They are degenerate, or leave a material share of the error on their dates, or these share a boundary
        inside the season with those of another delay or of an unknown flow: it is less probable that two
        causes change on the same day by chance than that one cause has another form.
        """
        names, unknown = self._given(one)
        opened = [self.record.dates[k] for k in np.flatnonzero(self.opened)]
        late = [e for e in one.model.effects if e.name in names and e not in self.start]
        late = [e for e in late if _delays(e)]
        inside = {  # boundaries inside the season, as numbers of open days before them
            e: {bisect_left(opened, e.dates[0]), bisect_right(opened, e.dates[1])} - {0, len(opened)}
            for e in (*late, *(e for e in one.model.effects if unknown and not e.name))
            if e.dates
        }
        pairs = [
            (a, b) for a, b in combinations(inside, 2)
            if a.name != b.name and any(abs(i - j) <= 1 for i in inside[a] for j in inside[b])
        ]  # fmt: skip
        return tuple(
            e for e in late if e.degenerate or any(e in pair for pair in pairs) or self._leaves(one, e)
        )

    def _leaves(self, one: Explanation, effect: Effect) -> bool:
        """Return whether an effect leaves a material share of the excess error on its dates."""
        # By Welch's test over blocks, on mean squares of innovations: they are 1 if nothing is missing.
        from scipy.stats import ttest_ind

        active = one.active(self.record, effect)
        inside, outside = self.opened & active, self.opened & ~active
        if min(np.unique(self.split.block[days]).size for days in (inside, outside)) < 2:
            return False

        def means(white: Floats, days: Bools) -> Floats:
            sums, counts = (block_sums(x.sum(axis=1), days, self.split.block) for x in (white, white > 0.0))
            return np.asarray(sums / np.maximum(counts, 1))

        now, before = (
            one.noise.whiten(
                np.where(self.record.used, other.predicted, np.nan), activity=self.record.activity
            ) ** 2
            for other in (one, self._less(one, effect))
        )  # fmt: skip
        left = (means(now, inside) - MATERIAL * means(before, inside)) / (1.0 - MATERIAL)
        test = ttest_ind(left, means(now, outside), equal_var=False, alternative="greater")
        return bool(test.pvalue < DOUBT)

    def _less(self, one: Explanation, *effects: Effect) -> Explanation:
        """Return the best explanation without effects of `one`, with all or some of its other effects."""
        others = Counter(one.names) - Counter(effect.name for effect in effects)
        able = (o for o in self.pool if Counter(o.names) <= others and o.unknown in ("", one.unknown))
        return max(able, key=self.score, default=self.first)

    def _adds(self, one: Explanation, effects: tuple[Effect, ...], less: Explanation) -> bool:
        """Return whether effects of an explanation are material together, compared with one without them."""
        if effects[0].found_as == "swing":
            return self._swings(effects[0])
        if any(self._like_response(one, e, less) or self._within_stamps(one, e) for e in effects):
            return False
        if (one, effects) not in self.without:
            made = made_alone(one, effects, self.record)
            errors = None if made is None else errors_without(one, effects, made, self.record)
            self.without[one, effects] = errors
        left = self.without[one, effects]
        active = np.any([one.active(self.record, effect) for effect in effects], axis=0)
        if left is None and len(less.names) < len(one.names) - len(effects):  # it has other causes too
            return False
        # Errors of a run without it may still be smaller: operators react to the weather, so that the logged
        # outflow predicts the level.
        if left is not None and not self._material(one, replace(one, errors=left), active):
            return False
        bare = [o for o in self.pool if o.names == less.names and o.unknown == less.unknown]
        own = [o for o in bare if o.model.reach.name == one.model.reach.name]
        return self._material(one, less, active, max(own, key=self.score, default=less))

    def _like_response(self, one: Explanation, effect: Effect, less: Explanation) -> bool:
        """Return whether an effect at all times gains no more than the response error that is left."""
        # It resembles such an error, which does not scatter. Of confounded effects the likeliest counts.
        if not _lasts(effect):
            return False
        best = max((o for o in self.pool if o is one or alike(o, one)), key=self.score, default=one)
        return self.score(best) - self.score(less) < self._missed(best)

    def _within_stamps(self, one: Explanation, effect: Effect) -> bool:
        """Return whether an effect at all times may move flows by less than half a sample."""
        # Whether a log holds means or readings, and at which end of the sample, is not known better.
        if not _lasts(effect) or effect.family != "timing":
            return False
        errors = next((one.errors_of(i) for i, e in enumerate(one.model.effects) if e is effect), {})
        units = {key: spec.unit for key, spec in effect.parameters().items()}
        least = [
            float(np.abs(getattr(effect, key)).max()) - 1.96 * se
            for (key, _), se in errors.items()
            if units[key] == "s"
        ]
        return bool(least) and max(least) < 0.5 * self.record.sample_time

    def _returns(self, one: Explanation, parent: Explanation) -> bool:
        """Return whether an added unknown flow, event or swing makes a material share of the error."""
        before, now = ([e for e in o.effects if not e.name] for o in (parent, one))
        if len(now) == len(before):
            return False
        if now[-1].found_as == "swing":
            return self._swings(now[-1])
        return self._material(one, parent, one.active(self.record, now[-1]))

    def _swings(self, effect: Effect) -> bool:
        """Return whether a seiche's variance is a material share of the least squared error at a horizon."""
        amplitude = float(getattr(effect, "amplitude"))  # noqa: B009 - every seiche has one
        # of all explanations: the filter of the extended one may fit the swing as weather
        rmse = np.min([o.errors.rmse(self.opened) for o in self.pool], axis=0)
        return bool((0.5 * amplitude**2 >= MATERIAL * rmse**2).any())

    def beyond(self, one: Explanation, least: float, *parts: Bools) -> bool:
        """Return whether an excess of :meth:`excess` is in two blocks or more: one is an incident."""
        return len(np.unique(self.split.block[self.excess(one, least, *parts)])) > 1

    def excess(self, one: Explanation, least: float, *parts: Bools) -> Bools:
        """Return days on which the squared error exceeds that of the noise, shape (days,).

        They are one of the parts of the days, at a horizon of which the excess is a share `least` or more and
        significant; the block with the largest excess alone, if it is not significant without; or none.
        """
        from scipy.stats import gamma

        # Sums of squares of simulated seasons are treated as a gamma variable. Each horizon of each part is a
        # separate test; the tests share the significance level.
        rng, block, level = np.random.default_rng(0), self.split.block, DOUBT / len(parts) / len(HORIZONS)
        drawn = np.stack([self._drawn(one, one.noise, rng).squares for _ in range(SEASONS)])
        incident = np.zeros(len(block), bool)

        def significant(seen: Floats, sums: Floats) -> Bools:
            mean, variance = sums.mean(axis=0), np.maximum(sums.var(axis=0, ddof=1), 1e-300)
            chance = gamma.sf(seen, mean**2 / variance, scale=variance / np.maximum(mean, 1e-300))
            return np.asarray(chance < level)

        for days in parts:
            seen, sums = (block_sums(x, days, block) for x in (one.errors.squares, drawn))
            largest = (seen - sums.mean(axis=0)).argmax(axis=1)
            much = sums.sum(axis=2).mean(axis=0) <= (1.0 - least) * seen.sum(axis=1)
            much &= significant(seen.sum(axis=1), sums.sum(axis=2))
            others = np.arange(seen.shape[1]) != largest[:, None]
            if (much & significant((seen * others).sum(axis=1), (sums * others).sum(axis=2))).any():
                return days
            for k in largest[much].tolist():
                incident |= days & (block == np.unique(block[days])[k])
        return incident

    def large(self, one: Explanation) -> bool:
        """Return whether the unknown cause makes a material share of the error of simulated days."""
        noise, flow = one.noise, abs(one.model.flow)
        plain = replace(noise, level_sd=min(noise.level_sd, one.model.gauge_floor))
        if self.record.kind == "river":
            plain = replace(noise, level_sd=min(noise.level_sd, WEATHER * flow))
        elif one.unknown == "flow":
            plain = replace(noise, inflow_sd=min(noise.inflow_sd, WEATHER * flow))
        without, with_ = (
            replace(one, errors=self._drawn(one, drawn, np.random.default_rng(0))) for drawn in (plain, noise)
        )
        return bool(removed(without, with_, self.opened, self.split.block).any())

    def _drawn(self, one: Explanation, noise: NoiseModel, rng: np.random.Generator) -> DayErrors:
        """Compute forecast errors of an explanation for days simulated from a noise model."""
        record = self.record
        drawn = noise.simulate(record.days, record.time.shape[1], rng, record.activity)
        return day_errors(record, np.where(np.isfinite(one.residual), drawn, np.nan), one.noise, HORIZONS)

    def chance(self, holds: Callable[[tuple[str, ...], Unknown], bool]) -> float:
        """Return the probability of explanations with material names and unknown that `holds` accepts."""
        return min(sum((p for one, p in self.ranking if holds(*self.core(one))), 0.0), 1.0)

    def chance_of(self, name: str, times: int = 1) -> float:
        """Return the probability that at least `times` effects of a name act and are material."""
        return self.chance(lambda names, _: names.count(name) >= times)

    @cached_property
    def names(self) -> tuple[str, ...]:
        """Names of all material effects, the most probable first."""
        found = {name for one, _ in self.ranking for name in self.core(one)[0]}
        return tuple(sorted(found, key=lambda name: -self.chance_of(name)))

    @property
    def unfit(self) -> bool:
        """Whether no response describes the reach, as with a wrong geometry: effects compensate for it."""
        # the front misfit of the most probable explanation is at its plausible limit
        lead = self.ranking[0][0]
        return not lead.unknown and lead.noise.misfit > 0.99 * MISFIT

    @cached_property
    def strained(self) -> bool:
        """Whether the most probable explanation contradicts the configured geometry."""
        lead = self.ranking[0][0]
        return not lead.unknown and strained(lead.model.reach)

    @cached_property
    def sure(self) -> tuple[str, ...]:
        """Names that are probable enough alone, again for each further stretch more probable than not."""
        if self.unfit:
            return ()
        found = [name for name in self.names if self.chance_of(name) >= ALONE]
        times = range(2, 1 + max(len(self.core(one)[0]) for one, _ in self.ranking))
        return (*found, *(name for name in found for k in times if self.chance_of(name, k) >= UNKNOWN))

    @cached_property
    def group(self) -> tuple[str, ...]:
        """The fewest names of which one acts beside the sure ones, probably enough; empty if none need to."""

        def beside(found: Sequence[str]) -> float:
            """Return the probability that one of the names acts beside all sure ones."""
            sure = Counter(self.sure)
            return self.chance(lambda names, _: sure <= Counter(names) and not {*names}.isdisjoint(found))

        others = [] if self.unfit else [name for name in self.names if name not in self.sure]
        others.sort(key=lambda name: -beside([name]))
        groups = (tuple(others[:k]) for k in range(1, len(others) + 1))
        return next((found for found in groups if beside(found) >= TOGETHER), ())

    @cached_property
    def last(self) -> Explanation:
        """The most probable explanation with the sure names and the first name of the group."""
        wanted = Counter((*self.sure, *self.group[:1]))
        if not wanted:
            return self.first

        def more(one: Explanation) -> bool:
            """Return whether more is material, or unknown."""
            names, unknown = self.core(one)
            return bool(unknown) or Counter(names) != wanted

        able = [one for one, _ in self.ranking if wanted <= Counter(self.core(one)[0])]
        one = min(able, key=more)
        # Immaterial effects are left out, unless what is fitted with them is material.
        bare = min((o for o in able if not more(o)), key=lambda o: len(o.names), default=one)
        if not self._material(one, bare, self.opened):
            one = bare
        return aligned(one, self.record, self.opened, self.split.block)

    @cached_property
    def steps(self) -> tuple[Explanation, ...]:
        """Explanations from the first (excluded) to the last, each with one more effect."""
        way, one = [], self.last
        while one.parent is not None:
            way.append(one)
            one = one.parent
        return tuple(reversed(way))

    @cached_property
    def stranger(self) -> Explanation | None:
        """The most probable explanation with an unknown cause, None if there is none."""
        return next((one for one, _ in self.ranking if self.core(one)[1]), None)

    @property
    def unknown_delays(self) -> tuple[Effect, ...]:
        """Effects of :attr:`stranger` that stand for a delay of an unknown cause."""
        one = self.stranger
        return () if one is None else self.stand_ins(one)

    @cached_property
    def unknown(self) -> float:
        """Probability of an unknown cause."""
        return self.chance(lambda _, unknown: bool(unknown))

    def score(self, one: Explanation) -> float:
        """Return the log density of the open days, each predicted by the fit without its block [nats]."""
        return float(one.density[self.opened].sum())

    def p_value(self, one: Explanation) -> float:
        """Return the p-value of an explanation's gain over its parent, by Student's t over blocks."""
        from scipy.stats import t

        assert one.parent is not None
        gain = block_sums(one.density - one.parent.density, self.opened, self.split.block)
        spread = float(gain.std(ddof=1)) / np.sqrt(len(gain)) if len(gain) > 1 else np.inf
        return float(t.sf(float(gain.mean()) / max(spread, 1e-300), max(len(gain) - 1, 1)))

    @cached_property
    def contradicted(self) -> bool:
        """Whether the sealed days contradict what is named, beyond the scatter of their blocks."""
        if self.last is self.first:
            return False
        # A model with errors that grow at all horizons is no improvement, however few blocks there are.
        share, _ = shares(self.last, self.first, self.split.sealed, self.split.block)
        worse = bool((share[1:] < -MATERIAL).all())
        return worse or worse_on(self.last, self.first, self.split.sealed, self.split.block)


def _delays(effect: Effect) -> bool:
    """Return whether an effect delays flows, a wave or the reading."""
    return effect.family == "timing" or isinstance(effect, StillingWell)


def difference(one: Explanation, other: Explanation) -> tuple[Effect, Effect] | None:
    """Return the effect of each of two explanations that the other lacks, or None if it is not one each."""
    only = {effect.name: effect for effect in one.effects if effect.name not in ("", *other.names)}
    its = {effect.name: effect for effect in other.effects if effect.name not in ("", *one.names)}
    if len(only) != 1 or len(its) != 1:
        return None
    return only.popitem()[1], its.popitem()[1]


def alike(one: Explanation, other: Explanation) -> bool:
    """Return whether two explanations differ by one effect each and these are confounded."""
    found = difference(one, other)
    return found is not None and (
        found[1].name in found[0].confounded_with or found[0].name in found[1].confounded_with
    )


def log_places(one: Explanation) -> float:
    """Return the log prior of the places along the reach that the scores leave to the effects of one [nats].

    All places are equally probable. At the upper end of the reach a lateral inflow is as likely as a release
    at the dam, but only there.
    """
    from scipy.special import ndtr

    price = 0.0
    for i, (effect, free) in enumerate(zip(one.model.effects, one.model.free, strict=True)):
        if "place" not in free:
            continue
        at, sd = float(getattr(effect, "place")), one.errors_of(i)["place", None] / np.sqrt(TEMPER)  # noqa: B009
        if sd > 0.0:  # else it is not estimated
            inside = ndtr((1.0 - at) / sd) - ndtr(-at / sd)
            price += min(float(np.log(inside * sd * np.sqrt(2.0 * np.pi))), 0.0)
    return price


def _lasts(effect: Effect) -> bool:
    """Return whether an effect in the simulator acts at all times."""
    return not (effect.found_as or effect.dates or effect.hours)


def _within_limits(effect: Effect) -> bool:
    """Return whether all parameters of an effect are strictly within their limits."""
    return all(
        spec.low < float(np.min(getattr(effect, key))) <= float(np.max(getattr(effect, key))) < spec.high
        for key, spec in effect.parameters().items()
    )


def leading(pool: Sequence[Explanation], opened: Bools) -> list[Explanation]:
    """Return the best explanation of each kind, which is a set of names and an unknown cause."""
    best: dict[Core, tuple[float, Explanation]] = {}
    for one in pool:
        key = tuple(sorted(one.names)), one.unknown
        score = TEMPER * float(one.density[opened].sum()) + one.log_prior + log_places(one)
        if key not in best or score > best[key][0]:
            best[key] = score, one
    return [one for _, one in best.values()]
