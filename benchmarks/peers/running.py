"""Run all peers and `posterior` in turn on the same days, each peer first on easy days."""

import importlib.util
import time
from dataclasses import dataclass, field

import numpy as np
from numpy.typing import NDArray

from benchmarks.peers import arx, change, crosscorrelation, frols, impulse
from benchmarks.peers.signals import Floats, Ints, Peer, easy_days
from benchmarks.posterior.worlds import World, worlds
from rivid.core.fir import jmap
from rivid.core.posterior.daily import posterior
from rivid.core.settings import JmapSettings
from rivid.errors import RividError

CANDIDATES = np.arange(1, 16)
POSTERIOR = "posterior"
LEAST_EASY = 0.95
"""Share of the easy days that a peer must estimate exactly. A peer below it is faulty and cannot be
compared."""


def by_posterior(u: Floats, y: Floats, o: Floats, candidates: Ints) -> Ints:
    """Return the delay of highest probability, also on days that `posterior` refuses."""
    found = posterior(u, y, o)
    if not np.array_equal(found.candidates, candidates):
        raise RividError(f"candidates {candidates[0]} to {candidates[-1]}: expected those of the defaults")
    return np.asarray(candidates[np.argmax(np.nan_to_num(found.probability), axis=1)])


def by_table_vi(u: Floats, y: Floats, o: Floats, candidates: Ints) -> Ints:
    """Return the delay of Table VI with the paper's settings, which uses no outflow.

    Days without an answer get the first candidate.
    """
    found = jmap(u - u[:, :1], y - y[:, :1], JmapSettings(d_max=int(candidates[-1]))).delay
    return np.where(np.isfinite(found), found, candidates[0]).astype(np.intp)


PEERS: dict[str, Peer] = {
    "ARX(2,2) scan, as `delayest`": arx.delays,
    "FIR with kernel TC, as `impulseest`": impulse.tc,
    "FIR with kernel DC, as `impulseest`": impulse.dc,
    "prewhitened cross-correlation": crosscorrelation.delays,
    "`ruptures` on the ML FIR": change.delays,
    "FROLS of `sysidentpy`": frols.delays,
}
NEEDS = {change.delays: "ruptures", frols.delays: "sysidentpy"}
"""Packages of the extra `bench`, by method."""

OURS: dict[str, Peer] = {POSTERIOR: by_posterior, "Table VI": by_table_vi}


def installed() -> dict[str, Peer]:
    """Return the peers with all packages installed."""
    return {name: f for name, f in PEERS.items() if f not in NEEDS or importlib.util.find_spec(NEEDS[f])}


def share_of_easy_days(peer: Peer, days: int = 8) -> float:
    """Return the share of easy days, of a store and of a decaying level, with an exact delay."""
    found = [
        np.mean(peer(*easy_days(days, delay, seed=0, memory=memory), CANDIDATES) == delay)
        for delay in (2, 5, 9) for memory in (1.0, 0.9)
    ]  # fmt: skip
    return float(np.mean(found))


def check(peers: dict[str, Peer]) -> dict[str, float]:
    """Return the share of easy days of each peer.

    Raises
    ------
    RividError
        If a peer does not find the delay of easy days.
    """
    shares = {name: share_of_easy_days(peer) for name, peer in peers.items()}
    for name, share in shares.items():
        if share < LEAST_EASY:
            raise RividError(
                f"{name}: right on {share:.2f} of the easy days, expected {LEAST_EASY} or more: a bug"
            )
    return shares


@dataclass
class Tally:
    """Results of one method, a row for each world and seed.

    Attributes
    ----------
    world : list of str
    error : list of ndarray, shape (days,)
        Difference of the answer from the nearer right one [samples].
    ms : list of float
        Processor time [ms a day].
    """

    world: list[str] = field(default_factory=list)
    error: list[Ints] = field(default_factory=list)
    ms: list[float] = field(default_factory=list)

    def of(self, linear: bool) -> Ints:
        """Return the errors of the linear worlds, or of the others."""
        parts = [
            e for name, e in zip(self.world, self.error, strict=True) if name.startswith("linear") == linear
        ]
        return np.concatenate(parts)


@dataclass(frozen=True)
class Run:
    """Results of all methods on all days.

    Attributes
    ----------
    tallies : dict of Tally
    answered : ndarray of bool, shape (days,)
        Whether `posterior` answers; all worlds and seeds in the order of the tallies.
    constant : dict of bool to float
        Largest share of exact answers by one delay for all days, of the linear worlds and of the others.
    """

    tallies: dict[str, Tally]
    answered: NDArray[np.bool_]
    constant: dict[bool, float]


def errors(delay: Ints, world: World) -> Ints:
    """Return the absolute difference from the nearer right delay [samples]."""
    return np.minimum(np.abs(delay - world.delay), np.abs(delay - world.other))


def run(methods: dict[str, Peer], kind: str, seeds: range, days: int) -> Run:
    """Run all methods on each world in turn, so that load on the machine affects all of them equally."""
    tallies = {name: Tally() for name in methods}
    answered, truths = [], []
    for seed in seeds:
        for world in worlds(kind, seed, days):
            for name, method in methods.items():
                method(world.u[:2], world.y[:2], world.o[:2], CANDIDATES)  # compile before timing
                began = time.process_time()
                delay = method(world.u, world.y, world.o, CANDIDATES)
                tallies[name].ms.append(1000.0 * (time.process_time() - began) / len(world.u))
                tallies[name].world.append(world.name)
                tallies[name].error.append(errors(delay, world))
            answered.append(posterior(world.u, world.y, world.o).status == "ok")
            truths.append(world)
    constant = {
        linear: max(
            float(np.mean(np.concatenate([errors(np.full(len(w.u), d), w) == 0 for w in truths if w.name.startswith("linear") == linear])))
            for d in CANDIDATES
        )
        for linear in (True, False)
    }  # fmt: skip
    return Run(tallies, np.concatenate(answered), constant)
