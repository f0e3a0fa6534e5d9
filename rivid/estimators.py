"""The estimators: a record of each, and the function that prepares it for a configuration.

The command line lists the estimators in its help, so nothing heavy is imported at the top of this module.
A new estimator is one record, passed to :func:`register`.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import dataclass, fields
from functools import partial
from typing import TYPE_CHECKING, Any

if TYPE_CHECKING:
    import numpy as np
    from numpy.typing import NDArray

    from rivid.config import Config
    from rivid.core.fir import FirResult
    from rivid.core.posterior.daily import PosteriorResult
    from rivid.core.posterior.river import RiverPosterior
    from rivid.core.search import SearchResult
    from rivid.core.settings import PosteriorSettings, RiverSettings
    from rivid.types import Bools, Floats, Strings


@dataclass(frozen=True)
class Days:
    """Data sets of one length, as deviations from their first samples."""

    u: Floats  #: inflow [m3/s], (days, N)
    y: Floats  #: output [m for a level, m3/s for a discharge], (days, N)
    o: Floats | None  #: outflow [m3/s], (days, N); None where it is not logged
    base: Floats  #: inflow at the first sample [m3/s], (days,): celerity depends on it

    @classmethod
    def of(cls, inflow: Floats, output: Floats, outflow: Floats | None, min_motion: float) -> Days:
        """Deviations of logged series, each of shape (days, N).

        An inflow with a range below `min_motion` of its largest value is rounding noise: u is set to 0.
        """
        import numpy as np

        u = inflow - inflow[:, :1]
        u[np.ptp(u, axis=1) < min_motion * np.abs(inflow).max(axis=1)] = 0.0
        o = None if outflow is None else outflow - outflow[:, :1]
        return cls(u, output - output[:, :1], o, inflow[:, 0])


@dataclass(frozen=True)
class Answer:
    """The results of an estimator for a batch of days; None for a quantity that it does not estimate.

    Arrays have shape (days,) where no other is given; alpha, variances, condition, iterations and prior_only
    are those of :class:`rivid.core.fir.JmapResult`.
    """

    status: Strings  #: "ok", "degenerate" or "unidentifiable"
    delay: Floats | None = None  #: d [samples]; NaN on a day without one
    candidates: NDArray[np.intp] | None = None  #: the delays tried [samples], (K,)
    criterion: Floats | None = None  #: minimised over the delay, (days, K)
    curve: Floats | None = None  #: stored: criterion, CUSUM's g at lag d + 1, or probability; (days, K)
    fir: Floats | None = None  #: h [output unit per m3/s], (days, M)
    alpha: Floats | None = None
    noise_variance: Floats | None = None
    roughness_variance: Floats | None = None
    condition: Floats | None = None
    iterations: NDArray[np.intp] | None = None
    prior_only: Bools | None = None
    reason: Strings | None = None  #: why a day has no estimate; empty where u and y show it (constant)
    fir_sd: Floats | None = None  #: standard deviation of h, (days, M)
    travel: Floats | None = None  #: travel time with its fraction, of a river t50 [samples]
    half: Floats | None = None  #: the same with the half time of the gauge's lag [samples]
    probability: Floats | None = None  #: that the likeliest delay is right; NaN without probabilities
    delay_low: Floats | None = None  #: ends of the smallest set of delays with a probability of 90 %
    delay_high: Floats | None = None
    outside: Bools | None = None  #: the delay lies beyond the candidates


@dataclass(frozen=True)
class Prepared:
    """An estimator with the settings of a configuration."""

    estimate: Callable[[Days], Answer]
    min_samples: int  # shortest data set
    needed_for: str  # what needs that length
    key: str  # key of the configuration that reduces it
    max_iterations: int | None = None  # iterations after which the estimator stops


@dataclass(frozen=True)
class Estimator:
    """The properties of an estimator, independent of a configuration."""

    name: str  #: as in the configuration and the tables
    words: str  #: what it is, for titles and the report
    prepare: Callable[[Config], Prepared]  #: raises ConfigError for settings that contradict each other
    table: str = "jmap"  #: table of its settings; a change of an unused table leaves results valid
    reaches: tuple[str, ...] = ("pool", "river")  #: kinds of reach that it has equations for
    needs_outflow: bool = False  #: the outflow must be logged
    has_delay: bool = True
    has_fir: bool = True  #: it estimates an impulse response
    has_probability: bool = False  #: it estimates the probability of every delay
    checks_data: bool = False  #: it reports whether the data alone select the delay (`prior_only`)
    rayleigh: bool = False  #: it weighs the delay with the Rayleigh prior (26)
    degenerates: bool = False  #: by construction (section V); such days need no warning
    #: The message of a row notes a delay at the first or last candidate. Of other estimators such days are
    #: rare, and the column `at_bound` marks them.
    notes_bound: bool = False
    method: str = "JMAP"  #: name in captions that describe how it finds a jump of the response
    uniform: bool = False  #: as those with `rayleigh`, with a uniform prior: the report compares their delays
    #: The highest rank represents a record where several estimators have a delay, or a river's t50; of equal
    #: ranks of delays, one with a measure of its reliability.
    delay_rank: int = 0
    t50_rank: int = 0

    @property
    def represents(self) -> tuple[int, bool]:
        """Order in which estimators represent the delays of a record."""
        return self.delay_rank, not self.unjudged

    @property
    def unchecked(self) -> bool:
        """It has a delay and does not report whether the data select it."""
        return self.has_delay and not self.checks_data

    @property
    def unjudged(self) -> bool:
        """It has a delay without a measure of its reliability."""
        return self.unchecked and not self.has_probability


class _Registry(dict[str, Estimator]):
    """Estimators by name. A name from other software's results gets a record of its bare name."""

    def __missing__(self, name: str) -> Estimator:
        def prepare(config: Config) -> Prepared:
            raise KeyError(name)

        return Estimator(name, name, prepare, checks_data=True)


