"""The verdict: what a study comes down to, in one word and one sentence."""

from typing import TYPE_CHECKING

import numpy as np

from rivid.diagnosis.deciding.holding import held_share
from rivid.diagnosis.fit import limited
from rivid.diagnosis.result import Gap, Unknown, Verdict
from rivid.types import Floats

if TYPE_CHECKING:
    from rivid.diagnosis.study import Study

WORSE = 1.01
"""A name does not hold where the sealed error grows by more than this factor at every horizon."""
HELD = 0.25
"""Or where less than this share of what it gained on the selecting days is found on the sealed ones."""
HALF = 0.5
"""Or where, with two standard errors, its size on the sealed days is below this share of its size."""


def verdict_of(study: "Study", gap: Gap, unknown: Unknown | None) -> tuple[Verdict, str]:
    """Word and sentence.

    Parameters
    ----------
    study : Study
    gap : Gap
    unknown : Unknown or None
        What is left, if it has a rhythm or a place.
    """
    base, end = np.array(gap.rmse_baseline), study.last_evaluation.errors.rmse(study.split.sealed)
    named, unit = study.named, gap.unit
    if not named:
        if study.contradicted is not None:
            return (
                "did_not_hold",
                f"{study.contradicted.name} fits the days that it was fitted to, but not the days kept for "
                "the choice: what was there on the former is not there on the latter.",
            )
        if unknown is None:
            return "no_gap", "No candidate stands out, and what is left shows neither rhythm nor place."
        return "unknown", f"Something is left that no known effect explains: {unknown.drivers[0]}."
    all_names = [r.choice.proposal.name.replace("_", " ") for r in named if r.choice is not None]
    names = ", ".join(
        f"{name}, {n} times" if (n := all_names.count(name)) > 1 else name
        for name in dict.fromkeys(all_names)
    )
    shown = f"{base[1]:.3g} {unit} to {end[1]:.3g} {unit} after 4 h"
    if fails(study, base, end):
        return "did_not_hold", f"{names} fits, but on the days kept apart the error goes from {shown}."
    first = named[0].choice
    if first is not None and first.tied:
        others = ", ".join(first.tied)
        return (
            "cannot_tell",
            f"{first.proposal.name} or {others}: these data cannot tell. The error: {shown}.",
        )
    if unknown is not None:
        return "partly_explained", f"Named: {names}. Left: {unknown.drivers[0]}. The error: {shown}."
    return "explained", f"{names}. On days kept apart the error goes from {shown}."


def fails(study: "Study", base: Floats, end: Floats) -> bool:
    """Whether the sealed days contradict what was named: by its size there, their errors, their likelihood.

    The error hours ahead is mostly the unknown inflow's; for a lag or a slow gate the likelihood speaks.

    Parameters
    ----------
    study : Study
    base, end : ndarray, shape (horizons,)
        Errors on the sealed days before and after.
    """
    first = study.named[0].choice
    assert first is not None
    told = held_share(study.last, study.last_linear, study.last_evaluation, first.proposal.name)
    if told is not None:  # the size itself tells more than what it gains
        share, error = told
        return share + 2.0 * error < HALF
    if _likelier(study):
        return False
    if bool((end > WORSE * base).all()):
        return True
    turn = study.named[0]
    assert turn.after is not None
    promised = first.proposal.improvement
    columns = first.proposal.columns
    active = np.abs(columns).max(axis=(0, 2)) if len(columns) else np.ones(study.record.days)
    sealed = study.split.sealed & (active > 0)
    if not sealed.any() or promised.max() < 0.1:
        return False
    found = 1.0 - turn.after.errors.rmse(sealed) / turn.before.errors.rmse(sealed)
    return bool((np.nan_to_num(found) < HELD * np.maximum(promised, 0.1)).all())


def _likelier(study: "Study") -> bool:
    """Whether the sealed days gain a fair share of what the selecting days gain."""
    first = study.named[0].choice
    noise = first.proposal.gains if first is not None else None
    change = study.last_evaluation.likelihood - study.first_evaluation.likelihood if noise is None else noise
    gain = limited(change)
    sealed, select = gain[study.split.sealed].mean(), gain[study.split.select].mean()
    return bool(sealed > max(HELD * select, 0.0))
