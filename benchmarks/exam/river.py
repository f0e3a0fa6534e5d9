"""Simulate a free river for the exam: a cascade of reservoirs, each with the storage of a wide channel.

    dS/dt = inflow - Q,   S = area(Q) length / N,   area = usual area (Q / usual flow)^0.6

The diagnosis fits another model, a diffusive wave. Source: Kalinin and Milyukov (1957) for the reservoirs;
the exponent is that of Manning's equation in a wide channel.
"""

from functools import cached_property

import numpy as np
from numba import njit

from rivid.errors import RividError
from rivid.reach.changes import Changes
from rivid.reach.gate import OperatorArrays
from rivid.simulation.season import Water
from rivid.types import Floats, Ints

STEP = 60.0
"""Longest time step of the routing [s]."""
FEWEST, MOST = 8, 30
"""Number of reservoirs. Waves of a river of 50 km spread by a fifth to a third of their travel time."""


@njit(cache=True, error_model="numpy")
def route(
    inflow: Floats, sides: Floats, enters: Ints, steps: int, dt: float, scale: float, count: int, out: Floats
) -> bool:
    """Write the discharge at the lower end (n,) at the start of each sample; return False if it runs dry.

    `sides` (k, n) enter the reservoirs `enters` (k,); `scale` is S / Q^0.6 of a reservoir.
    """
    flows = np.full(count, inflow[0])
    stores = scale * flows**0.6
    added = np.zeros(count)
    for k in range(len(inflow)):
        out[k] = flows[-1]
        added[:] = 0.0
        for j in range(len(enters)):
            added[enters[j]] += sides[j, k]
        for _ in range(steps):
            coming = inflow[k]
            for j in range(count):
                stores[j] += dt * (coming + added[j] - flows[j])
                if not stores[j] > 0.0:
                    return False
                coming, flows[j] = flows[j], (stores[j] / scale) ** (5.0 / 3.0)
    return True


class RiverWater(Water):
    """River instead of a pool. Its "level" is the discharge at the lower end [m3/s]; it has no operators."""

    @cached_property
    def count(self) -> int:
        """Number of reservoirs."""
        return int(np.random.default_rng([self.scenario.seed, 41]).integers(FEWEST, MOST + 1))

    def run(
        self, time: Floats, inflow: Floats, outflow: Floats | OperatorArrays, usual_flow: Floats,
        changes: Changes, start: float,
    ) -> tuple[Floats, Floats, Floats]:  # fmt: skip
        """Simulate the river, see the base class. The outflow is zero."""
        n, reach, mean = len(time), self.scenario.reach, self.scenario.flow.mean
        T = reach.sample_time
        steps = int(np.ceil(T / STEP))
        real = inflow if changes.inflow is None else np.asarray(changes.inflow, float)
        sides = np.array([np.broadcast_to(part.flow, (n,)) for part in changes.added]).reshape(-1, n)
        enters = np.array(
            [min(int(part.place * self.count), self.count - 1) for part in changes.added], np.int64
        )
        scale = reach.width * reach.depth * mean**-0.6 * reach.length / self.count
        out = np.empty(n)
        if not route(np.ascontiguousarray(real), sides, enters, steps, T / steps, scale, self.count, out):
            raise RividError("the river runs dry")
        return out, np.zeros(n), np.zeros(n)
