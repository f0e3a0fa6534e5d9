"""Compute numbers of sections II and VI of the paper from a simulated season and its true delays."""

from dataclasses import dataclass

import numpy as np

from rivid.simulation import Season
from rivid.types import Floats

ORDER = 30
"""Columns of U for the condition number."""


@dataclass(frozen=True)
class Observables:
    """Numbers of sections II and VI. All but the delays are computed from the logs."""

    days: int  # with data
    discharge_lowest: float  # extremes of the daily mean discharge at the downstream dam [m3/s]
    discharge_highest: float
    below_500: float  # share of days with a mean discharge below 500 m3/s
    discharge_range: float  # mean over days of the daily peak-to-peak discharge [m3/s]
    level_range: float  # mean over days of the daily peak-to-peak level [m]
    level_drop: float  # median daily level less the mean of the tenth of days with the highest discharge [m]
    condition_median: float  # condition number of U'U
    condition_high: float  # 95 % of days are below it
    delays: dict[int, int]  # days of each true delay [samples]

    def table(self) -> str:
        """Format the numbers and those of the paper as a Markdown table."""
        delays = ", ".join(f"{d}: {n} days" for d, n in self.delays.items())
        rows = [
            ("days", "332", f"{self.days}"),
            ("mean daily discharge", "about 100 to 800 m3/s",
             f"{self.discharge_lowest:.0f} to {self.discharge_highest:.0f} m3/s"),
            ("days below 500 m3/s", "most", f"{self.below_500:.0%}"),
            ("discharge over a day, peak to peak", "about 150 m3/s in the mean",
             f"{self.discharge_range:.0f} m3/s"),
            ("level over a day, peak to peak", "about 0.2 m in the mean", f"{self.level_range:.2f} m"),
            ("level at the highest flows", "down peaks", f"{self.level_drop:.2f} m below the median"),
            ("condition number of U'U", "typically 2e4, up to 1e5",
             f"median {self.condition_median:.1e}, 95 % of days below {self.condition_high:.1e}"),
            ("delay d", "6 or 7 samples, as estimated", delays),
        ]  # fmt: skip
        lines = ["| | paper | here |", "|---|---|---|", *(f"| {a} | {b} | {c} |" for a, b, c in rows)]
        return "\n".join(lines) + "\n"


def observables(season: Season) -> Observables:
    """Compute the observables of a season."""
    discharge = season.outflow.mean(axis=1)
    mean_level = np.nanmean(season.level, axis=1)
    high = discharge >= np.quantile(discharge, 0.9)
    condition = condition_numbers(season.inflow)
    delays, counts = np.unique(season.delay, return_counts=True)
    return Observables(
        days=len(season.dates),
        discharge_lowest=float(discharge.min()),
        discharge_highest=float(discharge.max()),
        below_500=float((discharge < 500).mean()),
        discharge_range=float(np.ptp(season.outflow, axis=1).mean()),
        level_range=float((np.nanmax(season.level, axis=1) - np.nanmin(season.level, axis=1)).mean()),
        level_drop=float(np.median(mean_level) - mean_level[high].mean()),
        condition_median=float(np.median(condition)),
        condition_high=float(np.quantile(condition, 0.95)),
        delays={int(d): int(n) for d, n in zip(delays, counts, strict=True)},
    )


def condition_numbers(inflow: Floats, order: int = ORDER) -> Floats:
    """Return the condition number of U'U of each day, shape (days,).

    The M = `order` columns of U are lags of the inflow [m3/s], shape (days, N), less its first sample.
    """
    u = inflow - inflow[:, :1]
    columns = [np.pad(u[:, : u.shape[1] - j], ((0, 0), (j, 0))) for j in range(order)]
    U = np.stack(columns, axis=-1)
    return np.asarray(np.linalg.cond(U.swapaxes(1, 2) @ U))
