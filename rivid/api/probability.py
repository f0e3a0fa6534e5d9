"""The probability of every delay, of a day or of arrays, whatever is logged and whatever the water."""

import datetime as dt
from dataclasses import dataclass
from typing import TYPE_CHECKING, Any

import numpy as np
from numpy.typing import ArrayLike, NDArray

from rivid.api.day import Day
from rivid.api.estimate import days_words, delay_words, draw_days, draw_response, mark
from rivid.api.given import GivenConfig, as_config
from rivid.config import Config, parse
from rivid.errors import ConfigError, RividError
from rivid.estimators import Answer, Days, build
from rivid.types import Floats

if TYPE_CHECKING:
    from rivid.api.picture import Picture


@dataclass(frozen=True, repr=False, eq=False)
class DelayProbabilities:
    """What :func:`posterior` says; a leading axis of days, or none for a single day.

    Attributes
    ----------
    status : ndarray of str, shape (days,)
        "ok" or "unidentifiable".
    delay : ndarray, shape (days,)
        The likeliest delay [samples]; NaN unless the status is "ok".
    probability : ndarray, shape (days,)
        That the likeliest delay is right; NaN on a day that has no probabilities to tell.
    delay_low, delay_high : ndarray, shape (days,)
        Ends of the smallest set of delays that holds 90 % [samples].
    travel : ndarray, shape (days,)
        The travel time with its fraction [samples]; NaN unless the status is "ok".
    candidates : ndarray of int, shape (K,)
        The delays tried [samples].
    probabilities : ndarray, shape (days, K)
        p(d | y).
    fir, fir_sd : ndarray, shape (days, M)
        Response of the output to the inflow and its standard deviation [output unit per m3/s].
    reason : ndarray of str, shape (days,)
        Why there is no answer; empty on a day that has one.
    sample_time : float or None
        T_s [s]; None where only arrays were given.
    output_unit : str
        "m" or "m3/s".
    date : datetime.date or None
        Of the day.
    """

    status: NDArray[np.str_]
    delay: Floats
    probability: Floats
    delay_low: Floats
    delay_high: Floats
    travel: Floats
    candidates: NDArray[np.intp]
    probabilities: Floats
    fir: Floats
    fir_sd: Floats
    reason: NDArray[np.str_]
    sample_time: float | None = None
    output_unit: str = "m"
    date: dt.date | None = None

    def __repr__(self) -> str:
        if np.ndim(self.delay):
            return f"DelayProbabilities({days_words(self.status, self.delay)})"
        if str(self.status) != "ok":
            return f"DelayProbabilities({self.status}: {self.reason})"
        from rivid.text import probability

        low, high = float(self.delay_low), float(self.delay_high)
        return (
            f"DelayProbabilities({delay_words(float(self.delay), self.sample_time)}, right with "
            f"{probability(float(self.probability))}; 90 % within {low:.0f} to {high:.0f})"
        )

    def plot(self) -> "Picture":
        """One day: its response, and the probability of every delay; many days: a column for each day."""
        from rivid.api.picture import picture
        from rivid.plots import style

        title = f"How probable each delay is{f', {self.date}' if self.date else ''}"
        with style.styled():
            if np.ndim(self.delay):
                figure, (axes,) = picture(title, days_words(self.status, self.delay), (2.9,))
                draw_days(axes, self.fir, self.delay)
                return figure
            note = repr(self).removeprefix("DelayProbabilities(")[:-1]
            figure, (response, bars) = picture(title, note, (1.9, 1.2))
            draw_response(response, self.fir, self.fir_sd, float(self.delay), self.output_unit)
            if np.isfinite(self.probabilities).any():
                bars.bar(self.candidates + 0.5, self.probabilities, 0.8, color=style.INK)
                bars.set_ylim(0, 1)
            else:
                style.say(bars, str(self.reason))
            mark(bars, float(self.delay))
            bars.set_ylabel("probability")
            bars.set_xlabel("lag and delay [samples]")
            bars.set_xlim(response.get_xlim())
        return figure


