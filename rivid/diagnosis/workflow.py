"""The workflow: explanations are fitted and scored, the best one is extended, and the verdict follows.

Steps as in docs/diagnose.md. Open days fit and, each by a fit without its block, score; the sealed days are
used once, at the end.
"""

import datetime as dt
from collections.abc import Callable, Sequence
from dataclasses import replace
from functools import partial
from typing import Any, Literal

import numpy as np
from threadpoolctl import threadpool_limits

from rivid.diagnosis.answer import Evidence, conclude
from rivid.diagnosis.blocks import split
from rivid.diagnosis.data import Record, with_activity
from rivid.diagnosis.decision import (
    ALONE,
    HAIR,
    TEMPER,
    Study,
    alike,
    difference,
    harmless,
    leading,
    ranked,
)
from rivid.diagnosis.explanation import (
    FRESH,
    RELIABLE,
    STEPS,
    Explanation,
    Way,
    fits,
    fitted,
    likelihood,
    scored,
    settled,
    tails_of,
    without_mirrored,
)
from rivid.diagnosis.fit import ENOUGH, DayErrors, Model, NoiseKind, residual_of
from rivid.diagnosis.response.base import Response, kernels_of, vector_of
from rivid.diagnosis.response.hydraulic import HydraulicResponse
from rivid.diagnosis.result import Diagnosis
from rivid.diagnosis.rhythm import rhythm
from rivid.diagnosis.search import (
    Candidate,
    Library,
    Window,
    candidate_of,
    scatter_of,
    screened,
    screened_again,
    screened_instead,
    swung,
    windows_near,
    with_effect,
    with_events,
    with_noise,
)
from rivid.effects import LEVEL_NOISES, Effect
from rivid.effects.flow import LeavingFlow, PassingFlow, RecurringFlow
from rivid.effects.level import UnknownSwing, UnsteadyGauge
from rivid.errors import RividError
from rivid.reach.saint_venant.flow import side_by_side
from rivid.types import DAY, HOUR, Ints

FEWEST_DAYS = 15  # one cycle of blocks
TRIED = 6
"""Number of names tried in the simulator per explanation: each costs about ten simulations. How often the
right name is not among them has not been measured."""
LEAST = 8.0
"""Smallest worth of a candidate that is tried in the simulator [nats]: after the prior and the temper of the
scores, a probable name has several times as much."""
HOPE = 0.2
"""Smallest worth of a candidate that is fitted, over that of the first one if its fit gains as much. With the
noise fitted again, gains of two candidates differ by more than their worth does: of 35 candidates below this
share in four development seasons none gained more than 0.07 of the gain of the best one."""
WINDOWS = 3  # number of candidates with a window of dates that is tried for an unknown daily flow
SECOND = 0.8  # smallest ratio of the gains of a name's second and first window for which both are tried
HOPELESS = 100.0
"""Unknown dynamics this far below the best response in log-likelihood are not fitted to all days [nats per
day]: in five development seasons, effects gained up to 60."""
CARRIED = 0.8
"""Smallest share of the days with flows that a response must carry; below it the geometry is wrong."""
FEW_CELLS = 16  # of a channel while its response settles from draws, which differ by more than grid errors
COARSE = 3  # a response is first fitted to every third open day
SETTLING, CHAINS = 6, 2
"""Number of days on which a response settles, and of repetitions with other draws. In a pool that waves cross
in 1.5 samples, one chain in four ended 700 nats or more behind the others on four days, none on eight."""
CARRIED_ON = 2  # number of settled responses that are fitted to every third open day
CALIBRATION, ROUND = 0.15, 0.6
"""Shares of the work, for the progress: of the calibration, and of each round in what remains. Six diagnoses
had 3 to 31 % and 50 to 96 %. The number of rounds is not known in advance."""
Report = Callable[[float, str], None]
DAYS_A_KNOT, MOST_KNOTS = (7, 21), 20
"""Days between the values of a size that varies with the date, and largest number of values."""
STRANGERS: tuple[type[Effect], ...] = (LeavingFlow, UnsteadyGauge, UnknownSwing)
"""Events and waves of unknown cause, searched for if the library has no effect of that form."""
Latent = Literal["flow", "gauge"]


def _near(candidate: Candidate, record: Record) -> Way:
    """Return the extension by a candidate, fitted from the parameters of an explanation."""
    grow = partial(with_effect, candidate=candidate, record=record)
    return Way(candidate.effect.name, grow, candidate.columns)


def diagnose(
    record: Record,
    response: Response | Sequence[Response],
    classes: dict[str, type[Effect]],
    *,
    floor: Sequence[float] | None = None,  # RMSE at 1, 4 and 24 h of the true model, where it is known
    **given: Any,
) -> tuple[Diagnosis, Evidence | None]:
    """Find the effects that a simulation of the reach lacks; the arguments are those of :func:`find_effects`.

    The evidence is None if there are too few days.
    """
    lacking = ""
    if record.days < FEWEST_DAYS or not split(record.dates).complete:
        lacking = f"{record.days} days can be used: expected {FEWEST_DAYS} or more, to have days that fit, "
        lacking += "that select and that confirm."
    elif not np.ptp(record.inflow, axis=1).any() and not np.ptp(record.outflow, axis=1).any():
        lacking = f"the flows of {record.days} days never move: expected commands that change, for a "
        lacking += "response to be seen; check the columns"
    elif not classes:
        lacking = (
            "no effect may be named: expected one or more in the library; [diagnose] exclude leaves none"
        )
    if lacking:
        return Diagnosis("insufficient_data", lacking, "none"), None
    with threadpool_limits(1):  # the matrices are small: threads of the BLAS would wait for each other
        return conclude(find_effects(record, response, classes, **given), classes, floor)


