"""Small simulated years for the tests of the paper's figures."""

import dataclasses
from functools import cache
from pathlib import Path

from rivid.config import Config, ReachConfig, parse
from rivid.plots.paper_data import Year, estimate, year_of
from rivid.results.read import Results
from rivid.simulation import Season, simulate
from rivid.simulation.scenario import Scenario, load_scenario

SCENARIO = Path(__file__).parents[2] / "configs" / "scenarios" / "basse_isere.toml"


@cache
def season(days: int = 14, missing: int = 2, seed: int = 11) -> Season:
    """Return a short season of the sample year's reach."""
    raw = load_scenario(SCENARIO).model_dump(exclude_unset=True)
    return simulate(parse({**raw, "days": days, "missing_days": missing}, Scenario, "test"), seed)


def year(days: int = 14, missing: int = 2, seed: int = 11) -> Year:
    """Return the same season as logs."""
    s = season(days, missing, seed)
    config = Config(reach=ReachConfig(name="basse-isere"))
    return year_of(config, s.dates, s.inflow, s.outflow, s.level)


@cache
def estimated(days: int = 14, missing: int = 2, seed: int = 11) -> Results:
    """Return the estimates of a year, computed once."""
    return estimate(year(days, missing, seed))


def without_outflow(y: Year) -> Year:
    """Return the same logs without the downstream command."""
    return dataclasses.replace(y, outflow=())


def still(y: Year, *days: int) -> Year:
    """Return the same logs with a constant inflow on some days."""
    inflow = tuple(u * 0 + u[0] if i in days else u for i, u in enumerate(y.inflow))
    return dataclasses.replace(y, inflow=inflow)


def cut(y: Year, day: int, n: int) -> Year:
    """Return the same logs with a day that is `n` samples shorter."""

    def shorter(columns):
        return tuple(x[:-n] if i == day else x for i, x in enumerate(columns))

    return dataclasses.replace(
        y, inflow=shorter(y.inflow), outflow=shorter(y.outflow), level=shorter(y.level)
    )
