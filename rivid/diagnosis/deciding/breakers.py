"""What would tell apart what the data cannot: a measurement, or a move of the operators."""

PAIRS: dict[frozenset[str], str] = {
    frozenset({"inflow_gain_error", "outflow_gain_error"}): (
        "Gauge one of the two dams once (a current meter or ADCP at a steady flow): the operators "
        "pass on what "
        "comes in, so the logs alone cannot say which dam's figure is off."
    ),
    frozenset({"lateral_inflow", "sensor_drift"}): (
        "Read the gauge against a staff or a second sensor a few days apart: a drift shows, an "
        "inflow does not."
    ),
    frozenset({"lateral_inflow", "inflow_gain_error"}): (
        "Compare days of low and of high discharge held steady: a gain error grows with the flow, "
        "an inflow does "
        "not; or gauge the upstream dam once."
    ),
    frozenset({"lateral_inflow", "outflow_gain_error"}): (
        "Compare days of low and of high discharge held steady: a gain error grows with the flow, "
        "an inflow does "
        "not; or gauge the downstream dam once."
    ),
    frozenset({"leakage", "gate_head_effect"}): (
        "Hold the level a few decimetres high and low for some hours each, once at low and once at "
        "high outflow: a "
        "leak takes the same both times, the gates more where more goes through."
    ),
    frozenset({"outflow_lag", "clock_offset"}): (
        "Compare the clocks of both logs, or log one outflow step at the gate itself with seconds."
    ),
    frozenset({"outflow_lag", "gate_rate_limit"}): (
        "Make one small and one large step of the outflow: a lag takes the same time for both, a "
        "slow gate longer "
        "for the large one."
    ),
    frozenset({"side_storage", "storage_area_slope"}): (
        "Step the level and hold it for a day: side storage drains back for hours, a larger surface does not."
    ),
    frozenset({"unlogged_upstream_release", "lateral_inflow"}): (
        "Look up the gate and spill book of the upstream dam for these hours, or gauge below it once."
    ),
    frozenset({"rain_inflow", "unlogged_upstream_release"}): (
        "Lay the rain gauge of the catchment and the upstream dam's spill book beside the dates found."
    ),
}  # fmt: skip
USUAL: dict[str, str] = {
    "flow": (
        "Gauge the flow below each dam once during the hours found, and look into the gate books for them."
    ),
    "timing": "Compare the clocks of both logs and log one step of each gate with seconds.",
    "level": "Read the gauge against a staff or a second sensor.",
}


def breaker(name: str, family: str, tied: tuple[str, ...]) -> str | None:
    """What to measure to tell an effect from those it is tied with; None where nothing is tied."""
    if not tied:
        return None
    for other in tied:
        text = PAIRS.get(frozenset({name, other}))
        if text:
            return text
    return USUAL.get(family)
