"""Estimates of a day or of arrays: the paper's estimator, and the probability of each delay."""

import datetime as dt
from abc import abstractmethod
from collections import Counter
from dataclasses import dataclass
from typing import TYPE_CHECKING, Any

import numpy as np
from numpy.typing import ArrayLike, NDArray
from threadpoolctl import threadpool_limits

from rivid.api.day import Day
from rivid.api.inputs import GivenConfig, Result, as_config
from rivid.config import Config, parse
from rivid.core import fir, search
from rivid.core.cusum import CusumResult
from rivid.core.cusum import cusum as cusum_of
from rivid.core.fir import FirResult, JmapResult, as_days
from rivid.core.fir import jmap as jmap_of_arrays
from rivid.core.search import SearchResult
from rivid.core.settings import DEFAULT_ALPHA, CusumSettings, JmapSettings, SearchSettings, named
from rivid.errors import ConfigError, RividError
from rivid.estimators import Days, build
from rivid.text import probability, samples, travel
from rivid.types import Floats, Strings

if TYPE_CHECKING:
    from rivid.plots.library import Panel


class _DelayResult(Result):
    """A delay with its response, for one day or (a leading axis) for many."""

    _heading: str
    status: Strings
    delay: Floats
    candidates: NDArray[np.intp]
    fir: Floats
    output_unit: str
    date: dt.date | None
    _rounded = False  # whether d is a t50 between d - 1/2 and d + 1/2 samples, not a time from d to d + 1

    @abstractmethod
    def _day_facts(self) -> str: ...

    @abstractmethod
    def _curve(self) -> tuple[str, Floats, Floats | None, str]:
        """Name and values of what each candidate has, standard deviation of the FIR, and why it has none."""

    def _facts(self) -> str:
        return describe_days(self.status, self.delay) if np.ndim(self.delay) else self._day_facts()

    def _title(self) -> str:
        return self._heading + (f", {self.date}" if self.date else "")

    def _panels(self) -> "list[Panel]":
        from rivid.plots import library

        if np.ndim(self.delay):
            return [(2.9, lambda axes: library.responses(axes, self.fir, self.delay))]
        name, values, sd, reason = self._curve()
        d, order = float(self.delay), len(self.fir)
        curve = self.candidates, values, d, order, name, reason, self._rounded
        return [
            (1.9, lambda axes: library.response(axes, self.fir, sd, d, self.output_unit, self._rounded)),
            (1.2, lambda axes: library.by_delay(axes, *curve)),
        ]


@dataclass(frozen=True, repr=False, eq=False)
class DelayEstimate(_DelayResult, JmapResult):
    """The result of :func:`jmap`: a :class:`rivid.core.fir.JmapResult` with its origin.

    Of a :class:`Day` it holds T_s [s], the unit of the output ("m" or "m3/s") and the date; None, "" and None
    if only arrays were given.
    """

    sample_time: float | None = None
    output_unit: str = ""
    date: dt.date | None = None

    _heading = "Delay and impulse response"

    def _day_facts(self) -> str:
        doubt = ", the prior's" if bool(self.prior_only) else ""
        return (
            f"{describe_delay(float(self.delay), self.sample_time)}, {self.status}{doubt}; "
            f"alpha {float(self.alpha):.2g}, condition {float(self.condition):.2g}"
        )

    def _curve(self) -> tuple[str, Floats, Floats | None, str]:
        return "criterion", self.criterion, None, ""


