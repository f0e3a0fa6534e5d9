"""The arrays behind a diagnosis, for pictures and for the table of the unexplained inflow."""

from dataclasses import dataclass

from rivid.diagnosis.blocks import Split
from rivid.diagnosis.data import Floats, Record


@dataclass(frozen=True, eq=False)
class Evidence:
    """What was looked at.

    Attributes
    ----------
    record : Record
    split : Split
    run_before, run_after : ndarray, shape (days, n)
        The simulated output of each day [m or m3/s] without and with the named effects, set to the
        measurement at the day's first sample that counts, and free from there.
    residual_before, residual_after : ndarray, shape (days, n)
        Measured less simulated about the observed course; NaN where nothing was measured. Its constant of
        each day means nothing.
    inflow_before, inflow_before_sd, inflow_after, inflow_after_sd : ndarray, shape (days, n)
        The unexplained inflow w [m3/s] and its standard deviation, from whole days.
    step_response : ndarray, shape (n,)
        Output at each sample after 1 m3/s more flows in at the upstream dam.
    """

    record: Record
    split: Split
    run_before: Floats
    run_after: Floats
    residual_before: Floats
    residual_after: Floats
    inflow_before: Floats
    inflow_before_sd: Floats
    inflow_after: Floats
    inflow_after_sd: Floats
    step_response: Floats
