"""Captions of all figures: templates, and the sentences that depend on what a figure shows."""

from collections.abc import Iterable

from rivid.estimators import ESTIMATORS
from rivid.results.days import CLEAR, Thirds
from rivid.text import duration, output_words


def joined(*parts: tuple[bool, str]) -> str:
    """The sentences with a true condition."""
    return " ".join(text for holds, text in parts if holds)


def _no_jump(estimator: str, unit: str) -> tuple[bool, str]:
    """The sentence under every figure of a river's jump delay."""
    return unit != "m", (
        f"The {ESTIMATORS[estimator].method} looks for a jump; a dispersive river has none, so t50 describes "
        "it better than d."
    )


# Figures of a run


def tdr(unit: str, *, delay: bool, t50: bool, interval: bool) -> str:
    """Caption of the time-day representation."""
    return joined(
        (True, "Each column is a day, each row a lag k. White is the lowest coefficient of the record, black "
               "the highest (1st and 99th percentile, without the end lags)."),
        (unit == "m", "Where the inflow begins to act, the grey jumps from one row to the next."),
        (unit != "m", "The dark band is the inflow passing; a dispersive river has no jump."),
        (delay, "The coloured line is the estimated delay d: the inflow first moves the "
                f"{output_words(unit)} at lag d + 1, the row just above it."),
        (delay and interval, "The thin upright line joins the delays that together hold 90 % of the "
                             "probability."),
        (t50 and not delay, "The coloured line is t50: half of a step has arrived."),
    )  # fmt: skip


def histogram(estimator: str, unit: str) -> str:
    """Caption of the histogram of delays."""
    e = ESTIMATORS[estimator]
    probable = e.has_probability
    return joined(
        (True, "Share of days at each delay d."),
        (probable, "The line is the mean probability of each delay, over the days with a delay and those "
                   "where none is probable enough."),
        (not probable and not e.unjudged,
         "Dark: the data alone give the same delay, to within a sample. Light: they favour another, or none, "
         "so the prior, or chance, decides."),
        (True, f"Hatched bars are at d_min or d_max{'' if probable else ': the delay may be outside'}."),
        (e.rayleigh, "The line is the Rayleigh prior itself, without any data."),
        _no_jump(estimator, unit),
    )  # fmt: skip


def delay_map(estimator: str, unit: str, *, bounds: bool) -> str:
    """Caption of the delays over the record."""
    e = ESTIMATORS[estimator]
    return joined(
        (True, "One mark per day."),
        (bounds, "The blue line is the travel time of the wave at the day's discharge, as a delay: "
                 f"travel time / T_s - 1, because the {output_words(unit)} first moves at lag d + 1."),
        (e.has_probability, "Grey cells are the probability of each delay, the darker the more probable; a "
                            "day of grey cells without a mark has no delay that is probable enough."),
        (not e.unchecked, "Hollow marks are days on which the data alone favour another delay, or "
                                     "none."),
        (True, "Triangles are at d_min or d_max."),
        _no_jump(estimator, unit),
    )  # fmt: skip


def delay_discharge(estimator: str, unit: str, *, bounds: bool) -> str:
    """Caption of the delays against the discharge."""
    return joined(
        (True, "Each mark is a day, at the first sample that moves, d + 1, and so at (d + 1) T_s. Marks of "
               "equal delay are spread a little to show their number. The wave itself arrives between d T_s "
               "and (d + 1) T_s."),
        (bounds, "No wave is faster than the gravity wave (full line); the kinematic wave (dashed) is the "
                 "slow bound."),
        _no_jump(estimator, unit),
    )  # fmt: skip


T50 = (
    "One mark per day, at the lag by which half of a step of the inflow has arrived at the lower end. It is "
    "a travel time at the middle of the response and compares directly with the travel times of the waves at "
    "the day's discharge (blue, where they are known)."
)


def t50_discharge(thirds: Thirds | None, sample_time: float, *, bounds: bool) -> str:
    """Caption of t50 against the discharge."""
    text = "Each mark is a data set: t50 against its mean inflow."
    if thirds is not None:
        low, _, high = (duration([m * sample_time]) for m in thirds.medians)
        text += f" The bars are the medians of the thirds of days, {low} at low and {high} at high flow"
        text += ": more water, a faster wave." if thirds.longer >= CLEAR else "."
    return joined(
        (True, text),
        (bounds, "The blue lines are the bounds of the travel time by the hydraulics: no wave is faster than "
                 "the gravity wave, the kinematic wave is the slow bound."),
    )  # fmt: skip