@dataclass(frozen=True, repr=False, eq=False)
class DelayProbabilities(_DelayResult):
    """The result of :func:`posterior`; with a leading axis of days, or none for a single day.

    Attributes
    ----------
    status : ndarray of str, shape (days,)
        "ok" or "unidentifiable".
    delay : ndarray, shape (days,)
        The most probable delay [samples], of a river t50 rounded; NaN unless the status is "ok".
    probability : ndarray, shape (days,)
        Probability that this delay is right; NaN on a day without probabilities.
    delay_low, delay_high : ndarray, shape (days,)
        Ends of the smallest set of delays with 90 % probability [samples].
    travel : ndarray, shape (days,)
        The travel time with its fraction, of a river t50 [samples]; NaN unless the status is "ok".
    candidates : ndarray of int, shape (K,)
        The delays tried [samples].
    probabilities : ndarray, shape (days, K)
        p(d | y).
    fir, fir_sd : ndarray, shape (days, M)
        Response of the output to the inflow and its standard deviation [output unit per m3/s].
    reason : ndarray of str, shape (days,)
        Why a day has no answer; empty otherwise.

    Notes
    -----
    Sample time, unit and date are as in :class:`DelayEstimate`; the unit is "m" if only arrays were given.
    """

    status: Strings
    delay: Floats
    probability: Floats
    delay_low: Floats
    delay_high: Floats
    travel: Floats
    candidates: NDArray[np.intp]
    probabilities: Floats
    fir: Floats
    fir_sd: Floats
    reason: Strings
    sample_time: float | None = None
    output_unit: str = "m"
    date: dt.date | None = None

    _heading = "Probability of each delay"

    @property
    def _rounded(self) -> bool:  # type: ignore[override]
        return self.output_unit != "m"

    def _day_facts(self) -> str:
        if str(self.status) != "ok":
            return f"{self.status}: {self.reason}"
        return (
            f"{describe_delay(float(self.delay), self.sample_time, self._rounded)}, right with "
            f"{probability(float(self.probability))}; 90 % within {float(self.delay_low):.0f} to "
            f"{float(self.delay_high):.0f}"
        )

    def _curve(self) -> tuple[str, Floats, Floats | None, str]:
        return "probability", self.probabilities, self.fir_sd, str(self.reason)


def jmap(
    u: ArrayLike | Day,
    y: ArrayLike | None = None,
    settings: JmapSettings | None = None,
    *,
    trace: bool = False,
    **changes: Any,
) -> DelayEstimate:
    """Estimate delay and impulse response of a day, or of many, by the paper's estimator (Table VI).

    Parameters
    ----------
    u : Day, or array_like of shape (N,) or (days, N)
        A day; or the inflow [m3/s].
    y : array_like, same shape
        Output [m or m3/s]; not with a day. Of both series the deviations from their first samples count.
    settings : JmapSettings, optional
        Default: those of the day's configuration, or the paper's.
    trace : bool
        Whether the variances of every iteration are kept.
    **changes
        Single settings to change, ``jmap(day, prior="uniform", alpha=1e4)`` for Table V; `M` and `sigma_d`
        are `order` and `delay_scale`.

    Raises
    ------
    RividError
        For shapes that do not fit, values that are not finite, or too few samples.

    Notes
    -----
    Source: Tables V and VI; see :func:`rivid.core.fir.jmap`.

    Examples
    --------
    >>> from rivid import read_day
    >>> day = read_day("sample_data/basse_isere_csv/2008-03-14.csv", config="configs/basse_isere.toml")
    >>> jmap(day).delay
    np.float64(8.0)
    """
    about: dict[str, Any] = {}
    if isinstance(u, Day):
        settings = settings or u.config.jmap_settings()
        about = {"sample_time": u.sample_time, "output_unit": u.config.reach.output_unit, "date": u.date}
    inflow, output = _series("jmap", u, y=y)
    found = jmap_of_arrays(inflow, output, settings, trace=trace, **changes)
    return DelayEstimate(**vars(found), **about)


def _series(function: str, u: ArrayLike | Day, **others: ArrayLike | None) -> list[Floats]:
    """Deviations of u and others (names as the function has them) from their first samples.

    ConfigError where a day comes with other series, or arrays without them.
    """
    form = f"{function}(day) or {function}({', '.join(('u', *others))})"
    if isinstance(u, Day):
        if any(value is not None for value in others.values()):
            raise ConfigError(f"{function}: a day has its own series: expected {form}")
        others = {name: getattr(u, name) for name in others}
        if lacking := [name for name, value in others.items() if value is None]:
            raise ConfigError(f"{function}(day): the day has no {lacking[0]}: expected a log of it")
        u = u.u
    if lacking := [name for name, value in others.items() if value is None]:
        raise ConfigError(f"{function}: {lacking[0]} is missing: expected {form}")
    arrays = [np.asarray(value, float) for value in (u, *others.values())]
    return [a - a[..., :1] if a.ndim and a.shape[-1] else a for a in arrays]


