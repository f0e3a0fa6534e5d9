"""The calibrated reach for other software: matrices with dead times, routing parameters, delays by discharge.

Each file states its origin: the days, the verdict, the version and the intervals of the parameters.
"""

import csv
import io
import json
from collections.abc import Callable
from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np
from scipy.linalg import block_diag, hankel

from rivid import __version__
from rivid.atomic import replacing, write_text
from rivid.diagnosis.calibrated import ReachModel, load_model, reached
from rivid.errors import ConfigError, NoDataError
from rivid.results.read import last_record, no_run, reaches_in
from rivid.results.season import settings_of
from rivid.results.store import finite
from rivid.text import duration
from rivid.types import DAY, HOUR, Floats

if TYPE_CHECKING:
    import control
    from scipy.signal import StateSpace as ScipyStateSpace

LONGEST = 2.0 * DAY
"""Length of the step responses that are realised [s]."""
STARTED = 1e-3
"""Share of the largest response before which it is dead time."""
KEPT = 2e-3
"""Least Hankel singular value that is kept, over the largest: the step response is off by about as much."""
MOST_STATES = 12
"""Most states of one response, dead time aside."""


@dataclass(frozen=True, eq=False)
class StateSpace:
    """A discrete linear model of a reach about its usual flow, with dead times as states.

    ``x[k+1] = A x[k] + B u[k] + G e[k]``, ``y[k] = C x[k] + D u[k] + v[k]``; u and y are deviations from
    `operating`.
    """

    A: Floats  #: (n, n)
    B: Floats  #: (n, p): inputs u_Qi and, of a pool, u_Qo [m3/s]
    C: Floats  #: (1, n): output h_L [m] or Q_L [m3/s]
    D: Floats  #: (1, p)
    G: Floats  #: (n, q): how the process noise enters
    Q: Floats  #: (q, q): covariance of e, by sample
    R: Floats  #: (1, 1): covariance of v, by sample
    sample_time: float  #: T_s [s]
    inputs: tuple[str, ...]  #: names
    outputs: tuple[str, ...]  #: names
    states: tuple[str, ...]  #: names; states `u_Qi[k-3]` are dead time
    delays: tuple[int, ...]  #: dead time of each input [samples]
    operating: dict[str, float]  #: usual level [m] or discharge, and flow [m3/s]
    origin: dict[str, Any]  #: where the model comes from

    @property
    def units(self) -> dict[str, str]:
        """Unit of each input and output."""
        return {name: "m" if name == "h_L" else "m3/s" for name in (*self.inputs, *self.outputs)}

    def to_scipy(self) -> "ScipyStateSpace":
        """As :class:`scipy.signal.StateSpace`, without the noise."""
        from scipy.signal import StateSpace as Made

        return Made(self.A, self.B, self.C, self.D, dt=self.sample_time)

    def to_control(self) -> "control.StateSpace":
        """As :class:`control.StateSpace` of python-control, if that is installed, without the noise."""
        try:
            import control
        except ImportError:
            raise ConfigError("python-control is not installed: pip install control") from None
        return control.ss(
            self.A, self.B, self.C, self.D, self.sample_time, inputs=list(self.inputs),
            outputs=list(self.outputs), states=list(self.states),
        )  # fmt: skip

    def arrays(self) -> dict[str, Any]:
        """All of it as arrays and texts, for .npz and .mat."""
        about = json.dumps(self.origin | {"operating": self.operating, "units": self.units}, default=str)
        return {
            "A": self.A, "B": self.B, "C": self.C, "D": self.D, "G": self.G, "Q": self.Q, "R": self.R,
            "sample_time": self.sample_time, "inputs": list(self.inputs), "outputs": list(self.outputs),
            "states": list(self.states), "delays": np.array(self.delays), "about": about,
        }  # fmt: skip


