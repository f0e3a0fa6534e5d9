"""The fitted model and what might be added to it, as least squares about the observed course.

Near the fit, the residual of a model with further columns is

    z' = z - J b - C c,

J the response's parameters (with their priors), C the columns of a candidate. Noise and day weights are
refitted with it, so that a candidate competes with an unknown inflow that shrinks as it explains more.
"""

from dataclasses import dataclass, replace

import numpy as np

from rivid.diagnosis.blocks import Split
from rivid.diagnosis.data import Record
from rivid.diagnosis.gap import DayErrors, day_errors
from rivid.diagnosis.noise import NoiseModel, day_weights, fit_noise
from rivid.types import Floats

ODD = 4.0
"""A day counts for at most so many times the usual day's gain."""
REFITS = 2
"""Turns of least squares and noise for a candidate."""


@dataclass(frozen=True, eq=False)
class Linear:
    """A model about which candidates are tried.

    Attributes
    ----------
    record : Record
    split : Split
    residual : ndarray, shape (days, n)
        Measured less simulated; NaN where nothing was measured.
    columns : ndarray, shape (p, days, n)
        The response's parameters: change of the simulated output for one unit of each.
    prior_sd, deviation : ndarray, shape (p,)
        Prior standard deviation of each, and where it stands now above its prior's middle.
    noise : NoiseModel
    gauge_floor : float
        Lower limit of the gauge noise [m or m3/s].
    level_noise : bool
        Whether the noise has a level part (wind).
    """

    record: Record
    split: Split
    residual: Floats
    columns: Floats
    prior_sd: Floats
    deviation: Floats
    noise: NoiseModel
    gauge_floor: float
    level_noise: bool = False

    def used(self, residual: Floats) -> Floats:
        """A residual with NaN where the record does not count."""
        return np.where(self.record.used, residual, np.nan)

    def less(self, columns: Floats) -> "Linear":
        """The same with columns taken off the residual (shape (days, n))."""
        return replace(self, residual=self.residual - columns)


@dataclass(frozen=True, eq=False)
class Evaluation:
    """What the model would be with some columns in.

    Attributes
    ----------
    coefficients : ndarray, shape (k,)
        Of the columns.
    standard_errors : ndarray, shape (k,)
    shift, shift_errors : ndarray, shape (p,)
        What the response's parameters move by, and the standard errors of where they are.
    residual : ndarray, shape (days, n)
    noise : NoiseModel
    likelihood : ndarray, shape (days,)
        Log-likelihood of each day.
    penalty : float
        Half the squared deviations of the response's parameters from their priors, in standard deviations.
    errors : DayErrors
    weights : ndarray, shape (days,)
    """

    coefficients: Floats
    standard_errors: Floats
    shift: Floats
    shift_errors: Floats
    residual: Floats
    noise: NoiseModel
    likelihood: Floats
    penalty: float
    errors: DayErrors
    weights: Floats


def least_squares(
    model: Linear, columns: Floats | None, noise: NoiseModel, weights: Floats
) -> tuple[Floats, Floats, Floats]:
    """Coefficients of response and candidate, (p + k,), their standard errors, and the residual with them.

    Parameters
    ----------
    model : Linear
    columns : ndarray of shape (k, days, n), or None
    noise : NoiseModel
    weights : ndarray, shape (days,)
        Days that do not fit count for nothing whatever their weight.
    """
    p = len(model.columns)
    C = model.columns if columns is None else np.concatenate([model.columns, columns])
    z = model.used(model.residual)
    rows = model.split.fit
    root = np.sqrt(weights[rows])[:, None]
    X = (noise.whiten(C[:, rows], like=z[rows]) * root).reshape(len(C), -1)
    r = (noise.whiten(z[rows]) * root).ravel()
    scale = np.maximum(np.sqrt((X * X).mean(axis=1)), 1e-9)  # a column may do nothing on these days
    X /= scale[:, None]
    G, g = X @ X.T, X @ r
    prior = 1.0 / (model.prior_sd * scale[:p]) ** 2
    G[np.arange(p), np.arange(p)] += prior
    g[:p] -= prior * model.deviation * scale[:p]
    G[np.diag_indices(len(G))] += 1e-9 * np.diag(G) + 1e-12  # columns that are nearly one, or nothing
    inverse = np.linalg.inv(G)
    b = inverse @ g / scale
    left = (r - X.T @ (b * scale)).reshape(rows.sum(), -1)
    block = np.unique(model.split.block[rows], return_inverse=True)[1]
    daily = np.einsum("jdn,dn->dj", X.reshape(len(C), *left.shape), left)
    scores = np.zeros((block.max() + 1, len(C)))
    np.add.at(scores, block, daily)
    scatter = inverse @ (scores.T @ scores) @ inverse  # what the blocks show, where they scatter more
    error = np.sqrt(np.maximum(np.maximum(np.diag(inverse), np.diag(scatter)), 0.0)) / scale
    return b, error, model.residual - np.tensordot(b, C, 1)


def evaluate(
    model: Linear,
    columns: Floats | None = None,
    *,
    level_noise: bool | None = None,
    walk_limit: float | None = None,
    thorough: bool = False,
) -> Evaluation:
    """Refit response, columns and noise on the fitting days, and look at all days.

    Parameters
    ----------
    model : Linear
    columns : ndarray of shape (k, days, n), or None
        None: the model as it is.
    level_noise : bool, optional
        Another noise than the model's.
    walk_limit : float, optional
        Upper limit of the level's random walk [m per sample].
    thorough : bool
        Whether the noise is fitted from all starts: a candidate that is a slow flow may leave a noise that
        is far from the one that had to stand for it.

    Returns
    -------
    Evaluation
    """
    record, fit = model.record, model.split.fit
    level = model.level_noise if level_noise is None else level_noise
    noise = model.noise
    weights = np.ones(record.days)  # a candidate may be what makes a day noisy
    if columns is None:
        weights = day_weights(noise.whiten(model.used(model.residual)))
    for turn in range(REFITS):
        *_, left = least_squares(model, columns, noise, weights)
        seen = model.used(left)
        noise = fit_noise(
            seen[fit], record.sample_time, noise.surface_area, weights=weights[fit], level=level,
            gauge_floor=model.gauge_floor, starts=(noise,), walk_limit=walk_limit,
            alone=(turn == 0 or not thorough) and level == model.level_noise and walk_limit is None,
        )  # fmt: skip
        weights = day_weights(noise.whiten(seen))
    b, error, left = least_squares(model, columns, noise, weights)
    p = len(model.columns)
    shift = b[:p]
    moved = (model.deviation + shift) / model.prior_sd
    return Evaluation(
        b[p:], error[p:], shift, error[:p], left, noise, noise.log_likelihood(model.used(left)),
        0.5 * float(moved @ moved), day_errors(record, left, noise), weights,
    )  # fmt: skip


def limited(gain: Floats) -> Floats:
    """What days gain [nats], odd ones limited; shape (days,)."""
    usual = ODD * float(np.median(np.abs(gain))) + 5.0
    return np.asarray(np.clip(gain, -usual, usual))
