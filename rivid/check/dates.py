"""Days of which one column belongs to the day before or after."""

import datetime as dt

from rivid.check.agree import in_rows
from rivid.check.findings import Finding
from rivid.check.fits import TOLD, Fits
from rivid.check.record import Record

WELL = 0.6
"""Share of the output's moves from which on a day is where it belongs."""
MORE, MAYBE = 0.2, 0.12
"""By how much the flows of another day must explain more: of all such days together, of one of them."""

SHIFTS = {
    (-1, 0): ("u_Qi", "early"),
    (1, 0): ("u_Qi", "late"),
    (0, -1): ("u_Qo", "early"),
    (0, 1): ("u_Qo", "late"),
    (-1, -1): ("", "late"),
    (1, 1): ("", "early"),
}
"""Days by which the flows are taken from another day: whose dates are off ("": the output's), and how."""


def dates(record: Record, fits: Fits) -> list[Finding]:
    """Days that fit only with the flows of the day before or after."""
    groups: dict[tuple[int, int], list[dt.date]] = {}
    for date, fit in fits.right.items():
        if fit.explained >= WELL:
            continue
        best = (fit.explained + MAYBE, (0, 0))
        for shift in SHIFTS:
            sums = fits.lags.sums(date, *shift) if record.balanced or not shift[1] else None
            if sums is not None:
                best = max(best, (fits.lags.best(sums).explained, shift))
        if best[1] != (0, 0):
            groups.setdefault(best[1], []).append(date)
    found = []
    for shift, some in groups.items():
        days = in_rows(record, some, list(fits.right), whole=True)
        if not days:
            continue
        shifted = fits.of(days, shift)[0].explained
        if shifted < max(TOLD, fits.of(days)[0].explained + MORE):
            continue
        column, off = SHIFTS[shift]
        column = column or record.output
        text = (
            f"the dates of {column} are a day too {off}: it fits the other columns of the day "
            f"{'after' if off == 'early' else 'before'}"
        )
        found.append(Finding("dates", text, dict.fromkeys(days, f"{column} looks dated a day too {off}")))
    return found
