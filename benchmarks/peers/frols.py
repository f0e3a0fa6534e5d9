"""Estimate the delay as the strongest lag of the inflow, by forward orthogonal least squares of `sysidentpy`.

The model of the rise of the level has linear terms: its lags 1 and 2, the inflow's lags of all candidates,
the outflow's lags 1 and 2. Terms join in the order in which they explain it. Of four variants, this one was
best on the development worlds.
"""

import contextlib
import io
import warnings

import numpy as np

from benchmarks.peers.signals import Floats, Ints, deviations

TERMS = 8
"""Number of terms that join."""


def delays(u: Floats, y: Floats, o: Floats, candidates: Ints) -> Ints:
    """Return the delay of the first inflow lag that joins; the first candidate if none joins."""
    from sysidentpy.basis_function import Polynomial
    from sysidentpy.model_structure_selection import FROLS

    found = []
    for a, b, c in zip(*deviations(u, y, o), strict=True):
        model = FROLS(
            order_selection=False, n_terms=TERMS, ylag=2,
            xlag=[[int(d) + 1 for d in candidates], [1, 2]], basis_function=Polynomial(degree=1),
        )  # fmt: skip
        with warnings.catch_warnings(), contextlib.redirect_stdout(io.StringIO()):
            warnings.simplefilter("ignore")
            model.fit(X=np.column_stack([a, c]), y=np.diff(b, prepend=b[0])[:, None])
        lags = [int(code) - 2000 for code in np.ravel(model.final_model) if 2000 < code < 3000]
        found.append(lags[0] - 1 if lags else candidates[0])
    return np.array(found, np.intp)
