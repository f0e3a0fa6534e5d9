"""The gap: how far the simulation is from the measurement after an hour, four, and a day.

At an origin the state of the noise is what the filter knows; from there the simulation runs on its own. So
the gap is what a forecast without further readings would miss.
"""

from typing import NamedTuple

import numpy as np
from numpy.typing import ArrayLike

from rivid.diagnosis.data import Record
from rivid.diagnosis.noise import NoiseModel
from rivid.types import Floats

HOURS = (1.0, 4.0, 24.0)
"""Horizons [h]."""
EVERY = 27
"""Samples between origins: about an hour at 133 s."""
START = 12
"""Samples before the first origin of a row: half an hour in which the filter finds the level."""


class DayErrors(NamedTuple):
    """Squared errors, shape (horizons, days): their sum over a day's origins, and how many there are."""

    squares: Floats
    counts: Floats

    def rmse(self, days: ArrayLike | None = None) -> Floats:
        """Root mean square error of each horizon over some days, shape (horizons,); NaN without origins."""
        chosen = slice(None) if days is None else np.asarray(days)
        counts = self.counts[:, chosen].sum(axis=1)
        squares = self.squares[:, chosen].sum(axis=1)
        means = np.divide(squares, counts, out=np.full(len(counts), np.nan), where=counts > 0)
        return np.asarray(np.sqrt(means))

    def mean_squares(self) -> Floats:
        """Mean square error of each horizon and day, shape (horizons, days); NaN without origins."""
        full = np.full(self.counts.shape, np.nan)
        return np.asarray(np.divide(self.squares, self.counts, out=full, where=self.counts > 0))


def residual_of(record: Record, baseline: Floats) -> Floats:
    """Measured less simulated, NaN where nothing was measured; shape (days, n)."""
    return np.where(np.isfinite(record.output), record.output - baseline, np.nan)


def day_errors(
    record: Record, residual: Floats, noise: NoiseModel, hours: tuple[float, ...] = HOURS
) -> DayErrors:
    """Errors of the simulation at each horizon.

    Parameters
    ----------
    record : Record
    residual : ndarray, shape (days, n)
        From :func:`residual_of`; of days that another precedes the lead time counts as origin, so that a
        day's horizon reaches across midnight.
    noise : NoiseModel
    hours : tuple of float
        Horizons [h].

    Returns
    -------
    DayErrors
        A target counts only where the record says that it is used.
    """
    days, n = residual.shape
    squares, counts = np.zeros((len(hours), days)), np.zeros((len(hours), days))
    for i, horizon in enumerate(hours):
        steps = max(round(horizon * 3600.0 / record.sample_time), 1)
        first = min(START, n - steps - 1)
        if first < 0:
            continue
        every = EVERY if steps < n // 2 else max(EVERY // 3, 1)
        errors = noise.forecast_errors(residual, steps, every=every, first=first)
        targets = np.arange(first, n - steps, every) + steps
        known = np.isfinite(errors) & record.used[:, targets]
        squares[i] = np.where(known, errors**2, 0.0).sum(axis=1)
        counts[i] = known.sum(axis=1)
    return DayErrors(squares, counts)
