"""The paper's estimator on a day or on arrays, with an answer that shows itself."""

import datetime as dt
from collections import Counter
from dataclasses import dataclass, fields
from typing import TYPE_CHECKING, Any

import numpy as np
from numpy.typing import ArrayLike

from rivid.api.day import Day
from rivid.core.jmap import JmapResult
from rivid.core.jmap import jmap as jmap_of_arrays
from rivid.core.settings import JmapSettings
from rivid.errors import ConfigError

if TYPE_CHECKING:
    from matplotlib.axes import Axes

    from rivid.api.picture import Picture


@dataclass(frozen=True, repr=False, eq=False)
class DelayEstimate(JmapResult):
    """What :func:`jmap` says: all of :class:`rivid.core.jmap.JmapResult`, and where it comes from.

    Attributes
    ----------
    sample_time : float or None
        T_s [s]; None where only arrays were given.
    output_unit : str
        "m" or "m3/s"; empty where only arrays were given.
    date : datetime.date or None
        Of the day.
    """

    sample_time: float | None = None
    output_unit: str = ""
    date: dt.date | None = None

    def __repr__(self) -> str:
        if np.ndim(self.delay):
            return f"DelayEstimate({days_words(self.status, self.delay)})"
        doubt = ", the prior's" if bool(self.prior_only) else ""
        return (
            f"DelayEstimate({delay_words(float(self.delay), self.sample_time)}, {self.status}{doubt}; "
            f"alpha {float(self.alpha):.2g}, condition {float(self.condition):.2g})"
        )

    def plot(self) -> "Picture":
        """One day: its response, and the criterion of every delay; many days: a column for each day."""
        from rivid.api.picture import picture
        from rivid.plots import style

        title = f"Delay and impulse response{f', {self.date}' if self.date else ''}"
        with style.styled():
            if np.ndim(self.delay):
                figure, (axes,) = picture(title, days_words(self.status, self.delay), (2.9,))
                draw_days(axes, self.fir, self.delay)
                return figure
            note = repr(self).removeprefix("DelayEstimate(")[:-1]
            figure, (response, criterion) = picture(title, note, (1.9, 1.2))
            draw_response(response, self.fir, None, float(self.delay), self.output_unit)
            criterion.plot(self.candidates, self.criterion, color=style.INK, lw=1.0, marker="o", ms=2.6)
            mark(criterion, float(self.delay))
            criterion.set_ylabel("criterion")
            criterion.set_xlabel("lag and delay [samples]")
            criterion.set_xlim(response.get_xlim())
        return figure


def jmap(
    u: ArrayLike | Day, y: ArrayLike | None = None, settings: JmapSettings | None = None, **changes: Any
) -> DelayEstimate:
    """Estimate delay and impulse response of a day, or of many, by the paper's estimator (Table VI).

    Parameters
    ----------
    u : Day, or array_like of shape (N,) or (days, N)
        A day with all it knows; or the inflow as deviations from the day's first sample [m3/s].
    y : array_like, same shape
        Output as deviations from the day's first sample [m or m3/s]; not beside a day.
    settings : JmapSettings, optional
        Those of the day's configuration, or the paper's, by default.
    **changes
        Single settings to change, ``jmap(day, prior="uniform", alpha=1e4)`` for Table V.

    Returns
    -------
    DelayEstimate

    Raises
    ------
    RividError
        For shapes that do not fit, values that are not finite, or too few samples.

    Notes
    -----
    Source: Tables V and VI; see :func:`rivid.core.jmap.jmap`.

    Examples
    --------
    >>> from rivid import read_day
    >>> day = read_day("sample_data/basse_isere_csv/2008-03-14.csv", config="configs/basse_isere.toml")
    >>> jmap(day).delay
    np.float64(7.0)
    """
    if isinstance(u, Day):
        if y is not None:
            raise ConfigError("jmap(day, y): a day has its own output: expected jmap(day) or jmap(u, y)")
        found = jmap_of_arrays(u.u, u.y, settings or u.config.jmap_settings(), **changes)
        about: dict[str, Any] = {
            "sample_time": u.sample_time, "output_unit": u.config.reach.output_unit, "date": u.date,
        }  # fmt: skip
    elif y is None:
        raise ConfigError("jmap(u): the output is missing: expected jmap(day) or jmap(u, y)")
    else:
        found, about = jmap_of_arrays(u, y, settings, **changes), {}
    return DelayEstimate(**{f.name: getattr(found, f.name) for f in fields(JmapResult)}, **about)


