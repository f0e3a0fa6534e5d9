"""The people at the downstream dam: (9) with shifts, dead-band, looks and a slow trim.

They act in steps. At each look they see the inflow command and the gauge, and may change the outflow:

    wanted += K_Q (inflow - inflow at the last look) - K_h (error - error at the last look) + trim,

the increments of (9), so that a new shift with other gains starts without a jump. The error is the reading
less the set-point, its part inside the dead-band taken away. Between looks the outflow stays as it is, and
the level there is known in closed form: the loop runs over looks, not over samples.
"""

import math
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from rivid.errors import ConfigError
from rivid.reach.response import NO_HOOKS, Floats, Hooks

Ints = NDArray[np.intp]


@dataclass(frozen=True)
class OperatorSettings:
    """How the outflow is commanded.

    Parameters
    ----------
    feedforward, feedforward_spread : float
        K_Q of (9): mean over people and standard deviation [-].
    level_gain, level_gain_spread : float
        K_h of (9) [m2/s], negative: the outflow grows by ``-K_h`` for each metre of level. The spread is
        relative, between people.
    dead_band : float
        Level error that nobody acts on [m].
    set_point_spread : float
        Standard deviation between people of the level they aim at [m].
    trim_time : float
        Time in which the trim repeats the feedback of a lasting error [s].
    look : (float, float)
        Shortest and longest time between two looks [s].
    notice : float
        A look is taken at once when the inflow has moved by more than this [m3/s].
    quantum : float
        Step of the outflow command [m3/s].
    lowest : float
        Smallest outflow command [m3/s].
    shift_start : float
        Hour of the first change of shift of the day; a shift has 8 hours.
    people : int
        How many share the shifts.
    """

    feedforward: float = 1.0
    feedforward_spread: float = 0.08
    level_gain: float = -300.0
    level_gain_spread: float = 0.25
    dead_band: float = 0.02
    set_point_spread: float = 0.02
    trim_time: float = 10_800.0
    look: tuple[float, float] = (600.0, 1800.0)
    notice: float = 4.0
    quantum: float = 1.0
    lowest: float = 0.0
    shift_start: float = 5.0
    people: int = 9


@dataclass(frozen=True)
class Crew:
    """The gains of each person; arrays of shape (people,)."""

    feedforward: Floats
    level_gain: Floats
    set_point: Floats


SHIFT = 8 * 3600.0
"""Length of a shift [s] (section I)."""


def loop_gain(settings: OperatorSettings, surface_area: float) -> float:
    """Share of a level error that the usual person's feedback takes away until the longest look.

    Below 1 the level comes back without swinging; at 2 the loop is unstable.
    """
    return -settings.level_gain * settings.look[1] / surface_area


def draw_crew(settings: OperatorSettings, surface_area: float, rng: np.random.Generator) -> Crew:
    """Draw each person's gains.

    Parameters
    ----------
    settings : OperatorSettings
    surface_area : float
        Water surface A [m2]; it decides which gains are stable.
    rng : numpy.random.Generator

    Returns
    -------
    Crew
        Nobody feeds back so strongly that an error swings: the gain is held where the loop gain is 1.

    Raises
    ------
    ConfigError
        Where the usual person's loop swings already.
    """
    gain = loop_gain(settings, surface_area)
    if gain > 1.0:
        most = surface_area / settings.look[1]
        raise ConfigError(
            f"operators.level_gain = {settings.level_gain:g} m2/s with a look every {settings.look[1]:g} s "
            f"corrects {gain:.2g} of a level error at once and makes the level swing: expected above "
            f"-{most:.0f} m2/s, or looks more often"
        )
    n = settings.people
    spread = np.exp(settings.level_gain_spread * rng.standard_normal(n))
    return Crew(
        settings.feedforward + settings.feedforward_spread * rng.standard_normal(n),
        np.maximum(settings.level_gain * spread, -surface_area / settings.look[1]),
        settings.set_point_spread * rng.standard_normal(n),
    )