def fir_day(estimators: Iterable[str], unit: str, *, band: bool) -> str:
    """Caption of the responses of one day."""
    names = list(estimators)
    return joined(
        (True, "The same day's data through each estimator. The coloured step from d to d + 1 is where the "
               "estimator lets the response jump. Under each panel, the response as a grey bar of the "
               "time-day representation."),
        (any(ESTIMATORS[name].has_probability for name in names),
         "The posterior's response is the mean of its most probable equations; where the outflow is logged, "
         "it is the response of the level at constant outflow, without the operators' reaction."),
        (any(ESTIMATORS[name].method == "CUSUM" for name in names),
         "CUSUM does not shape the response: there, the step is where its mean is found to change."),
        (band, "The grey band is two standard deviations to either side."),
        (unit != "m", "The dashed blue line is t50: half of a step has arrived."),
    )  # fmt: skip


# Figures of a season

SEASON = (
    "Grey cells are the probabilities from each day alone, the darker the more probable. The line is the "
    "median of the joined days, between 5 and 95 %. Vermilion: the day alone gave another delay. Hollow: the "
    "day itself has no information."
)
LAW = (
    "Each mark is a day at its own travel time; its bar holds 5 to 95 % of its probability. The line is the "
    "law T = T0 (Q / Q0)^-b, the band its confidence interval, and the dashes hold a single day."
)

# Figures of a diagnosis


def gap(events: bool) -> str:
    """Caption of the errors some hours ahead."""
    return joined(
        (True, "At many times on the days that were used for neither fit nor choice, the simulation is set "
               "to the measurement and continues by itself. The bars are its root mean square error some "
               "hours later."),
        (events, "Hatched: the size and time of each event are taken from the day itself, which no forecast "
                 "can know."),
    )  # fmt: skip


def missing_water(maps: int) -> str:
    """Caption of the map of the unexplained inflow."""
    return joined(
        (True, "Each column is a day, each row an hour. Teal: more water came in than the logs account for; "
               "brown: less. Hatched: no valid samples. A band along the hours is an effect of every day; a "
               "block is an effect that began and ended."),
        (maps == 2, "Both maps have one scale: the named effects are gone from the right one."),
    )  # fmt: skip


def unexplained_inflow(two: bool) -> str:
    """Caption of the course of the unexplained inflow."""
    return joined(
        (True, "Above, its course with the 95 % band. Below, its mean by hour and by the logged series, with "
               "95 % intervals that treat whole blocks of days as one. Explained inflow is at zero."),
        (two, "Vermilion: without the named effects; blue: with them."),
    )  # fmt: skip


def held_out_day(name: str, days: int, worse: int) -> str:
    """Caption of the day kept apart: `worse` of `days` days have a larger error."""
    return (
        f"The simulation starts from the first measured {name} of the day and is never corrected after it; "
        f"its only inputs are the flows below. Of the {days} days kept apart, the simulation without any "
        f"effect had a larger error on {worse}."
    )


LOOP = (
    "The simulation starts from the day's first measured level and logged outflow; after that its only input "
    "is the inflow: a model of the operators observes the simulated level and decides the outflow. Missing "
    "water appears in the outflow more than in the level, which the operators hold."
)

# Figures of the paper

PAPER = {
    "2": "Mean of each day's command at the dam {where}.",
    "3": "Mean of each day's level at the downstream dam.",
    "4": "Inertial over gravity forces (6), from the day's mean discharge.",
    "5": "A gravity wave hardly depends on the flow; a kinematic wave does.",
    "6": "The bounds of Fig. 5 for each day's mean discharge (Fig. 2) and Froude number (Fig. 4).",
    "7": "What is known of a day: the commands of both dams, and the level at the downstream one.",
    "9": "Share of days at each delay. Hatched bars are at the bounds: the largest means beyond.",
    "10": "Two jumps: the operators react at lag 1, the inflow itself arrives at lag d + 1; between them the "
          "response is slow.",
    "11": "Before any data: a delay near sigma_d, and a response about as rough as the ML's.",
    "12": "ML is rough, MAP blurs the jump, JMAP is smooth and keeps it, JMAPdeg (no inverse-gamma prior) "
          "is too smooth. The last lags collect what M lags cannot hold. Below: the JMAP as a bar.",
    "13": "Rough, but two jumps in grey are visible: the operators act at lag 1, the inflow arrives at "
          "d + 1.",
    "14": "Smoother along the lags, and the jumps are blurred.",
    "15": "Smooth, with a sharp jump just above the estimated delay (coloured), from each day's data alone.",
    "16": "The same with the Rayleigh prior on the delay (Table VI).",
    "17": "One mark a day; hollow where the data without the prior's terms do not give the same delay.",
    "18": "Dark: without the prior's terms the data give the same delay to within a sample. Light: they "
          "do not, the prior or chance decides.",
    "19": "Grey: the operators' interval, three sampling periods to either side. Dark: nine of ten "
          "estimates; the dots are the share of each delay.",
}  # fmt: skip
