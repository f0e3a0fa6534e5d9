"""All peers and `posterior` on the same days, one after the other; each peer first on days that are easy."""

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
"""Share of the easy days that a peer must get right, else it is broken and its other figures mean nothing."""


def by_posterior(u: Floats, y: Floats, o: Floats, candidates: Ints) -> Ints:
    """The delay of highest probability, whether `posterior` would answer or not."""
    found = posterior(u, y, o)
    if not np.array_equal(found.candidates, candidates):
        raise RividError(f"candidates {candidates[0]} to {candidates[-1]}: expected those of the defaults")
    return np.asarray(candidates[np.argmax(np.nan_to_num(found.probability), axis=1)])


def by_table_vi(u: Floats, y: Floats, o: Floats, candidates: Ints) -> Ints:
    """Table VI with the paper's settings, which knows no outflow; the first candidate where it has no answer."""
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
"""Packages of the extra `bench`."""

OURS: dict[str, Peer] = {POSTERIOR: by_posterior, "Table VI": by_table_vi}


def installed() -> dict[str, Peer]:
    """The peers whose packages are here."""
    return {name: f for name, f in PEERS.items() if f not in NEEDS or importlib.util.find_spec(NEEDS[f])}


def share_of_easy_days(peer: Peer, days: int = 8) -> float:
    """Share of easy days, of a store and of a level that forgets, whose delay a peer finds exactly."""
    found = [
        np.mean(peer(*easy_days(days, delay, seed=0, memory=memory), CANDIDATES) == delay)
        for delay in (2, 5, 9) for memory in (1.0, 0.9)
    ]  # fmt: skip
    return float(np.mean(found))


def check(peers: dict[str, Peer]) -> dict[str, float]:
    """The share of each peer.

    Raises
    ------
    RividError
        Where one does not find the delay even here.
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
    """What one method did: a row for each world and seed.

    Attributes
    ----------
    world : list of str
    error : list of ndarray, shape (days,)
        Samples between the answer and the nearer right one.
    ms : list of float
        Processor time [ms a day].
    """

    world: list[str] = field(default_factory=list)
    error: list[Ints] = field(default_factory=list)
    ms: list[float] = field(default_factory=list)

    def of(self, linear: bool) -> Ints:
        """Errors of the linear worlds, or of the others."""
        parts = [
            e for name, e in zip(self.world, self.error, strict=True) if name.startswith("linear") == linear
        ]
        return np.concatenate(parts)


@dataclass(frozen=True)
class Run:
    """All methods on all days, and what `posterior` would not answer.

    Attributes
    ----------
    tallies : dict of Tally
    answered : ndarray of bool, shape (days,)
        Of all worlds and seeds in the order of the tallies.
    constant : dict of bool to float
        Best share exact that one delay for all days has, of the linear worlds and of the others.
    """

    tallies: dict[str, Tally]
    answered: NDArray[np.bool_]
    constant: dict[bool, float]


def errors(delay: Ints, world: World) -> Ints:
    """Samples from the nearer right answer."""
    return np.minimum(np.abs(delay - world.delay), np.abs(delay - world.other))


def run(methods: dict[str, Peer], kind: str, seeds: range, days: int) -> Run:
    """Every method on every world, in turn, so that a slow minute of the machine meets all of them."""
    tallies = {name: Tally() for name in methods}
    answered, truths = [], []
    for seed in seeds:
        for world in worlds(kind, seed, days):
            for name, method in methods.items():
                method(world.u[:2], world.y[:2], world.o[:2], CANDIDATES)  # compiled and cached
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