def ml(u: ArrayLike | Day, y: ArrayLike | None = None, order: int | None = None, **changes: Any) -> FirResult:
    """Estimate the impulse response of a day, or of many, by maximum likelihood (17).

    Parameters
    ----------
    u, y
        As for :func:`jmap`.
    order : int, optional
        M [samples]; default: that of the day's configuration, or 30.
    **changes
        `M` for `order`, and `free_start`; see :class:`rivid.JmapSettings`.
    """
    given = _fir_settings(u, order, changes)
    inflow, output = _series("ml", u, y=y)
    return fir.ml(inflow, output, **given)


def map_fir(
    u: ArrayLike | Day,
    y: ArrayLike | None = None,
    order: int | None = None,
    alpha: float | None = None,
    **changes: Any,
) -> FirResult:
    """Estimate the impulse response of a day, or of many, a posteriori with second differences (22).

    Parameters
    ----------
    u, y, order, **changes
        As for :func:`ml`.
    alpha : float, optional
        sigma_w2 / sigma_hD2 [(m3/s)^2]; default: that of the day's configuration, or 10,000.
    """
    given = _fir_settings(u, order, changes)
    usual = u.config.jmap.alpha if isinstance(u, Day) else DEFAULT_ALPHA
    inflow, output = _series("map_fir", u, y=y)
    return fir.map_fir(inflow, output, alpha=usual if alpha is None else alpha, **given)


def _fir_settings(u: ArrayLike | Day, order: int | None, changes: dict[str, Any]) -> dict[str, Any]:
    """Order and start of an FIR: as given, else the day's."""
    usual = u.config.jmap_settings() if isinstance(u, Day) else JmapSettings()
    given = named(changes | ({} if order is None else {"order": order}), ["order", "free_start"])
    return {"order": usual.order, "free_start": usual.free_start} | given


def direct(
    u: ArrayLike | Day,
    o: ArrayLike | None = None,
    y: ArrayLike | None = None,
    settings: SearchSettings | None = None,
    **changes: Any,
) -> SearchResult:
    """Estimate the delay by search in (8), Table IV: as if the outflow did not depend on the level.

    Parameters
    ----------
    u : Day, or array_like of shape (N,) or (days, N)
        A day; or the inflow [m3/s].
    o, y : array_like, same shape
        Outflow [m3/s] and level [m]; not with a day.
    settings : SearchSettings, optional
        Default: those of the day's configuration, or the paper's.
    **changes
        Single settings to change, ``direct(day, d_max=20)``.
    """
    settings = settings or (u.config.search_settings() if isinstance(u, Day) else None)
    inflow, outflow, level = _series("direct", u, o=o, y=y)
    return search.direct(inflow, outflow, level, settings, **changes)


def indirect(
    u: ArrayLike | Day, y: ArrayLike | None = None, settings: SearchSettings | None = None, **changes: Any
) -> SearchResult:
    """Estimate the delay by search in (10), Table IV: reach and operators together.

    Parameters
    ----------
    u, y, settings, **changes
        As for :func:`direct`.
    """
    settings = settings or (u.config.search_settings() if isinstance(u, Day) else None)
    inflow, level = _series("indirect", u, y=y)
    return search.indirect(inflow, level, settings, **changes)


def cusum(
    response: ArrayLike | FirResult | Day, settings: CusumSettings | None = None, **changes: Any
) -> CusumResult:
    """Estimate the delay as the jump of an impulse response that was estimated without one (section VI).

    Parameters
    ----------
    response : Day, result of :func:`ml` or :func:`map_fir`, or array_like of shape (M,) or (days, M)
        Of a day, the response is that of :func:`ml`.
    settings : CusumSettings, optional
        Default: those of the day's configuration, or the usual ones.
    **changes
        Single settings to change, ``cusum(day, drift=1.5)``.

    Raises
    ------
    RividError
        For a shape that does not fit, or a response too short for d_max.
    """
    if isinstance(response, Day):
        settings = settings or response.config.cusum_settings()
        response = ml(response)
    if isinstance(response, FirResult):
        response = response.fir
    return cusum_of(response, settings, **changes)


