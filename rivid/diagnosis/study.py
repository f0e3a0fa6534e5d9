"""What a diagnosis came by: its rounds, and the models before and after."""

from dataclasses import dataclass, field

from rivid.diagnosis.blocks import Split
from rivid.diagnosis.data import Record
from rivid.diagnosis.deciding.naming import Choice
from rivid.diagnosis.fit import Evaluation, Linear, Model
from rivid.diagnosis.search.proposal import Proposal
from rivid.effects import Effect
from rivid.types import Floats


@dataclass(frozen=True, eq=False)
class Round:
    """One turn: what stood to choose from, and what was chosen.

    Attributes
    ----------
    before : Evaluation
    proposals : tuple of Proposal
    choice : Choice or None
    after : Evaluation or None
        With the chosen effect in the simulator.
    """

    before: Evaluation
    proposals: tuple[Proposal, ...]
    choice: Choice | None
    after: Evaluation | None


@dataclass(frozen=True, eq=False)
class Study:
    """All that a diagnosis came by, for the telling.

    Attributes
    ----------
    record : Record
    split : Split
    first, last : Model
        Calibrated without and with the named effects.
    first_linear, last_linear : Linear
    first_evaluation, last_evaluation : Evaluation
    rounds : tuple of Round
    kernels : dict of str to ndarray
        Step responses by place; see :func:`rivid.diagnosis.response.base.kernels_of`.
    notes : tuple of str
    noises : tuple of Effect
        Noises (wind, a seiche) that were known from the start.
    contradicted : Proposal or None
        Where nothing was named: what fits the fitting days well, and the selecting days not.
    """

    record: Record
    split: Split
    first: Model
    last: Model
    first_linear: Linear
    last_linear: Linear
    first_evaluation: Evaluation
    last_evaluation: Evaluation
    rounds: tuple[Round, ...]
    kernels: dict[str, Floats]
    notes: tuple[str, ...] = field(default=())
    noises: tuple[Effect, ...] = ()
    contradicted: Proposal | None = None

    @property
    def named(self) -> tuple[Round, ...]:
        """The rounds that named something."""
        return tuple(r for r in self.rounds if r.choice is not None)

    def swings(self) -> tuple[float, ...]:
        """Periods of the seiches that are known or named [s]."""
        named = (r.choice.proposal.effect for r in self.named if r.choice is not None)
        swings = (e for e in (*self.noises, *named) if e.found_as == "swing")
        return tuple(float(getattr(e, "period")) for e in swings)  # noqa: B009 - every seiche has a period