def register(estimator: Estimator) -> None:
    """Add an estimator; ValueError for a name that is taken."""
    if estimator.name in ESTIMATORS:
        raise ValueError(f"an estimator named {estimator.name!r} exists already: choose another name")
    ESTIMATORS[estimator.name] = estimator


def build(config: Config) -> dict[str, Prepared]:
    """Prepare the estimators of a configuration, by name and in its order.

    ConfigError where settings contradict each other.
    """
    return {name: ESTIMATORS[name].prepare(config) for name in config.run.estimators}


def _fir_fit(name: str, config: Config) -> Callable[[Days], FirResult]:
    """ML (17) or MAP (22), with the order and alpha of `[jmap]`."""
    from rivid.core.fir import map_fir

    s, alpha = config.jmap_settings(), 0.0 if name == "ml" else config.jmap.alpha
    return lambda days: map_fir(days.u, days.y, s.order, alpha, free_start=s.free_start)


def _answer(found: FirResult | SearchResult, **more: Any) -> Answer:
    """The quantities of a core result by their names, and `more`."""
    shared = {f.name: getattr(found, f.name) for f in fields(Answer) if hasattr(found, f.name)}
    return Answer(**shared | more)


def _with_fir(estimate: Callable[[Days], Answer], order: int, max_iterations: int | None = None) -> Prepared:
    return Prepared(estimate, order + 1, f"an FIR of order {order}", "[jmap] order", max_iterations)


def _fir(name: str, config: Config) -> Prepared:
    """The impulse response without a delay."""
    fit = _fir_fit(name, config)
    return _with_fir(lambda days: _answer(fit(days)), config.jmap_settings().order)


def _cusum(name: str, config: Config) -> Prepared:
    """A change in the mean of the ML or the MAP response."""
    import numpy as np

    from rivid.core.cusum import cusum

    settings, fit = config.cusum_settings(), _fir_fit(name, config)
    candidates = np.arange(settings.d_min, settings.d_max + 1)

    def estimate(days: Days) -> Answer:
        fir = fit(days)
        found = cusum(fir.fir, settings)
        return _answer(
            fir, status=found.status, delay=found.delay, candidates=candidates,
            curve=found.decision[:, candidates + 1],
            reason=np.where(fir.status == "unidentifiable", "", found.reason),
        )  # fmt: skip

    return _with_fir(estimate, config.jmap_settings().order)


