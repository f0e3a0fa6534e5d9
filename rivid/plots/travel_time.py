"""Froude number and travel time over the discharge: the bounds (5), the characteristic, and a simulation."""

from dataclasses import dataclass
from pathlib import Path

from rivid.plots import style
from rivid.types import Floats

MINUTE = 60.0


@dataclass(frozen=True, eq=False)
class TravelTimes:
    """What is drawn; arrays of shape (flows,).

    Attributes
    ----------
    flow : ndarray
        Discharge [m3/s].
    froude : ndarray
        F_o (4) [-].
    gravity, kinematic : ndarray
        Bounds (5) [s].
    characteristic, simulated : ndarray
        Arrival along the steady profile, and of a small step in the full equations [s].
    sample_time : float
        T_s [s].
    """

    flow: Floats
    froude: Floats
    gravity: Floats
    kinematic: Floats
    characteristic: Floats
    simulated: Floats
    sample_time: float


def draw(times: TravelTimes, path: Path) -> None:
    """Draw both panels as a PNG.

    Parameters
    ----------
    times : TravelTimes
    path : Path
        Its directory is made where it is missing.
    """
    from matplotlib.backends.backend_agg import FigureCanvasAgg
    from matplotlib.figure import Figure

    from rivid.atomic import replacing

    with style.styled():
        figure = Figure(figsize=(style.WIDTH, 5.4), dpi=style.DPI)
        FigureCanvasAgg(figure)
        upper = figure.add_axes((0.08, 0.72, 0.82, 0.2))
        lower = figure.add_axes((0.08, 0.1, 0.82, 0.54), sharex=upper)
        upper.plot(times.flow, times.froude, color=style.INK, lw=1.6)
        upper.set_ylabel("Froude number")
        upper.set_ylim(0, 1.15 * float(times.froude.max()))
        upper.grid(True, axis="y")
        upper.tick_params(labelbottom=False)
        T = times.sample_time
        lower.plot(times.flow, times.gravity / T, color=style.WATER, lw=1.4)
        lower.plot(times.flow, times.characteristic / T, color=style.INK, lw=1.8)
        lower.plot(times.flow, times.simulated / T, "o", color=style.ACCENT, ms=5, mfc="none", mew=1.3)
        top = 1.6 * float(max(times.characteristic.max(), times.gravity.max())) / T
        lower.set_ylim(0, top)
        lower.plot(times.flow, times.kinematic / T, color=style.WATER, lw=1.4, ls="--")
        lower.grid(True, axis="y")
        lower.set_xlim(times.flow[0], times.flow[-1])
        lower.set_xlabel("discharge [m3/s]")
        lower.set_ylabel(f"travel time [samples of {T:g} s]")
        minutes = lower.twinx()
        minutes.set_ylim(0, top * T / MINUTE)
        minutes.set_ylabel("[min]")
        minutes.spines["top"].set_visible(False)
        at = len(times.flow) // 3
        x = times.flow[at]
        lower.annotate(
            "gravity wave, lower bound (5)", (x, times.gravity[at] / T), (0, -16), textcoords="offset points",
            color=style.WATER, ha="left",
        )  # fmt: skip
        lower.annotate(
            "along the steady profile (line), small step in the full equations (circles)",
            (x, times.characteristic[at] / T), (0, 14), textcoords="offset points", color=style.INK,
        )  # fmt: skip
        shown = times.kinematic / T < top
        told = f"kinematic wave, upper bound (5): {times.kinematic.max() / T:.0f} samples"
        told += f" at {times.flow[0]:.0f} m3/s"
        if shown.any():
            told += f", {times.kinematic[-1] / T:.0f} at {times.flow[-1]:.0f}"
        lower.text(0.99, 0.97, told, transform=lower.transAxes, ha="right", va="top", color=style.WATER)
        figure.text(0.08, 0.955, "How fast a wave comes down the reach", fontsize=11, weight="bold")
        with replacing(path) as scratch:
            figure.savefig(scratch, format="png", metadata={"Software": None})