def find_effects(
    record: Record,
    response: Response | Sequence[Response],  # nominal; all compete, and the first is the configured reach
    classes: dict[str, type[Effect]],  # that may be named, by name
    *,
    gauge_floor: float = 0.0,  # least gauge noise: the reading's step / sqrt(12) [m or m3/s]
    start: Sequence[Effect] = (),  # in the model from the start
    dated: Sequence[Effect] = (),  # tried with these dates and sizes, too
    most: int,  # effects that are added, at most
    report: Report = lambda done, what: None,  # called with the share of the work done, and what is next
) -> Study:
    """Run all steps of a diagnosis except the verdict."""
    responses = tuple(response) if isinstance(response, Sequence) else (response,)
    search = _Search(record, responses, classes, gauge_floor, tuple(start), report, tuple(dated))
    parent, *promising = search.begun()
    extended: list[tuple[tuple[str, ...], str]] = []
    small = False
    for turn in range(most):
        search.begin_round(turn, most)
        for other in promising if turn == 0 else ():
            search.extend(other)
        before = search.extend(parent)
        parent = search.again(before)
        if parent is not before and search.contested(search.score(parent) - search.score(before)):
            parent = search.extend(parent)  # the extensions begin at a better response
        search.shifted(search.likeliest(parent), near=False)  # with wrong dates it may be immaterial
        extended += [(parent.names, parent.unknown), (parent.names, "")]
        lead = search.lead()
        if (lead.names, "") not in extended:
            search.add_rivals(lead)
            lead = search.shifted(search.polished(search.lead()))
        elif (turn == 0 or lead.unknown) and (likely := search.probable(parent)) is not parent:
            # A response that is biased by an effect hides it: with columns about its own it may lead.
            search.add_rivals(likely)
            search.polished(likely)
            search.shifted(search.probable(parent))  # wrong dates hide it, too
            lead = search.lead()
        for one in {id(one): one for one in (lead, search.ordered()[0])}.values():
            search.level_rivals(one)
        search.varied(max(search.pool, key=search.score))
        lead = search.varied(lead)
        if turn == most - 1:
            break
        # Unknown events or waves fit roughly: an effect beside them would stand for the rest of these.
        if (lead.names, lead.unknown) in extended or len(lead.effects) > len(lead.names) == len(start):
            # An immaterial effect that is likelier hides what is material, and so do unknown waves: it shows
            # beside the likeliest effect. Unknown events leave oscillations that would be named beside them.
            events = lead.events
            lead = next((one for one in search.ordered() if events or not one.unknown), lead)
            if small or (lead.names, lead.unknown) in extended or lead.added is None or lead.unknown:
                break
            small = True
        parent = lead
    search.level_twins()
    report(1.0, "the sealed days")
    return search.study()