def _jmap(config: Config, **changes: Any) -> Prepared:
    """Delay and response together (Tables V and VI), with the changes to the settings of `[jmap]`."""
    from rivid.core.fir import jmap

    settings = config.jmap_settings(**changes)

    def estimate(days: Days) -> Answer:
        found = jmap(days.u, days.y, settings)
        return _answer(found, curve=found.criterion)

    return _with_fir(estimate, settings.order, settings.max_iterations)


def _search(name: str, config: Config) -> Prepared:
    """Table IV: least squares in (8) or in (10) for every delay."""
    from rivid.core.search import DIRECT_PARAMETERS, INDIRECT_PARAMETERS, direct, indirect

    settings = config.search_settings()
    n_parameters = len(DIRECT_PARAMETERS if name == "direct" else INDIRECT_PARAMETERS)

    def estimate(days: Days) -> Answer:
        if name == "direct":
            assert days.o is not None, "the configuration refuses direct where the outflow is not logged"
            found = direct(days.u, days.o, days.y, settings)
        else:
            found = indirect(days.u, days.y, settings)
        return _answer(found, curve=found.criterion)

    min_samples = settings.d_max + 2 + n_parameters
    return Prepared(estimate, min_samples, f"d_max = {settings.d_max}", _key(config, "search", "d_max"))


def _posterior(config: Config) -> Prepared:
    """The probability of every delay, with the equations of a pool or of a river."""
    key = _key(config, "posterior", "d_max")
    if config.reach.kind == "river":
        from rivid.core.posterior.river import LEAST_ROWS, posterior_river

        river = config.river_settings()

        def estimate_river(days: Days) -> Answer:
            found = posterior_river(days.u + days.base[:, None], days.y, river)
            return _of_posterior(found, river, config)

        # the first samples of each window are the history of the others
        return Prepared(estimate_river, river.warm + LEAST_ROWS, f"d_max = {river.d_max}", key)

    from rivid.core.posterior.blind import n_least, posterior_blind
    from rivid.core.posterior.daily import posterior
    from rivid.core.settings import GUARD

    settings = config.posterior_settings()

    def estimate(days: Days) -> Answer:
        if days.o is None:
            found = posterior_blind(days.u, days.y, settings)
        else:
            found = posterior(days.u, days.y, days.o, settings)
        return _of_posterior(found, settings, config)

    min_samples = 3 * (settings.d_max + GUARD + 4)
    if not config.input.u_Qo:
        min_samples = max(min_samples, n_least(settings))
    return Prepared(estimate, min_samples, f"d_max = {settings.d_max}", key)


def _of_posterior(
    found: PosteriorResult | RiverPosterior, s: PosteriorSettings | RiverSettings, config: Config
) -> Answer:
    """A day without a front, or with a delay outside the candidates, has no probabilities."""
    import numpy as np

    from rivid.core.hydraulics import SLOW

    outside = found.status == "at_bound"
    below = found.beyond[:, 0] > found.beyond[:, 1]
    known = np.isfinite(found.probability).all(axis=1) & (found.link >= 0.5) & ~outside
    ok = found.status == "ok"
    candidates = found.candidates
    too_short = (
        f"the delay is shorter than d_min = {s.d_min}: lower {_key(config, 'posterior', 'd_min')}"
        if s.d_min > 1
        else "the delay is about one sample or less (shorter ones, in the log and in [reach] sample_time, "
        "would show it)"
    )
    too_long = f"the delay is longer than d_max = {s.d_max}: raise {_key(config, 'posterior', 'd_max')}"
    given, T_s = config.input.model_dump(include={"stamp", "hold", "interval"}), config.reach.sample_time
    _, short = stamp_doubt(given, T_s, river=config.reach.kind == "river")
    if short and s.d_min == 1:
        too_short += f", or up to {short:g} s longer if u_Qi is stamped at the end of its interval"
        too_short += " ([input.stamp])"
    waves = config.reach.waves
    if waves and (s.d_max - 1) * T_s > SLOW * waves[1]:
        too_long += (
            f", or check length, width and depth in [reach]: by these a wave takes {waves[1] / 60:.3g} min "
            "or less"
        )
    unsure: Strings | str = found.message
    if (least := getattr(s, "answer_above", None)) is not None:  # a river's t50 needs a narrow band instead
        unsure = f"the likeliest delay is right with a probability below {least:g} ([posterior] answer_above)"
    return Answer(
        status=np.where(ok, "ok", "unidentifiable"),
        delay=found.delay,
        candidates=candidates,
        curve=np.where(known[:, None], found.probability, np.nan),
        fir=found.fir,
        fir_sd=found.fir_sd,
        reason=np.select(
            [outside & below, outside, known & ~ok], [too_short, too_long, unsure], found.message
        ),
        travel=np.where(ok, found.place, np.nan),
        half=np.where(ok, found.half, np.nan),
        probability=np.where(known, found.right, np.nan),
        delay_low=np.where(known, candidates[np.argmax(found.in_set, axis=1)], np.nan),
        delay_high=np.where(known, candidates[::-1][np.argmax(found.in_set[:, ::-1], axis=1)], np.nan),
        outside=outside,
    )