def posterior(
    u: ArrayLike | Day,
    y: ArrayLike | None = None,
    o: ArrayLike | None = None,
    *,
    config: GivenConfig = None,
    **changes: Any,
) -> DelayProbabilities:
    """Compute the probability of every delay of a day, or of many.

    Parameters
    ----------
    u : Day, or array_like of shape (N,) or (days, N)
        A day; or the inflow [m3/s].
    y, o : array_like, same shape
        Level [m] (of a river, discharge [m3/s]) and, if it is logged, the outflow [m3/s]; not with a day.
    config : Config, path of a TOML file, or mapping, optional
        Reach and settings; default: the day's own, or those of Table I.
    **changes
        Keys of `[posterior]`, ``posterior(day, d_max=20, answer_above=0.9)``.

    Raises
    ------
    RividError
        For shapes that do not fit, values that are not finite, or too few samples.
    ConfigError
        For an unknown key or an invalid value.

    Examples
    --------
    >>> from rivid import read_day
    >>> day = read_day("sample_data/basse_isere_csv/2008-03-14.csv", config="configs/basse_isere.toml")
    >>> posterior(day).delay
    np.float64(7.0)
    """
    if isinstance(u, Day):
        if y is not None or o is not None:
            raise ConfigError("posterior(day, y): a day has its own series: expected posterior(day)")
        base = u.config if config is None else as_config(config)
        days, single, date = u._deviations, True, u.date
    elif y is None:
        raise ConfigError("posterior(u): the output is missing: expected posterior(day) or posterior(u, y)")
    else:
        base, date = as_config(config), None
        arrays, single = as_days({"u": u, "y": y, "o": o}, 1, "the probability of a delay")
        if not len(arrays[0]):
            raise RividError(f"u has shape {arrays[0].shape}: expected one day or more, (N,) or (days, N)")
        days = Days.of(arrays[0], arrays[1], None if o is None else arrays[2], min_motion=0.0)
    settings = _with_posterior(base, days.o is not None, changes)
    (estimator,) = build(settings).values()
    if days.u.shape[1] < estimator.min_samples:
        raise RividError(f"{days.u.shape[1]} samples a day are too few for {estimator.needed_for}")
    with threadpool_limits(1):  # the matrices are small: threads of the BLAS would wait for each other
        answer = estimator.estimate(days)
    names = ("status", "delay", "probability", "delay_low", "delay_high", "travel", "fir", "fir_sd")
    columns = {name: getattr(answer, name) for name in names}
    assert answer.reason is not None
    whether = [answer.status == "ok", ~days.u.any(axis=1), ~days.y.any(axis=1)]
    still = ["", "the inflow does not move", "the output does not move"]
    columns |= {"probabilities": answer.curve, "reason": np.select(whether, still, answer.reason)}
    # the posterior sets all of these; the sample time of arrays alone is unknown
    values: dict[str, Any] = {n: v[0] if single else v for n, v in columns.items()}
    known = isinstance(u, Day) or config is not None
    return DelayProbabilities(
        candidates=np.asarray(answer.candidates), output_unit=settings.reach.output_unit, date=date,
        sample_time=settings.reach.sample_time if known else None, **values,
    )  # fmt: skip


def _with_posterior(base: Config, outflow: bool, changes: dict[str, Any]) -> Config:
    """Return the configuration with the posterior as its only estimator."""
    raw = base.model_dump(exclude_unset=True)
    raw["run"] = raw.get("run", {}) | {"estimators": ["posterior"]}
    raw["posterior"] = raw.get("posterior", {}) | changes
    if not outflow and base.reach.kind == "pool":
        raw["input"] = raw.get("input", {}) | {"u_Qo": ""}
    return parse(raw, Config, "posterior")


def describe_delay(delay: float, sample_time: float | None, rounded: bool = False) -> str:
    """Return a delay in samples and, if T_s is known, as a travel time."""
    if not np.isfinite(delay):
        return "no delay"
    lag = f"d = {samples([delay])}"
    return lag if sample_time is None else f"{lag} ({travel([delay], sample_time, rounded)})"


def describe_days(status: Strings, delay: Floats) -> str:
    """Return the number of days by status, and the range of their delays."""
    counted = Counter(map(str, status))
    listed = ", ".join(f"{n} {name}" for name, n in counted.most_common())
    d = delay[np.isfinite(delay)]
    span = f"; d median {np.median(d):g}, {d.min():g} to {d.max():g} samples" if len(d) else ""
    return f"{sum(counted.values())} days: {listed}{span}"