def posterior(
    u: ArrayLike | Day,
    y: ArrayLike | None = None,
    o: ArrayLike | None = None,
    *,
    config: GivenConfig = None,
    **changes: Any,
) -> DelayProbabilities:
    """The probability of every delay of a day, or of many.

    Parameters
    ----------
    u : Day, or array_like of shape (N,) or (days, N)
        A day with all it knows; or the inflow [m3/s].
    y, o : array_like, same shape
        Level [m] (of a river, discharge [m3/s]) and, where it is logged, the outflow [m3/s]; neither beside
        a day.
    config : Config, path of a TOML file, or mapping, optional
        Reach and settings; the day's own, or those of Table I, by default.
    **changes
        Keys of `[posterior]`, ``posterior(day, d_max=20, answer_above=0.9)``.

    Returns
    -------
    DelayProbabilities

    Raises
    ------
    RividError
        For shapes that do not fit, values that are not finite, or too few samples.
    ConfigError
        For an unknown key or an impossible value.

    Examples
    --------
    >>> from rivid import read_day
    >>> day = read_day("sample_data/basse_isere_csv/2008-03-14.csv", config="configs/basse_isere.toml")
    >>> posterior(day).delay
    np.float64(6.0)
    """
    if isinstance(u, Day):
        if y is not None or o is not None:
            raise ConfigError("posterior(day, y): a day has its own series: expected posterior(day)")
        base = u.config if config is None else as_config(config)
        o = u.o
        days = Days(u.u[None], u.y[None], None if o is None else np.asarray(o)[None], u.inflow[:1])
        single, date = True, u.date
    elif y is None:
        raise ConfigError("posterior(u): the output is missing: expected posterior(day) or posterior(u, y)")
    else:
        base = as_config(config)
        days, single = _as_days(u, y, o)
        date = None
    said = _asked(base, days.o is not None, changes)
    (estimator,) = build(said).values()
    if days.u.shape[1] < estimator.min_samples:
        raise RividError(f"{days.u.shape[1]} samples a day are too few for {estimator.needed_for}")
    answer = estimator.estimate(days)
    given = {name: _there(getattr(answer, key)) for name, key in _PARTS.items()}
    given["reason"] = np.where(answer.status == "ok", "", _reasons(answer, days))
    if single:
        given = {name: values[0] for name, values in given.items()}
    known = isinstance(u, Day) or config is not None  # else nothing tells the sample time
    return DelayProbabilities(
        candidates=_there(answer.candidates),
        sample_time=said.reach.sample_time if known else None,
        output_unit=said.reach.output_unit,
        date=date,
        **given,
    )


_PARTS = {
    "status": "status", "delay": "delay", "probability": "probability", "delay_low": "delay_low",
    "delay_high": "delay_high", "travel": "travel", "probabilities": "curve", "fir": "fir",
    "fir_sd": "fir_sd",
}  # fmt: skip


def _there(values: Any) -> Any:
    assert values is not None, "the posterior gives all of these"
    return values


def _asked(base: Config, outflow: bool, changes: dict[str, Any]) -> Config:
    """The configuration with the posterior as its only estimator."""
    raw = base.model_dump(exclude_unset=True)
    raw["run"] = raw.get("run", {}) | {"estimators": ["posterior"]}
    raw["posterior"] = raw.get("posterior", {}) | changes
    if not outflow and base.reach.kind == "pool":
        raw["input"] = raw.get("input", {}) | {"u_Qo": ""}
    return parse(raw, Config, "posterior")


def _as_days(u: ArrayLike, y: ArrayLike, o: ArrayLike | None) -> tuple[Days, bool]:
    arrays = {"u": np.asarray(u, float), "y": np.asarray(y, float)}
    if o is not None:
        arrays["o"] = np.asarray(o, float)
    shape = arrays["u"].shape
    for name, values in arrays.items():
        if values.shape != shape or values.ndim not in (1, 2) or not values.size:
            raise RividError(
                f"{name} has shape {values.shape} and u {shape}: expected the same, (N,) or (days, N)"
            )
        if not np.isfinite(values).all():
            raise RividError(f"{name} has values that are not finite: fill gaps or leave the days out")
    many = {name: np.atleast_2d(values) for name, values in arrays.items()}
    base = many["u"][:, 0]
    moved = {name: values - values[:, :1] for name, values in many.items()}
    return Days(moved["u"], moved["y"], moved.get("o"), base), len(shape) == 1


def _reasons(answer: Answer, days: Days) -> NDArray[np.str_]:
    """Why a day has no answer, also where that is to be seen from u and y."""
    given = _there(answer.reason)
    still = np.where(~days.u.any(axis=1), "the inflow does not move", "the output does not move")
    return np.where(days.u.any(axis=1) & days.y.any(axis=1), given, still)