def roster(time: Floats, settings: OperatorSettings, rng: np.random.Generator) -> Ints:
    """Who is on duty at each sample: an index into the crew, another person than the shift before.

    Parameters
    ----------
    time : ndarray, shape (n,)
        Seconds since a midnight.
    settings : OperatorSettings
    rng : numpy.random.Generator

    Returns
    -------
    ndarray of int, shape (n,)
    """
    shift = np.floor((time - settings.shift_start * 3600.0) / SHIFT).astype(np.intp)
    shift -= shift[0]
    steps = rng.integers(1, max(settings.people, 2), shift[-1] + 1)
    return np.asarray((np.cumsum(steps) % settings.people)[shift], np.intp)


def quantise(values: Floats, quantum: float) -> Floats:
    """Values in whole quanta; unchanged where the quantum is zero.

    The product is rounded again, so that 13602 quanta of 0.01 are written 136.02.
    """
    return values if quantum == 0 else np.round(np.round(values / quantum) * quantum, 9)


def regulate(
    time: Floats,
    inflow: Floats,
    volume: Floats,
    noise: Floats,
    set_point: Floats,
    settings: OperatorSettings,
    crew: Crew,
    duty: Ints,
    *,
    surface_area: float,
    outflow_gain: float,
    gauge_quantum: float,
    rng: np.random.Generator,
    hooks: Hooks = NO_HOOKS,
) -> Floats:
    """Run the closed loop and give the outflow commands.

    Parameters
    ----------
    time : ndarray, shape (n,)
        Sample times [s].
    inflow : ndarray, shape (n,)
        Announced inflow command u_Qi [m3/s].
    volume : ndarray, shape (n,)
        What has come to the dam at each sample [m3]; see :func:`rivid.reach.response.supply`.
    noise : ndarray, shape (n,)
        Gauge noise [m]; the reading is level plus noise, in whole quanta.
    set_point : ndarray, shape (n,)
        Level aimed at [m]; the level starts there.
    settings : OperatorSettings
    crew : Crew
    duty : ndarray of int, shape (n,)
        Who is on duty; see :func:`roster`.
    surface_area, outflow_gain : float
        A [m2] and K_o of the reach.
    gauge_quantum : float
        Step of the reading [m]; 0 for none.
    rng : numpy.random.Generator
        For the times between looks.
    hooks : Hooks
        Its `outflow` and `gauge` are used.

    Returns
    -------
    ndarray, shape (n,)
        Outflow commands u_Qo [m3/s], at least `settings.lowest`.
    """
    n = len(time)
    command = np.empty(n)
    waits = rng.uniform(*settings.look, n).tolist()  # one for each possible look
    # Plain floats: a season has some 100,000 looks, and numpy scalars cost ten times as much.
    t, q, V, e, aim = (x.tolist() for x in (time, inflow, volume, noise, set_point))
    K_Q, K_h, bias = (x[duty].tolist() for x in (crew.feedforward, crew.level_gain, crew.set_point))
    released, start, level_0 = 0.0, V[0], aim[0]
    wanted = seen = q[0]
    error_before = 0.0
    since = t[0]
    k = 0
    while k < n:
        level = level_0 + (V[k] - start - released) / surface_area
        if hooks.gauge is not None:
            level = float(hooks.gauge(time[k : k + 1], np.array([level]))[0])
        reading = level + e[k]
        if gauge_quantum:
            reading = round(reading / gauge_quantum) * gauge_quantum
        error = reading - aim[k] - bias[k]
        error = math.copysign(max(abs(error) - settings.dead_band, 0.0), error)
        wanted += K_Q[k] * (q[k] - seen) - K_h[k] * (error - error_before)
        wanted -= K_h[k] * error * (t[k] - since) / settings.trim_time
        wanted = max(wanted, settings.lowest)  # no wind-up below the limit
        given = wanted
        if settings.quantum:
            given = max(round(wanted / settings.quantum), math.ceil(settings.lowest / settings.quantum))
            given *= settings.quantum
        seen, error_before, since = q[k], error, t[k]

        until, high, low = since + waits[k], seen + settings.notice, seen - settings.notice
        j = k + 1
        while j < n and t[j] < until and low <= q[j] <= high:
            j += 1
        command[k:j] = given
        if j < n:
            if hooks.outflow is None:
                released += outflow_gain * given * (t[j] - t[k])
            else:
                flow = hooks.outflow(time[k:j], command[k:j])
                released += outflow_gain * float(flow @ np.diff(time[k : j + 1]))
        k = j
    return command