def delay_words(delay: float, sample_time: float | None) -> str:
    """A delay in samples and, where T_s is known, the travel time it stands for; or that there is none.

    Examples
    --------
    >>> delay_words(6.0, 133.0), delay_words(6.0, None), delay_words(float("nan"), 133.0)
    ('d = 6 samples (13.3 to 15.5 min)', 'd = 6 samples', 'no delay')
    """
    from rivid.text import travel

    if not np.isfinite(delay):
        return "no delay"
    samples = f"d = {delay:.0f} sample{'' if delay == 1 else 's'}"
    return samples if sample_time is None else f"{samples} ({travel([delay], sample_time)})"


def days_words(status: ArrayLike, delay: ArrayLike) -> str:
    """Many days in a few words.

    Examples
    --------
    >>> days_words(["ok", "ok", "unidentifiable"], [6.0, 8.0, float("nan")])
    '3 days: 2 ok, 1 unidentifiable; d median 7, 6 to 8 samples'
    """
    counted = Counter(str(one) for one in np.asarray(status))
    words = ", ".join(f"{n} {name}" for name, n in counted.most_common())
    d = np.asarray(delay, float)
    d = d[np.isfinite(d)]
    span = f"; d median {np.median(d):g}, {d.min():g} to {d.max():g} samples" if len(d) else ""
    return f"{sum(counted.values())} days: {words}{span}"


def mark(axes: "Axes", delay: float) -> None:
    """The step from d to d + 1, where the response jumps."""
    from rivid.plots import style

    if np.isfinite(delay):
        axes.axvspan(delay, delay + 1, color=style.ACCENT, alpha=0.18, linewidth=0, zorder=0)


def draw_response(axes: "Axes", fir: Any, sd: Any, delay: float, unit: str) -> None:
    """An impulse response with its jump, and two standard deviations to either side where there are any."""
    from rivid.plots import style
    from rivid.text import response_unit

    k = np.arange(len(fir))
    axes.axhline(0, color=style.LIGHT, lw=0.7)
    if sd is not None:
        axes.fill_between(k, fir - 2 * sd, fir + 2 * sd, color=style.LIGHT, alpha=0.5, linewidth=0)
    axes.plot(k, fir, color=style.INK, lw=1.0, marker="o", ms=2.4)
    mark(axes, delay)
    axes.set_ylabel(f"response [{response_unit(unit)}]" if unit else "response")
    axes.set_xlim(-0.5, len(k) - 0.5)
    axes.ticklabel_format(axis="y", style="sci", scilimits=(-2, 3))


def draw_days(axes: "Axes", fir: Any, delay: Any) -> None:
    """A column for each day, a row for each lag; black is high, the line is the delay."""
    from rivid.plots import style
    from rivid.plots.tdr import grey_limits

    low, high = grey_limits(fir)
    days, order = fir.shape
    axes.set_facecolor(style.NO_DATA)
    axes.imshow(
        fir.T, cmap="Greys", aspect="auto", origin="lower", interpolation="nearest",
        extent=(-0.5, days - 0.5, -0.5, order - 0.5), vmin=low, vmax=high,
    )  # fmt: skip
    axes.plot(np.arange(days), delay + 0.5, color=style.ACCENT, lw=1.2, marker="o", ms=2.0)
    axes.set_xlabel("day")
    axes.set_ylabel("lag [samples]")
