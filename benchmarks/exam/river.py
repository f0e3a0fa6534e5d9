"""A free river for the exam: a row of reservoirs, each with the storage of a wide channel.

    dS/dt = inflow - Q,   S = (n / sqrt(slope))^0.6 width^0.4 Q^0.6 length / N

The diagnosis fits a diffusive wave, which is another model. Source: Kalinin and Milyukov (1957) for the
reservoirs, Manning's equation for the storage.
"""

import datetime as dt

import numpy as np

from benchmarks.exam.answering import Logs
from benchmarks.exam.cases import Case
from benchmarks.exam.planting import Planted, plain, scenario_of
from rivid.effects import World, changes_of
from rivid.simulation.scenario import Scenario
from rivid.simulation.season import DAY, Floats, ar1, daily_flow, programme

RESERVOIRS = 16
STEP = 60.0
"""Of the routing [s]."""
SLOPE, MANNING = 5e-4, 0.035
GAUGE = 1.0
"""Standard deviation of the gauged discharge [m3/s]."""


def routed(inflow: Floats, lateral: Floats, scenario: Scenario, steps: int) -> Floats:
    """Discharge at the lower end [m3/s], at the beginning of each sample.

    Parameters
    ----------
    inflow : ndarray, shape (n,)
        What the dam lets through, held from sample to sample [m3/s].
    lateral : ndarray, shape (n,)
        What enters at the weather's place [m3/s].
    scenario : Scenario
    steps : int
        Of the routing in a sample.

    Returns
    -------
    ndarray, shape (n,)
    """
    reach = scenario.reach
    area = (MANNING / np.sqrt(SLOPE)) ** 0.6 * reach.width**0.4
    scale = float(area * reach.length / RESERVOIRS)
    step = reach.sample_time / steps
    enters = round(scenario.weather.place * (RESERVOIRS - 1))
    flows = [float(inflow[0])] * RESERVOIRS
    stores = [scale * q**0.6 for q in flows]
    out = np.empty(len(inflow))
    for k in range(len(inflow)):
        out[k] = flows[-1]
        beside = float(lateral[k])
        for _ in range(steps):
            coming = float(inflow[k])
            for j in range(RESERVOIRS):
                stores[j] += step * (coming + (beside if j == enters else 0.0) - flows[j])
                coming, flows[j] = flows[j], (stores[j] / scale) ** (5.0 / 3.0)
    return out


def flow_down(case: Case, seed: int) -> Planted:
    """The logs of a river and its truth; the planted effects act on the inflow."""
    scenario = scenario_of(case)
    reach, weather = scenario.reach, scenario.weather
    rngs = [np.random.default_rng([seed, 91, stream]) for stream in range(4)]
    lead = 2
    first = scenario.first_day - dt.timedelta(days=lead)
    days = scenario.days + lead
    seconds = np.arange(0.0, DAY, reach.sample_time)
    time = (np.arange(-lead, scenario.days)[:, None] * DAY + seconds).ravel()
    means = daily_flow(scenario.flow, first, days, rngs[0])
    weekdays = (first.weekday() + np.arange(days)) % 7
    inflow = programme(scenario.programme, time + lead * DAY, means, weekdays, rngs[1])
    world = World(
        time=time, inflow=inflow, outflow=None, first_day=scenario.first_day, sample_time=reach.sample_time,
        level=0.0, flow=scenario.flow.mean, seed=(seed, 6),
    )  # fmt: skip
    planted = scenario.planted()
    changes = changes_of(planted, world)
    real = inflow if changes.inflow is None else changes.inflow
    for part in changes.added:  # beside the dam: whatever its place, it goes all the way
        real = real + part.flow
    lateral = weather.inflow * ar1(len(time), reach.sample_time, weather.memory, rngs[2])
    out = routed(real, lateral, scenario, round(reach.sample_time / STEP))
    out += GAUGE * rngs[3].standard_normal(len(out))
    logged, gauged = (values.reshape(days, -1)[lead:] for values in (inflow, out))
    dates = tuple(scenario.first_day + dt.timedelta(days=k) for k in range(scenario.days))
    table = reach.model_dump(include={"length", "width", "depth", "discharge_range", "sample_time"})
    config = {
        "reach": table | {"name": "reach", "kind": "river"}, "diagnose": {"exclude": list(case.without)}
    }  # fmt: skip
    truth = {"effects": plain(planted), "first_day": dates[0].isoformat(), "days": scenario.days}
    return Planted(Logs(dates, seconds, logged, None, gauged, config), truth, planted)
