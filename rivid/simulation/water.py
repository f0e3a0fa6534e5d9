"""The water of a scenario, in either reach: the linear pool of (7), or the equations of Saint-Venant (1)."""

from dataclasses import dataclass
from functools import cached_property

import numpy as np

from rivid.errors import ConfigError, RividError
from rivid.reach.changes import Changes
from rivid.reach.loop import People
from rivid.reach.pool import PoolFlow, pool_level
from rivid.reach.response import LinearReach
from rivid.reach.saint_venant import Channel, arrival_time
from rivid.reach.saint_venant import simulate as saint_venant
from rivid.simulation.scenario import Scenario
from rivid.types import Floats

TRIAL = 1.0
"""Step of outflow that tells how a channel's level answers [m3/s]."""


@dataclass(frozen=True)
class Water:
    """The reach of a scenario.

    Parameters
    ----------
    scenario : Scenario
    area_slope : float
        Relative change of the surface for each metre of level above the set-point [1/m].
    """

    scenario: Scenario
    area_slope: float = 0.0

    @cached_property
    def pool(self) -> LinearReach:
        """The linear reach, whose gains hold for both kinds."""
        said = self.scenario.reach.model_dump(include=set(LinearReach.__dataclass_fields__))
        return LinearReach(**said)

    @cached_property
    def channel(self) -> Channel | None:
        """The sections along the reach; None for the linear one."""
        said, reach = self.scenario.channel, self.scenario.reach
        if said is None:
            return None
        shape = Channel.smooth(
            reach.length, reach.width, said.slope, said.manning, said.cells, side_slope=said.side_slope,
            end_bed=said.bed_level, width_modes=said.width_modes, bed_modes=said.bed_modes,
            manning_modes=said.manning_modes,
        )  # fmt: skip
        return shape.with_area_slope(self.area_slope, self.level)

    @property
    def level(self) -> float:
        """The usual level [m]."""
        return self.scenario.level.set_point

    @cached_property
    def surface_area(self) -> float:
        """Water surface at the usual level [m2]."""
        return self.pool.surface_area if self.channel is None else self.channel.surface_area(self.level)

    def drop(self, time: float) -> float:
        """Fall of the level at the dam in a time [s] after 1 m3/s more is let out [m per m3/s].

        In a channel at the highest flow, with the level drawn down as for that: there it is largest.
        """
        if self.channel is None:
            return time / self.surface_area
        aim, flow = self.scenario.level, self.scenario.flow.highest
        level = aim.set_point - aim.drawdown / 100.0 * max(flow - aim.drawdown_from, 0.0)
        clock = np.linspace(0.0, time, 31)
        more = np.full(31, flow + TRIAL)
        try:
            start = saint_venant(self.channel, clock[:1], [flow], [flow], level).end
            fall = level - saint_venant(self.channel, clock, np.full(31, flow), more, start).level
        except RividError as error:
            raise ConfigError(f"channel, at the highest flow and its level: {error}") from None
        return float(fall.max() / TRIAL)

    def arrival(self, flow: Floats, level: Floats) -> Floats:
        """Travel time of a small wave at mean flows [m3/s] and levels [m] of days, shape (days,) [s]."""
        if self.channel is None:
            return self.pool.travel_time(flow)
        return arrival_time(self.channel, flow, level)

    def run(
        self,
        time: Floats,
        inflow: Floats,
        outflow: Floats | People,
        usual_flow: Floats,
        changes: Changes,
        start: float,
    ) -> PoolFlow:
        """Level and outflow at the samples.

        Parameters
        ----------
        time, inflow : ndarray, shape (n,)
            Sample times [s] and logged inflow [m3/s].
        outflow : ndarray of shape (n,), or People
            Commands [m3/s], or who gives them.
        usual_flow : ndarray, shape (n,)
            Flow that the linear reach's travel time follows [m3/s].
        changes : Changes
        start : float
            Level at the first sample [m].

        Raises
        ------
        ConfigError, RividError
            Where the flow is impossible; the message names what to change.
        """
        if self.channel is None:
            travel = self.pool.travel_time(usual_flow)
            return pool_level(
                self.pool, time, inflow, outflow, travel, start=start, before=float(inflow[0]),
                changes=changes,
            )  # fmt: skip
        said = self.scenario.channel
        assert said is not None
        for name, gain in (("inflow", self.pool.inflow_gain), ("outflow", self.pool.outflow_gain)):
            if gain != 1.0:
                raise ConfigError(
                    f"reach.{name}_gain = {gain:g} with [channel]: expected 1; plant the effect "
                    f"{name}_gain_error instead"
                )
        try:
            flow = saint_venant(
                self.channel, time, inflow, outflow, start, changes=changes,
                gate_time=said.gate_time, courant=said.courant, step=said.step,
            )  # fmt: skip
        except RividError as error:
            raise type(error)(f"channel: {error}") from None
        return PoolFlow(flow.level, flow.outflow, flow.released)
