"""Words for travel times: what a delay of d samples says of when the inflow arrives.

A wave that needs T seconds has d = ceil(T / T_s) - 1: the first sample at which the level has moved is d + 1,
and the travel time lies between d T_s and (d + 1) T_s. A page that gave d T_s would give a time that no wave
has.
"""

import math
from collections.abc import Sequence

from rivid.plots.words import HOURS_FROM, duration, listed, number, samples, spelt


def step(sample_time: float) -> str:
    """The length of a sample: minutes or hours where these are whole.

    Examples
    --------
    >>> step(300), step(133), step(3600)
    ('5 min', '133 s', '1 h')
    """
    for size, unit in ((3600, "h"), (60, "min")):
        if sample_time % size == 0:
            return f"{sample_time / size:.0f} {unit}"
    return f"{number(sample_time)} s"


def travel(values: Sequence[float], sample_time: float) -> str:
    """The travel time that a delay stands for, or several alternatives.

    A delay of d samples says that the inflow arrives between d T_s and (d + 1) T_s; a median between two
    delays stands for both.

    Parameters
    ----------
    values : sequence of float
        Delays d [samples], lowest first.
    sample_time : float
        T_s [s].

    Examples
    --------
    >>> travel([5], 300), travel([6, 7], 133), travel([6, 9], 133), travel([5.5], 300)
    ('25 to 30 min', '13.3 to 17.7 min', '13.3 to 15.5 or 19.9 to 22.2 min', '25 to 35 min')
    """
    spans: list[tuple[float, float]] = []
    for d in values:
        low, high = math.floor(d) * sample_time, (math.ceil(d) + 1) * sample_time
        if spans and low <= spans[-1][1]:
            spans[-1] = spans[-1][0], high
        else:
            spans.append((low, high))
    ends = [end for span in spans for end in span]
    unit, size = ("min", 60) if ends[0] < HOURS_FROM else ("h", 3600)
    texts = spelt([end / size for end in ends])
    if all(text.endswith(".0") or "." not in text for text in texts):
        texts = [text.removesuffix(".0") for text in texts]
    said = [f"{low} to {high}" for low, high in zip(texts[::2], texts[1::2], strict=True)]
    return f"{listed(said, 'or')} {unit}"


def travel_within(low: float, high: float, sample_time: float) -> str:
    """The travel times that the delays from `low` to `high` [samples] stand for.

    Examples
    --------
    >>> travel_within(5, 9, 133)
    '11.1 to 22.2 min'
    """
    return travel([float(d) for d in range(math.floor(low), math.ceil(high) + 1)], sample_time)


def samples_first(values: Sequence[float], sample_time: float) -> str:
    """Delays in samples, then the travel time that they stand for.

    Examples
    --------
    >>> samples_first([5], 300)
    '5 samples (25 to 30 min)'
    """
    return f"{samples(values)} ({travel(values, sample_time)})"


def travel_first(values: Sequence[float], sample_time: float) -> str:
    """Delays as a person asks for them: the travel time, then the samples.

    Examples
    --------
    >>> travel_first([5], 300), travel_first([6, 7], 133)
    ('25 to 30 min (delay d = 5 samples of 5 min)', '13.3 to 17.7 min (delay d = 6 or 7 samples of 133 s)')
    """
    return f"{travel(values, sample_time)} (delay d = {samples(values)} of {step(sample_time)})"


def about(seconds: float) -> str:
    """A travel time with its fraction, which is not known to the second.

    Examples
    --------
    >>> about(1714), about(431), about(9000)
    ('about 29 min', 'about 7.2 min', 'about 2.5 h')
    """
    return f"about {seconds / 60:.0f} min" if 600 <= seconds < HOURS_FROM else f"about {duration([seconds])}"