class _Search:
    """The explanations tried so far, and the steps that add more."""

    def __init__(
        self,
        record: Record,
        responses: tuple[Response, ...],
        classes: dict[str, type[Effect]],
        gauge_floor: float,
        start: tuple[Effect, ...],
        report: Report,
        dated: tuple[Effect, ...] = (),
    ) -> None:
        self.notes: list[str] = []
        responses, record = self._carried(responses, record)
        kernels = kernels_of(responses[0], record)
        self.record = with_activity(record, kernels["up"], kernels["down"])
        self.responses, self.gauge_floor, self.start, self.dated = responses, gauge_floor, start, dated
        self.classes = {name: one for name, one in classes.items() if one.acts_on(record.kind)}
        self.dealt = split(record.dates)
        self.opened = self.dealt.fit | self.dealt.select
        self.pool: list[Explanation] = []
        self.extended: set[tuple[str, ...]] = set()
        self.libraries: dict[str, Library] = {}
        self.tried: list[tuple[Explanation, Explanation]] = []  # by :meth:`again`: parent and extension
        self.without: dict[tuple[Explanation, tuple[Effect, ...]], DayErrors | None] = {}  # by :class:`Study`
        self.tails: float | None = None
        self._report, self._done, self._until, self._round = report, 0.0, CALIBRATION, ""

    def _carried(
        self, responses: tuple[Response, ...], record: Record
    ) -> tuple[tuple[Response, ...], Record]:
        """Return the responses that can carry the flows of most days, and the record of those days."""
        able: list[Response] = []
        days = np.ones(record.days, bool)
        for reach in responses:
            carried = reach.carried(record) if isinstance(reach, HydraulicResponse) else days
            if carried.mean() >= CARRIED:
                able.append(reach)
                days = days & carried
            else:
                self.notes.append(
                    f"the response {reach.name} was passed over: the configured reach would be dry, or its "
                    f"flow not subcritical, on {int((~carried).sum())} of {record.days} days; check length, "
                    "width, depth and bed_level"
                )
        if not able:
            raise RividError(self.notes[-1])
        if not days.all():
            self.notes.append(
                f"{int((~days).sum())} of {record.days} days were left out: at their flows the configured "
                "reach would be dry, or its flow not subcritical"
            )
        return tuple(able), record.take(days)

    def report(self, work: float, what: str) -> None:
        """Report a step that begins now and takes the share `work` of the remainder of the round."""
        self._report(self._done, what + self._round)
        self._done += work * (self._until - self._done)

    def begin_round(self, turn: int, most: int) -> None:
        """Begin a round: explanations with one more effect are tried."""
        self._done, self._round = self._until, f", round {turn + 1} of {most} at most"
        self._until += ROUND * (1.0 - self._until)

    def _scored(self, one: Explanation) -> Explanation:
        one = swung(one, self.record) or one
        if self.tails is None:
            self.tails = tails_of(one, self.record)
        one = scored(one, self.record, self.dealt.block, self.tails)
        return without_mirrored(one, self.record, self.opened, self.dealt.block, self.tails)

    def begun(self) -> list[Explanation]:
        """Return the best response without further effects, then those that an effect could make better."""
        refused: list[RividError] = []
        part = self.record.take(np.flatnonzero(self.opened)[::COARSE])
        rough: list[tuple[float, float, Model]] = []  # likelihood a day, and the same with an effect
        for reach in self.responses:
            self.report(0.1, f"calibrating the response: {reach.name}")
            try:
                one = self._calibrated(reach, part)
                likely = likelihood(one, part)
                rough.append((likely, likely + self._promise(one, part), one.model))
            except RividError as error:
                refused.append(error)
        if not rough:
            raise refused[0]
        self.notes += [f"a response was passed over: {why}" for why in refused]
        best = max(likely for likely, _, model in rough if model.reach.name != "fir" or len(rough) == 1)
        promising = []
        for likely, promise, model in rough:
            name, dynamics = model.reach.name, model.reach.name == "fir"
            if dynamics and likely < best - HOPELESS:
                continue
            self.report(0.1, f"calibrating the response: {name}")
            reach = _able(self._nominal(model), model.reach, self.record)
            model = replace(model, noise=None, reach=reach)
            draft = Explanation(model, "dynamics" if dynamics else "", self.log_prior(int(dynamics)))
            # the fit may leave what the sealed days allow: its start does not
            tried = (self._fitted(draft, None, FRESH, steps=steps) for steps in (STEPS, 0))
            made = next((one for one in tried if one is not None), None)
            if made is None:
                self.notes.append(f"the response {name} was passed over: some flows are too much for it")
                continue
            self.pool.append(made)
            if promise >= best and not dynamics:
                promising.append(made)
        if not self.pool:
            raise RividError(self.notes[-1])
        return sorted(promising or self.pool, key=self.score, reverse=True)

    def _calibrated(self, reach: Response, part: Record) -> Explanation:
        """Return the best fit of a response to some days."""
        starts: Sequence[Response] = (reach,)
        if isinstance(reach, HydraulicResponse):
            few = part.take(_spread(part.days))
            nominal = self._plain(_coarse(reach))
            chains = side_by_side(partial(settled, nominal, few), range(CHAINS))
            best = (one.model.reach for one in fits([nominal, *chains], few, fresh=2)[:CARRIED_ON])
            starts = [replace(one, cells=reach.cells) for one in best if isinstance(one, HydraulicResponse)]
        return fits([self._plain(start) for start in starts], part, fresh=1)[0]

    def _columns(self, one: Explanation, record: Record) -> Library:
        """Compute the columns of all trials about an explanation's response, with the initial effects."""
        bare = replace(one.model, effects=self.start, free=((),) * len(self.start))
        return Library.of(bare, record, self.classes)

    def _library(self, one: Explanation) -> Library:
        """Return the columns for all days, computed once for each kind of response."""
        name = one.model.reach.name
        if name not in self.libraries:
            self.report(0.2, f"{len(self.classes)} effects in the simulator")
            self.libraries[name] = self._columns(one, self.record)
        return self.libraries[name]

    def _promise(self, one: Explanation, part: Record) -> float:
        """Estimate an effect's largest gain [nats per day]: twice the linear one, since the noise shrinks."""
        if one.model.reach.name == "fir":  # no ground for effects
            return 0.0
        found = screened(one, self._columns(one, part), part)
        return 2.0 * found[0].gain / part.days if found else 0.0

    def _plain(self, reach: Response) -> Model:
        """Return a model of a response with the initial effects only."""
        record = self.record
        known = tuple(e for e in self.start if e.found_as not in LEVEL_NOISES)
        kind: NoiseKind = "wind" if any(e.found_as == "level noise" for e in self.start) else "plain"
        return Model(
            reach, None, record.usual_output, record.usual_flow, self.gauge_floor, known, ((),) * len(known),
            kind,
        )  # fmt: skip

    def _prior(self, parent: Explanation, more: int = 1) -> float:
        """Return the log prior of an explanation with more names and unknowns than `parent`."""
        return parent.log_prior + self.log_prior(more) - self.log_prior(0)

    def log_prior(self, parts: int) -> float:
        """Return the log prior of an explanation with so many names and unknowns."""
        # Each further one halves the prior; all names and unknowns of the library have the same.
        return -(parts + 1) * float(np.log(2.0)) - parts * float(np.log(len(self.classes) + UNKNOWNS))

    def score(self, one: Explanation) -> float:
        """Return the log density of the open days [nats]."""
        return float(one.density[self.opened].sum())

    def ordered(self) -> list[Explanation]:
        """Return the best explanation of each kind that may be extended, the most probable first."""
        first, opened, block = self.study().first, self.opened, self.dealt.block
        known = (one for one in self.pool if one.unknown != "dynamics")
        pool = leading([one for one in known if harmless(one, first, opened, block)], opened)
        pool.sort(key=self.score, reverse=True)  # for the order of those with no probability
        chances = ranked(pool, opened, block, None)
        return [pool[i] for i in np.argsort(-chances, kind="stable").tolist()]

    def lead(self) -> Explanation:
        """Return the most probable explanation likelier than its parent by something material."""
        # Immaterial effects can gain many nats if the response misses fronts, without reducing the error.
        # Beside one of these an unknown cause that gains nothing can be the first material one.
        study = self.study()

        def counts(one: Explanation) -> bool:
            parent = one.parent
            return parent is None or (
                study.score(one) > study.score(parent) and study.core(one) != study.core(parent)
            )

        return next(filter(counts, self.ordered()), study.first)

    def extend(self, parent: Explanation, early: bool = True) -> Explanation:
        """Add the extensions of `parent` by one effect or by an unknown flow or gauge to the pool.

        Returns the explanation that they extend: `parent`, or a better fit of the same; with `early` also one
        from the response of the first effect.
        """
        parent, latent = self._with_unknown(parent)
        if not parent.unknown:
            self.extended.add(tuple(sorted(parent.names)))
        record, library = self.record, self._library(parent)
        taken = set(parent.names)

        def able(effect: Effect) -> bool:
            return (effect.name not in taken or effect.repeatable) and taken.isdisjoint(effect.twins)

        found = [one for one in screened(parent, library, record) if able(one.effect)]
        more = [one for one in screened_again(parent, found, library, record) if able(one.effect)]
        tried = _worth_trying(found)
        tried += [one for one in _worth_trying(more) if all(one.kind != other.kind for other in tried)]
        dated = [one for one in self._dated(parent) if one.effect.name not in taken]
        first = self._grow(parent, [_near(one, record) for one in tried[:1]])
        if first and first[0] is not None:
            self._settle_failed(parent, tried[0], first[0])
        if early and (again := self.again(parent)) is not parent:
            return self.extend(again, early=False)  # all others begin at the response of the first one
        gains = [self.score(more) - self.score(parent) for more in first if more is not None]
        least = HOPE * min(tried[0].worth, *gains) if gains else 0.0
        tried = [one for one in tried[1:] if one.worth > least]
        wanted = [_near(one, record) for one in (*tried, *dated)]
        if not parent.unknown and parent.bonus is None:
            self._with_recurring(parent, found)
        gauge = [one for one in latent if one.unknown == "gauge"]
        for name, effect in self.classes.items():
            if name in taken or not effect.found_as:
                continue
            if effect.found_as in LEVEL_NOISES:
                wanted.append(Way(name, partial(with_noise, effect=effect, record=record, latent=gauge)))
            else:
                events = partial(with_events, effect=effect, kernels=library.kernels, record=record)
                wanted.append(Way(name, events))
        # Pulses that enter measure the noise of pulses that leave, which pay for them.
        leaves = any(events.kind.sign < 0 for events in parent.events)
        for way, made in zip(wanted, self._grow(parent, wanted), strict=True):
            if made is not None and self.classes[way.name].found_as == "recession" and not leaves:
                self._with_unknown_events(parent, PassingFlow)
            if made is not None and self.classes[way.name].found_as == "level noise":
                # An unknown gauge that is hardly likelier errs as wind makes it err.
                least = self.score(made) + LEAST
                self.pool = [one for one in self.pool if one not in gauge or self.score(one) > least]

        there = {effect.found_as for effect in self.classes.values()}
        for stranger in STRANGERS:
            if stranger.found_as not in there and stranger.acts_on(record.kind):
                self._with_unknown_events(parent, stranger, gauge)
        return parent

    def _with_unknown_events(
        self, parent: Explanation, effect: type[Effect], latent: Sequence[Explanation] = ()
    ) -> None:
        """Add events or waves of unknown cause, if any are found that the reach can carry."""
        prior = self._prior(parent)
        if effect.found_as in LEVEL_NOISES and parent.bonus is not None:
            return
        try:
            if effect.found_as in LEVEL_NOISES:
                made = with_noise(parent, effect, self.record, prior, latent)
            else:
                made = with_events(parent, effect, self._library(parent).kernels, self.record, prior)
        except RividError:
            return
        if made is not None:
            self.pool.append(self._scored(self._made_by(made, None)))

    def _dated(self, parent: Explanation) -> list[Candidate]:
        """Return candidates with the given dates and sizes; the prior is that of any other dates."""
        days, still, library = self.record.days, np.zeros(len(parent.sd)), self._library(parent)
        prior = -float(np.log(days * (days + 1) / 2))
        first = {trial.name: (trial, columns) for trial, columns in library.trials[::-1]}
        able = [effect for effect in self.dated if effect.name in first]
        return [candidate_of(effect, *first[effect.name], 0.0, prior, still, still) for effect in able]

    def _with_recurring(self, parent: Explanation, found: Sequence[Candidate]) -> None:
        """Add unknown flows that repeat every day, over the season and in the windows of the best candidates,
        and one with the period of the residual."""
        self.report(0.05, "an unknown flow that returns")
        windows: dict[tuple[dt.date, dt.date] | None, float] = {None: 0.0}
        for candidate in found[:WINDOWS]:
            windows.setdefault(candidate.effect.dates, candidate.log_prior)
        daily = RecurringFlow(waves=(0.0,) * 6)
        flows: list[tuple[Effect, float]] = [(replace(daily, dates=d), price) for d, price in windows.items()]
        counted = self.record.used & self.opened[:, None]
        seen = np.where(counted, parent.residual, np.nan)
        innovations = parent.noise.whiten(seen, activity=self.record.activity)
        slow = rhythm(innovations, counted, self.record.time)
        if slow is not None and not any(abs(slow.period - DAY / k) <= slow.resolution for k in (1, 2, 3)):
            flows.append((replace(daily, period=slow.period / HOUR), -float(np.log(slow.many))))
        prior = self._prior(parent, 2)  # the flow, and its shape

        def fit(flow: tuple[Effect, float]) -> Explanation | None:
            effect, price = flow
            model = replace(
                parent.model, noise_kind="flow", effects=(*parent.model.effects, effect),
                free=(*parent.model.free, ("waves",)),
            )  # fmt: skip
            return self._fitted(parent.extended(prior + price, model=model, unknown="flow"), parent)

        self.pool += [one for one in side_by_side(fit, flows) if one is not None]

    def _grow(self, parent: Explanation, wanted: Sequence[Way]) -> list[Explanation | None]:
        """Add extensions of `parent`; None for each that the reach cannot carry."""
        if wanted:
            self.report(0.2, "refitting with " + ", ".join(dict.fromkeys(way.name for way in wanted)))

        def grown(way: Way) -> Explanation | None:
            try:
                more = way.grow(parent, log_prior=self._prior(parent))
                more = None if more is None else swung(more, self.record)
            except RividError:
                return None
            return None if more is None else self._scored(self._made_by(more, way))

        made = side_by_side(grown, wanted)
        self.pool += [more for more in made if more is not None]
        return made

    def _settle_failed(self, parent: Explanation, candidate: Candidate, one: Explanation) -> None:
        """Settle the response with a candidate if its fit gained little of what its column promises."""
        # A response that is bent by what is missing can be at a maximum that no step leaves: a fit then gives
        # the effect up. Of the 21,769 nats of a clock 24 min late 1,784 were expected, and 88 gained.
        gain = self.score(one) - self.score(parent)
        if gain < RELIABLE * candidate.gain and not candidate.effect.stepwise:
            effects = *one.model.effects[:-1], candidate.make(1.0)
            again = replace(one, model=replace(one.model, effects=effects))
            self._settled(again, candidate.gain - gain)

    def _made_by(self, one: Explanation, way: Way | None) -> Explanation:
        """Return the explanation with its way, and the inflation of its scores along all columns."""
        block = self.dealt.block
        found = [self._library(one).scatter(one, self.record, block)]
        if way is not None and way.columns is not None:
            found.append(scatter_of(one, way.columns, self.record, block))
        return replace(one, inflation=max(found), way=way)

    def _nominal(self, model: Model) -> Response:
        """Return the nominal response of the kind of a model."""
        return next(reach for reach in self.responses if reach.name == model.reach.name)

    def _fitted(
        self, draft: Explanation, near: Explanation | None, fresh: int = 0, *, enough: float = ENOUGH,
        steps: int = STEPS,
    ) -> Explanation | None:  # fmt: skip
        """Fit a draft from the response of `near`, or from its own with new columns, and score it.

        Returns None if it cannot carry the flows of all days. The result is not yet in the pool.
        """
        model = draft.model if near is None else replace(draft.model, reach=near.model.reach)
        try:
            one = fitted(
                model, self.record, self.opened, draft=draft, start=near, fresh=fresh, enough=enough,
                steps=steps,
            )  # fmt: skip
        except RividError:
            return None
        return self._scored(one)

    def _better(self, one: Explanation, more: Explanation | None) -> Explanation:
        """Add `more`, if it could be fitted, to the pool; return the better of the two."""
        self.pool += [] if more is None else [more]
        return one if more is None or self.score(more) <= self.score(one) else more

    def add_rivals(self, lead: Explanation) -> None:
        """Add the effects that are confounded with the one that `lead` adds, with the same dates."""
        # A response biased by a change can hide its dates from one of them and show them to another.
        effect, parent = lead.added, lead.parent
        if effect is None or parent is None or effect.found_as:
            return
        best: dict[str, Candidate] = {}
        for one in screened(parent, self._library(parent), self.record, beside=effect):
            best.setdefault(one.effect.name, one)
        self._grow(parent, [_near(one, self.record) for one in best.values()])

    def polished(self, lead: Explanation) -> Explanation:
        """Refit `lead` and its rivals with columns about their own responses, and return the new lead.

        If this has another cause, or an unknown one, `lead` is refitted from its response, too.
        """
        # All rivals are refitted from the response of `lead`, which can raise one by 1,000 nats. Those that
        # would lead with the gain of `lead`, and those confounded with it, are refitted from their own too.
        if lead.added is None or lead.parent is None or not lead.count[0] > lead.parent.count[0]:
            return lead
        self.report(0.1, f"{lead.added.name} and its rivals from its response")
        (best,) = self._polished([self._settled(lead)], lead)
        least = min(2.0 * self.score(lead) - self.score(best), self.score(best)) - LEAST
        near = screened_instead(best, self._library(best), self.record)
        hope = HOPE * max((one.worth for one in near if one.effect.name == lead.added.name), default=0.0)
        able = {one.effect.name for one in near if one.worth > hope}
        rivals: dict[tuple[tuple[str, ...], bool], Explanation] = {}
        for one in sorted(self.pool, key=self.score):
            same = one.count == lead.count and one.unknown == lead.unknown and one.others == lead.others
            same = same and one.model.reach.name == lead.model.reach.name  # its columns are the same
            if not same or one.names == lead.names or one.way is None or one.added is None:
                continue
            if not near or one.added.found_as or one.added.name in able or alike(one, lead):
                rivals[one.names, one.added.dates is None] = one  # dates gain, and cost a prior
        better = self._polished(list(rivals.values()), best)
        self._polished([o for o in better if self.score(o) > least or alike(o, lead)])
        other = self.lead()
        if other.unknown or not set(other.names) <= set(lead.names):  # it must not lead by its response
            self._polished([best], other)
        return self.lead()

    def _settled(self, one: Explanation, lacking: float = 0.0) -> Explanation:
        """Return the better of an explanation and its refit from a response that settled with its effects.

        It is refitted only if that response is likelier on the days on which it settled, by their share of
        `lacking` [nats]: in five development seasons, six that were not gained 13 nats at most, of three that
        were one gained 151.
        """
        # The response of its parent may be biased by the missing effect, at a maximum that no step leaves.
        nominal = self._nominal(one.model)
        if one.added is None or not isinstance(nominal, HydraulicResponse):
            return one
        days = int(self.opened.sum())
        chosen = np.flatnonzero(self.opened)[_spread(days)]
        few = self.record.take(chosen)
        few = replace(few, output=few.output - one.coded[chosen])
        coarse = settled(replace(one.model, reach=_coarse(nominal), noise=None), few, 0)
        here = replace(coarse, reach=coarse.reach.with_parameters(vector_of(one.model.reach)))

        def likely(model: Model) -> float:
            left = np.where(few.used, residual_of(few, model.baseline(few)), np.nan)
            return float(one.noise.log_likelihood(left, few.activity).sum())

        try:
            if likely(here) >= likely(coarse) - lacking * len(chosen) / days:
                return one
        except RividError:  # on few cells the reach cannot carry the flows
            pass
        reach = one.model.reach.with_parameters(vector_of(coarse.reach))
        more = self._fitted(replace(one, model=replace(one.model, reach=reach, noise=None)), None, FRESH)
        if more is None or self.score(more) <= self.score(one):
            return one
        more = self._made_by(more, one.way)
        self.pool.append(more)
        return more

    def _polished(self, many: Sequence[Explanation], near: Explanation | None = None) -> list[Explanation]:
        """Refit explanations from the response of `near`, or their own; return the better of each pair.

        A refit from its own response replaces an explanation, which was scored with columns of where its fit
        began: in four seasons the scores were wrong by 3 to 520 nats with these.
        """
        made = side_by_side(partial(self._fitted_on, near=near), many)
        better = []
        for one, more in zip(many, made, strict=True):
            if more is None or near not in (None, one):
                better.append(self._better(one, more))
                continue
            more = self._made_by(more, one.way)
            kept = (o for o in self.pool if o is not one)
            self.pool = [replace(o, parent=more) if o.parent is one else o for o in kept] + [more]
            better.append(more)
        return better

    def _fitted_on(self, one: Explanation, near: Explanation | None) -> Explanation | None:
        """Refit an explanation as long as it can become the likeliest of all."""

        def enough(fit: Explanation) -> float:
            return max((max(map(self.score, self.pool)) - self.score(fit)) / FRESH, ENOUGH)

        if near in (None, one):
            return self._fitted(one, one, FRESH, enough=enough(one))
        more = self._fitted(one, near, enough=enough(one))
        if more is None:
            return None
        # New columns about the response of `near` are computed only if the fit is better with it, and could
        # reach the likeliest by as much again.
        gained = self.score(more) - self.score(one)
        able = gained > 0.0 and self.score(more) + gained > max(map(self.score, self.pool))
        return self._fitted(more, more, 1, enough=enough(more)) if able else more

    def shifted(self, lead: Explanation, near: bool = True) -> Explanation:
        """Move the dates and hours of the last effect of `lead` as long as that is likelier.

        They are searched again about its response and, with `near`, moved by a day or an hour.
        """
        # They were found with columns, which are valid near the parent's response only.
        effect, parent = lead.added, lead.parent
        if parent is None or effect is None or effect.found_as or not (effect.dates or effect.hours):
            return lead
        self.report(0.05, f"dates and hours of {effect.name}")
        library, open_days, tried = self._library(lead), np.flatnonzero(self.opened), set[Window]()

        def worth(one: Explanation) -> float:
            return TEMPER * self.score(one) + one.log_prior

        while True:
            effect = lead.model.effects[-1]
            at = effect.dates, effect.hours
            tried.add(at)
            again = screened_instead(lead, library, self.record, effect)[:1]
            found = [((o.effect.dates, o.effect.hours), self._prior(parent) + o.log_prior) for o in again]
            others = windows_near(at, self.record, open_days) if near else []
            best = lead
            for windows in (found, [(one, lead.log_prior) for one in others]):
                drafts = [
                    _with_last(lead, replace(effect, dates=one[0], hours=one[1]), prior)
                    for one, prior in windows if one not in tried
                ]  # fmt: skip
                tried |= {one for one, _ in windows}
                made = side_by_side(partial(self._fitted, near=lead), drafts)
                best = max((one for one in made if one is not None), key=worth, default=lead)
                if worth(best) > worth(lead) + HAIR:
                    break
            else:
                return lead
            self.pool.append(best)
            lead = best

    def likeliest(self, parent: Explanation) -> Explanation:
        """Return the likeliest extension of `parent` by an effect; `parent` if none gains :data:`LEAST`."""
        more = [one for one in self.pool if one.parent is parent and one.count[0] > parent.count[0]]
        lead = max(more, key=self.score, default=parent)
        return parent if self.score(lead) < self.score(parent) + LEAST else lead

    def probable(self, parent: Explanation) -> Explanation:
        """Return the most probable extension of `parent` that is material, or the likeliest one."""
        study, least = self.study(), self.score(parent) + LEAST
        more = (o for o in self.ordered() if o.parent is parent and o.count[0] > parent.count[0])
        able = (o for o in more if self.score(o) >= least and study.core(o) != study.core(parent))
        return next(able, self.likeliest(parent))

    def again(self, parent: Explanation) -> Explanation:
        """Refit `parent` from the response of its likeliest extension; return the better one."""
        # Otherwise an effect that leads the response out of a local optimum is credited with that gain.
        lead = self.likeliest(parent)
        if lead is parent or (parent, lead) in self.tried:
            return parent
        self.tried.append((parent, lead))
        self.report(0.05, "refitting without the effect that leads")
        one = self._fitted(replace(parent, way=None), lead, 2)
        if one is None:
            return parent
        self.pool.append(one)
        if self.score(one) < self.score(parent) + LEAST:
            return parent
        self.pool = [replace(o, parent=one) if o.parent is parent else o for o in self.pool]
        return one

    def contested(self, gain: float) -> bool:
        """Return whether the second best explanation would lead with a gain [nats]."""
        known = [one for one in self.pool if one.unknown != "dynamics"]
        *_, second, first = sorted([-np.inf, *map(self.score, leading(known, self.opened))])
        return bool(second + gain + LEAST > first)

    def level_rivals(self, lead: Explanation) -> None:
        """Extend the rivals of the parent of `lead` by the same effect, so that twins stay comparable."""
        # Confounded effects stay rivals however far one is ahead, since a further effect added to one alone
        # would increase its lead. The same holds for an unknown flow or gauge.
        latent = lead.unknown if lead.added is None and lead.unknown != "dynamics" else ""
        if lead.parent is None or not latent and lead.way is None:
            return
        count, opened = len(lead.parent.names), self.opened
        before = leading([one for one in self.pool if len(one.names) <= count], opened)
        chances = ranked(before, opened, self.dealt.block, None).tolist()
        for rival, p in zip(before, chances, strict=True):
            others = set(rival.names)
            same = rival.model.reach.name == lead.model.reach.name  # of another response the columns differ
            if not same or len(others) != count or others == set(lead.parent.names):
                continue
            if p < 1.0 - ALONE and not alike(rival, lead.parent):
                continue
            if latent and not rival.unknown:
                self._latent(rival, latent)
            elif not latent and lead.way is not None and lead.way.name not in others:
                self._grow(rival, [lead.way])

    def level_twins(self) -> None:
        """Refit what is confounded with a probable explanation, or its parents, from its response.

        A round that extends one of two twins alone refits its response, which can be worth tens of nats. A
        twin with other dates, sizes or noise need not come near from there: it is tried with these, too.
        """
        before = leading(self.pool, self.opened)
        chances = ranked(before, self.opened, self.dealt.block, None).tolist()
        likely = [one for one, p in zip(before, chances, strict=True) if p >= 1.0 - ALONE]
        for one in likely:  # and all that they extend
            likely += [one.parent] if one.parent is not None and one.parent not in likely else []
        for one in sorted(likely, key=lambda o: len(o.names)):
            same = self._twins(one)
            twins = [_as_twin(one, one, o, one.parent) for o in same]
            if (parent := one.parent) is not None:
                twins += [_as_twin(one, parent, o, o) for o in self._twins(parent)]
            self._polished([*same, *(o for o in twins if o is not None)], one)
        # Another maximum of the response can be worth more than the choice: rivals settle as the lead did.
        lead = self.lead()
        if lead.parent is not None:
            least = 0.5 * (self.score(lead) + self.score(lead.parent))
            side_by_side(self._settled, [o for o in self._twins(lead) if self.score(o) > least])

    def _twins(self, one: Explanation) -> list[Explanation]:
        """Return what is confounded with an explanation and has the same response."""
        kind = one.count, one.unknown, one.model.reach.name
        pool = leading(self.pool, self.opened)
        return [o for o in pool if (o.count, o.unknown, o.model.reach.name) == kind and alike(o, one)]

    def varied(self, lead: Explanation) -> Explanation:
        """Return `lead` with a size of its last effect that varies with the date, if that predicts better."""
        effect = lead.added
        if effect is None or lead.others or not effect.varies_with_date or effect.dates is None:
            return lead
        key = effect.varies_with_date
        days = (effect.dates[1] - effect.dates[0]).days + 1
        best = lead
        for knots in sorted({min(days // length + 1, MOST_KNOTS) for length in DAYS_A_KNOT}):
            if knots < 2 or isinstance(getattr(effect, key), tuple):
                continue
            self.report(0.05, f"refitting with a course of {effect.name}")
            sizes = effect.with_values(**{key: (float(getattr(effect, key)),) * knots})
            draft = replace(_with_last(lead, sizes, lead.log_prior), way=None)
            best = self._better(best, self._fitted(draft, lead))
        return best

    def _with_unknown(self, parent: Explanation) -> tuple[Explanation, list[Explanation]]:
        """Add an unknown flow and an unknown gauge; refit the parent from their response if it is better."""
        if parent.unknown or parent.bonus is not None:  # beside a seiche no noise is fitted
            return parent, []
        self.report(0.1, "an unknown flow, an unknown gauge")
        # the output of a river is a flow
        kinds: tuple[Latent, ...] = ("flow",) if self.record.kind == "river" else ("flow", "gauge")
        made = [self._latent(parent, kind) for kind in kinds]
        found = [one for one in made if one is not None]
        best = max(found, key=self.score, default=parent)
        if self.score(best) <= self.score(parent):
            return parent, found
        return self._better(parent, self._fitted(replace(parent, way=None), best)), found

    def _latent(self, parent: Explanation, kind: Latent) -> Explanation | None:
        """Add `parent` with an unknown flow or gauge; None if the reach cannot carry the flows."""
        model = replace(parent.model, noise_kind=kind)
        one = self._fitted(parent.extended(self._prior(parent), model=model, unknown=kind), parent)
        if one is not None:
            self.pool.append(one)
        return one

    def study(self) -> Study:
        """Return the explanations found."""
        pool, notes = tuple(self.pool), tuple(self.notes)
        return Study(self.record, self.dealt, pool, notes, self.start, self.extended, without=self.without)


def _with_last(one: Explanation, effect: Effect, log_prior: float) -> Explanation:
    """Return an explanation with another last effect, not fitted."""
    effects = *one.model.effects[:-1], effect
    return replace(one, model=replace(one.model, effects=effects), log_prior=log_prior)


def _as_twin(
    one: Explanation, other: Explanation, twin: Explanation, parent: Explanation | None
) -> Explanation | None:
    """Return `one`, as an extension of `parent`, with an effect of `twin` in place of that of `other`.

    The effect gets the dates of the one that it replaces, and as many sizes. None if the result is `twin`, if
    one of the two is not in the simulator, if `parent` has the one replaced, or if needed dates are missing.
    """
    mine, its = difference(other, twin) or (None, None)
    here = [i for i, e in enumerate(one.model.effects) if mine is not None and e.name == mine.name]
    if its not in twin.model.effects or len(here) != 1 or parent is None or not its.windowed:
        return None
    mine = one.model.effects[here[0]]
    if mine.name in parent.names or its.needs_dates and mine.dates is None:
        return None
    key, many = its.varies_with_date, np.size(getattr(mine, mine.varies_with_date or "name"))
    sizes: dict[str, Any] = {}
    if key and np.size(getattr(its, key)) != many:
        mean = float(np.mean(getattr(its, key)))
        sizes = {key: mean if many == 1 else (mean,) * many}
    effects, free = [*one.model.effects], [*one.model.free]
    effects[here[0]] = replace(its, dates=mine.dates, **sizes)
    free[here[0]] = twin.model.free[twin.model.effects.index(its)]
    model = replace(one.model, effects=tuple(effects), free=tuple(free))
    if (model.effects, model.noise_kind) == (twin.model.effects, twin.model.noise_kind):
        return None
    return replace(one, model=model, parent=parent, way=None)


UNKNOWNS = 2  # an unknown flow and an unknown gauge count as names in the prior


def _spread(days: int) -> Ints:
    """Return the days on which a response settles, evenly spaced."""
    return np.unique(np.linspace(0, days - 1, SETTLING).astype(int))


def _coarse(reach: Response) -> Response:
    """Return the response on :data:`FEW_CELLS`."""
    return replace(reach, cells=FEW_CELLS) if isinstance(reach, HydraulicResponse) else reach


def _able(nominal: Response, reach: Response, record: Record) -> Response:
    """Return `reach`, moved towards the nominal response until it carries all days."""
    here, there = vector_of(nominal), vector_of(reach)
    for way in (1.0, 0.5, 0.25):
        between = reach.with_parameters(here + way * (there - here))
        try:
            between.baseline(record)
        except RividError:
            continue
        return between
    return nominal


def _worth_trying(found: Sequence[Candidate]) -> list[Candidate]:
    """Return the best candidate of each of the first names, and the second one if it is nearly as good."""
    tried: dict[str, list[Candidate]] = {}
    for one in found:
        same = tried.get(one.effect.name, [])
        if one.worth < LEAST or same and one.worth < SECOND * same[0].worth:
            continue
        if not same and len(tried) == TRIED:
            break
        tried.setdefault(one.effect.name, []).append(one)
    return [one for same in tried.values() for one in same]