def stamp_doubt(given: Mapping[str, Any], sample_time: float, *, river: bool) -> tuple[float, float]:
    """Return how much travel times may be too long, and too short [s], where stamps are not declared.

    A column without `[input.stamp]` is read as instants. If it is stamped at the end of its interval
    instead, its true time is one interval earlier: a travel time is then too long if it is the output, too
    short if it is the inflow. `given` are the keys of `[input]`.
    """
    long, short = (
        0.0
        if name in given.get("stamp", {}) or name in given.get("hold", {})
        else float(given.get("interval", {}).get(name, sample_time))
        for name in ("Q_L" if river else "h_L", "u_Qi")
    )
    return long, short


def _key(config: Config, table: str, name: str) -> str:
    """The key that `name` is taken from: the table's own, or that of `[jmap]`."""
    return f"[{'jmap' if getattr(getattr(config, table), name) is None else table}] {name}"


_of_jmap = partial(Estimator, checks_data=True)
_of_search = partial(Estimator, table="search", reaches=("pool",), has_fir=False, notes_bound=True)
_of_cusum = partial(Estimator, table="cusum", notes_bound=True, method="CUSUM")

ESTIMATORS = _Registry(
    (one.name, one)
    for one in (
        Estimator("ml", "maximum likelihood (17)", partial(_fir, "ml"), has_delay=False, t50_rank=1),
        Estimator("map", "smooth MAP (22)", partial(_fir, "map"), has_delay=False, t50_rank=3),
        _of_jmap("jmap", "JMAP, Rayleigh prior (Table VI)", _jmap, rayleigh=True, delay_rank=1, t50_rank=2),
        _of_jmap(
            "jmap-uniform", "JMAP, uniform prior, fixed alpha (Table V)",
            partial(_jmap, prior="uniform", fixed_alpha=True), uniform=True,
        ),
        _of_jmap(
            "jmap-uniform-estimated", "JMAP, uniform prior, alpha estimated",
            partial(_jmap, prior="uniform"), uniform=True,
        ),
        _of_jmap(
            "jmap-degenerate", "JMAP without the inverse-gamma prior", partial(_jmap, inverse_gamma=False),
            rayleigh=True, degenerates=True,
        ),
        _of_search(
            "direct", "direct approach, least squares in (8) (Table IV)", partial(_search, "direct"),
            needs_outflow=True,
        ),
        _of_search(
            "indirect", "indirect approach, least squares in (10) (Table IV)", partial(_search, "indirect")
        ),
        _of_cusum("cusum-ml", "CUSUM on the ML response", partial(_cusum, "ml")),
        _of_cusum("cusum-map", "CUSUM on the MAP response", partial(_cusum, "map")),
        Estimator(
            "posterior", "probability of each delay, averaged over equations", _posterior,
            table="posterior", has_probability=True, delay_rank=2, t50_rank=4,
        ),
    )
)  # fmt: skip
"""The estimators that `rivid run` offers, by name, in the order of its help."""
