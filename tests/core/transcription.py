"""Tables V and VI as printed in the paper, one day and one candidate at a time.

The code is slow and independent: it builds every matrix and computes every residual. The only optimisation is
that U'U is computed once a day. It shares nothing with rivid.core except numpy.
"""

import numpy as np
from scipy.linalg import toeplitz


def toeplitz_matrix(u, order):
    """Return U of (16)."""
    return toeplitz(u, np.r_[u[0], np.zeros(order - 1)])


def second_differences(order):
    """Return D: lower-triangular Toeplitz, first column (1, -2, 1, 0, ...)."""
    column = np.zeros(order)
    column[:3] = 1.0, -2.0, 1.0
    return toeplitz(column, np.r_[1.0, np.zeros(order - 1)])


def jump_matrix(order, d):
    """Return D_d (24): rows with a stencil across one of the two jumps are zero."""
    D = second_differences(order)
    for row in (0, 1, 2, d + 1, d + 2):
        D[row] = 0.0
    return D


def table_v(u, y, order, delays, alpha):
    """Return delay, FIR and criterion (28) with the uniform prior and a fixed alpha."""
    U = toeplitz_matrix(u, order)
    fits = []
    for d in delays:
        D_d = jump_matrix(order, d)
        h = np.linalg.solve(U.T @ U + alpha * D_d.T @ D_d, U.T @ y)
        fits.append((np.sum((y - U @ h) ** 2) + alpha * np.sum((D_d @ h) ** 2), d, h))
    criterion = np.array([J for J, _, _ in fits])
    _, d, h = fits[int(np.argmin(criterion))]
    return d, h, criterion


def table_vi(
    u, y, order, delays, sigma_d=6.5, d_init=10, epsilon=1e-3, inverse_gamma=True, alpha_cap=np.inf, most=200
):
    """Return delay, FIR, criterion (35), variances and number of iterations; sigma_d None: uniform."""
    N, M = len(y), order
    U = toeplitz_matrix(u, M)
    UtU, Uty = U.T @ U, U.T @ y
    h = np.linalg.solve(UtU, Uty)
    alpha_h = M / 2 if inverse_gamma else -1.0
    beta_h = np.sum((second_differences(M) @ h) ** 2) / 2 if inverse_gamma else 0.0
    d, before = d_init, None
    iteration = 0
    while iteration < most:
        iteration += 1
        s_h = (np.sum((jump_matrix(M, d) @ h) ** 2) + 2 * beta_h) / (M + 2 * (alpha_h + 1))
        s_w = np.sum((y - U @ h) ** 2) / N
        s_h = max(s_h, s_w / alpha_cap)
        criterion, candidates = [], []
        for c in delays:
            D_c = jump_matrix(M, c)
            h_c = np.linalg.solve(UtU + s_w / s_h * D_c.T @ D_c, Uty)
            J = np.sum((y - U @ h_c) ** 2) / s_w + (np.sum((D_c @ h_c) ** 2) + 2 * beta_h) / s_h
            J += N * np.log(s_w) + (M + 2 * (alpha_h + 1)) * np.log(s_h)
            if sigma_d is not None:
                J += c**2 / sigma_d**2 - 2 * np.log(c)
            criterion.append(J)
            candidates.append(h_c)
        best = int(np.argmin(criterion))
        d, h = delays[best], candidates[best]
        if before and all(abs(s / old - 1) < epsilon for s, old in zip((s_h, s_w), before, strict=True)):
            break
        before = s_h, s_w
    return d, h, np.array(criterion), s_w, s_h, iteration