def state_space(model: ReachModel) -> StateSpace:
    """Realise a calibrated reach about its usual flow, as a :class:`StateSpace`.

    The response to each flow is its dead time, a chain of states, and then the balanced realisation of its
    impulse response (Ho and Kalman 1966; Kung 1978). A pool's level keeps what has flowed in: its response
    ends in an integrator of its own.
    """
    T, pool = model.sample_time, model.kind == "pool"
    steps = model.kernels(round(LONGEST / T) + 1)
    responses = [steps["up"], steps["down"]] if pool else [steps["up"]]
    inputs = ("u_Qi", "u_Qo") if pool else ("u_Qi",)
    names, delays, blocks = list[str](), [], []
    for name, response in zip(inputs, responses, strict=True):
        dead, (a, b, c) = _realised(np.diff(response, prepend=0.0), pool)
        A = block_diag(np.eye(dead, k=-1), a)
        B, C = np.append(np.zeros(dead), b), np.append(np.zeros(dead), c)
        if dead:
            A[dead:, dead - 1], B[:] = b, np.eye(len(A))[0]
        blocks.append((A, B[:, None], C[None]))
        names += [f"{name}[k-{lag}]" for lag in range(1, dead + 1)]
        names += [f"{name} state {j + 1}" for j in range(len(a))]
        delays.append(dead)
    noise, m = model.noise, model.noise.system()
    # x gathers the unlogged inflow w, or is it after its way along a river; s is a noise of the level
    extra = np.array([[m.rho, m.c, 0.0], [0.0, m.phi, 0.0], [0.0, 0.0, m.psi]])
    variance = noise.innovation()
    kept = np.array([True, m.inflow > 0.0, pool and (noise.level_sd > 0.0 or noise.wave > 0.0)])
    extra, variance = extra[np.ix_(kept, kept)], variance[np.ix_(kept, kept)]
    level = "level" if pool else "discharge"
    own = ("level error" if pool else "discharge noise", "unlogged inflow", "level noise")
    names += [name for name, k in zip(own, kept, strict=True) if k]
    A = block_diag(*(a for a, _, _ in blocks), extra)
    B = np.vstack([block_diag(*(b for _, b, _ in blocks)), np.zeros((len(extra), len(blocks)))])
    C = np.hstack([*(c for _, _, c in blocks), [np.array([1.0, 0.0, 1.0])[kept]]])
    G = np.eye(len(A))[:, len(A) - len(extra) :]
    return StateSpace(
        A, B, C, np.zeros((1, len(blocks))), G, variance, np.array([[m.gauge]]), T, inputs,
        ("h_L",) if pool else ("Q_L",), tuple(names), tuple(delays),
        {level: model.model.level, "flow": model.model.flow}, _origin(model),
    )  # fmt: skip


