"""What the hydraulics say of a travel time: the bounds (5), and answers that beat them."""

import numpy as np
from numpy.typing import NDArray

from rivid.results.passage import has_t50
from rivid.results.read import EstimatorResults, Results
from rivid.results.selection import found
from rivid.text import duration, listed

FASTER = "faster than any wave of this reach can be: is the clock or the geometry wrong?"
"""What is asked where the answer beats the gravity wave."""


def too_fast(results: Results, estimator: EstimatorResults, *, passage: bool = False) -> NDArray[np.bool_]:
    """Days whose inflow would arrive more than a sample before the gravity wave, shape (n,).

    Parameters
    ----------
    results : Results
    estimator : EstimatorResults
    passage : bool
        Compare t50, not the latest travel time that the delay allows.
    """
    e, T_s = estimator, results.sample_time
    if passage:
        latest, days = e.t50 * T_s, has_t50(e)
    else:
        latest, days = (e.delay + 1) * T_s if e.travel_s is None else e.travel_s, found(e)
    fast: NDArray[np.bool_] = days & (latest + T_s < e.bound_gravity_s)
    return fast


def gravity(estimator: EstimatorResults, days: NDArray[np.bool_]) -> str:
    """How long a gravity wave takes on some days; empty where it is not known."""
    seconds = estimator.bound_gravity_s[days & np.isfinite(estimator.bound_gravity_s)]
    return duration([float(seconds.min()), float(seconds.max())]) if seconds.size else ""


def not_compared(results: Results) -> str:
    """What is said in place of the bounds where the geometry is not given; empty where it is."""
    if not results.assumed:
        return ""
    keys, verb = listed(results.assumed), "is" if len(results.assumed) == 1 else "are"
    return f"{keys.capitalize()} of the reach {verb} not given: no travel time to compare with."


def waves(results: Results, estimator: EstimatorResults) -> list[str]:
    """The bounds of the travel time in a sentence; none where no day has any."""
    if results.assumed:
        return [not_compared(results)]
    e, said = estimator, []
    bounds = [("gravity", e.bound_gravity_s)]
    if results.output_unit != "m":
        bounds.append(("kinematic", e.bound_kinematic_s))
    for name, seconds in bounds:
        finite = seconds[found(e) & np.isfinite(seconds)]
        if finite.size:
            said.append(f"a {name} wave takes {duration([float(finite.min()), float(finite.max())])}")
    return [f"By the hydraulics of the reach, {listed(said)}."] if said else []