def _realised(impulse: Floats, integrates: bool) -> tuple[int, tuple[Floats, Floats, Floats]]:
    """Dead time [samples], and A, b, c of the rest of an impulse response (n,), its first value at lag 0.

    What a flow does within its own sample comes out at the next one: the output is read before the flow of
    its sample has passed.
    """
    seen = np.abs(impulse) >= STARTED * np.abs(impulse).max()
    dead = max(int(np.argmax(seen)) - 1, 0)
    rest = impulse[dead + 1 :]
    last = float(rest[-max(len(rest) // 8, 1) :].mean()) if integrates else 0.0
    decaying = rest - last
    half = len(decaying) // 2
    U, sizes, V = np.linalg.svd(hankel(decaying[:half], decaying[half - 1 : 2 * half - 1]))
    order = min(max(int((sizes > KEPT * sizes[0]).sum()), 1), MOST_STATES)
    root = np.sqrt(sizes[:order])
    left, right = U[:, :order] * root, root[:, None] * V[:order]
    roots, modes = np.linalg.eig(np.linalg.pinv(left[:-1]) @ left[1:])
    # the response ends before such a mode has decayed, and noise makes it grow: it decays over that length
    roots *= np.minimum(1.0, (1.0 - 1.0 / len(rest)) / np.maximum(np.abs(roots), 1e-12))
    a, b = np.real(modes @ np.diag(roots) @ np.linalg.inv(modes)), right[:, 0]
    states = [b]
    for _ in rest[1:]:
        states.append(a @ states[-1])
    c = np.linalg.lstsq(np.array(states), decaying, rcond=None)[0]
    if integrates:
        a = block_diag(a, [1.0])
        b, c = np.append(b, last), np.append(c, 1.0)
    return dead, (a, b, c)


def routing(model: ReachModel) -> dict[str, float]:
    """Parameters of RTC-Tools' routing blocks: `IDZ` of a pool, `LagAndK` of a river; SI units.

    From the step responses. A pool: delay of the inflow, area Ad and the level's first rise p21 and p22
    (integrator-delay-zero, Litrico and Fromion 2004). A river: the lag until its front, and K so that the
    mean travel time is right.
    """
    T = model.sample_time
    steps = model.kernels(round(LONGEST / T) + 1)
    time = T * np.arange(len(steps["up"]))
    if model.kind == "river":
        up = steps["up"] / steps["up"][-1]
        front = reached(up, 0.1) * T
        mean = float(np.trapezoid(1.0 - up, dx=T))
        return {"Lag_parameter": front, "K_parameter": max(mean - front, 0.0), "gain": float(steps["up"][-1])}
    late = time >= 0.5 * time[-1]
    slope, begin = np.polyfit(time[late], steps["up"][late], 1)
    delay = model.half_time
    _, down = np.polyfit(time[late], steps["down"][late], 1)
    return {
        "delay": delay, "Ad": 1.0 / float(slope), "p21": float(begin + slope * delay), "p22": -float(down),
    }  # fmt: skip


def _origin(model: ReachModel) -> dict[str, Any]:
    return {"reach": model.name, "written_by": f"rivid {__version__}"} | model.origin


def _state_space(source: Path, out: Path, _: float) -> list[Path]:
    import scipy.io

    arrays = state_space(load_model(source)).arrays()
    with replacing(out / "state_space.npz") as partial, open(partial, "wb") as file:
        np.savez(file, **arrays)
    with replacing(out / "state_space.mat") as partial:
        scipy.io.savemat(str(partial), arrays, appendmat=False)
    values = {k: v.tolist() if isinstance(v, np.ndarray) else v for k, v in arrays.items()}
    values["about"] = json.loads(arrays["about"])
    write_text(out / "state_space.json", json.dumps(values, indent=1) + "\n")
    return [out / f"state_space.{kind}" for kind in ("npz", "mat", "json")]


def _rtc_tools(source: Path, out: Path, _: float) -> list[Path]:
    model = load_model(source)
    found = routing(model)
    block = model.name.replace("-", "_")
    values = {f"{block}.{k}": f"{v:.10g}" for k, v in found.items() if k not in ("gain", "delay")}
    write_text(out / "parameters.csv", ",".join(values) + "\n" + ",".join(values.values()) + "\n")
    about = {"block": "IDZ" if model.kind == "pool" else "LagAndK", "values": found} | _origin(model)
    write_text(out / "parameters.json", json.dumps(about, indent=1, default=str) + "\n")
    return [out / "parameters.csv", out / "parameters.json"]


def law_of(source: Path) -> tuple[list[dict[str, float]], dict[str, Any]]:
    """Rows of delay_law.csv, discharge classes [m3/s] and their travel times [s]; and delay_law.json.

    NoDataError where `rivid season` has not written it; ConfigError where the last run has another reach or
    other settings.
    """
    try:
        texts = [(source / f"delay_law.{kind}").read_text(encoding="utf-8") for kind in ("csv", "json")]
    except OSError as error:
        if reaches_in(source):
            raise no_run(source) from None
        raise NoDataError(
            f"{error.filename} cannot be read: expected the directory of a run that `rivid season` has joined"
        ) from None
    rows = list(csv.DictReader(io.StringIO(texts[0])))
    found = [{key: float(value) for key, value in row.items() if value} for row in rows]
    about = json.loads(texts[1])
    run = last_record(source)
    if run and settings_of(run) != about.get("settings", settings_of(run)):
        raise ConfigError(
            f"{source}: its law (of {about['reach']}, {about['first']} to {about['last']}) is older than its "
            f"last run (of {run['reach']}), with other settings: run `rivid season {source}` first"
        )
    if not found:
        raise NoDataError(f"{source}: no law of delay and discharge: {about['message']}")
    return found, about


def unresolved(source: Path, snapshot: float = HOUR) -> str:
    """Remark on the delays of a law that round to 0 snapshots of so many seconds; empty where none does."""
    delays = [row["delay_s"] for row in law_of(source)[0]]
    gone = [delay for delay in delays if round(delay / snapshot) == 0]
    if not gone:
        return ""
    return (
        f"delay = 0 in {len(gone)} of {len(delays)} links: {duration([min(gone), max(gone)])} round to 0 "
        f"snapshots of {snapshot:g} s; give a shorter --snapshot"
    )


def _pypsa(source: Path, out: Path, snapshot: float) -> list[Path]:
    """links.csv for `pypsa.Network.import_from_csv_folder`: a link for each class of discharge.

    A link carries the part of the flow in its class: their capacities add up to the highest discharge, as in
    multilinear routing (Becker and Kundzewicz 1987, Water Resources Research 23). PyPSA counts
    delays in units of the weightings of snapshots, as integers.
    """
    rows, about = law_of(source)
    name, below = about["reach"], 0.0
    lines = ["name,bus0,bus1,carrier,efficiency,p_nom,delay,cyclic_delay,delay_low_h,delay_high_h"]
    for row in rows:
        low, high = row["discharge_low_m3s"], row["discharge_high_m3s"]
        delay = round(row["delay_s"] / snapshot)
        ends = f"{row['delay_low_s'] / HOUR:.4g},{row['delay_high_s'] / HOUR:.4g}"
        lines.append(
            f"{name} {low:.0f}-{high:.0f} m3/s,{name} upstream,{name} downstream,water,1,{high - below:.6g},"
            f"{delay},False,{ends}"
        )
        below = high
    write_text(out / "links.csv", "\n".join(lines) + "\n")
    buses = [f"{name} {end},water" for end in ("upstream", "downstream")]
    write_text(out / "buses.csv", "\n".join(["name,carrier", *buses]) + "\n")
    return [out / "links.csv", out / "buses.csv"]


def _csv(source: Path, out: Path, _: float) -> list[Path]:
    rows, about = law_of(source)
    lines = [",".join(rows[0]), *(",".join(f"{v:.6g}" for v in row.values()) for row in rows)]
    write_text(out / "delay_by_discharge.csv", "\n".join(lines) + "\n")
    made = finite(about) | {"written_by": f"rivid {__version__}"}
    write_text(out / "delay_by_discharge.json", json.dumps(made, indent=1) + "\n")
    return [out / "delay_by_discharge.csv", out / "delay_by_discharge.json"]


FORMATS: dict[str, Callable[[Path, Path, float], list[Path]]] = {
    "state-space": _state_space, "rtc-tools": _rtc_tools, "pypsa": _pypsa, "csv": _csv,
}  # fmt: skip
"""Writers: of model.toml the first two, of a season's law the others."""


def export(source: Path, out: Path, form: str, snapshot: float = HOUR) -> list[Path]:
    """Write a model or a law in a format of :data:`FORMATS` into `out`, which is created; return the files.

    `source` is as of `rivid export`, `snapshot` the unit of the delays of `pypsa` [s]. RividError where the
    source lacks what the format needs, or a file cannot be written.
    """
    out.mkdir(parents=True, exist_ok=True)
    return FORMATS[form](source, out, snapshot)
