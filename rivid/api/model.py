"""Calibrated reaches in Python: state space, forecast, export."""

import datetime as dt
from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING

from rivid.api.inputs import GivenConfig, as_config
from rivid.diagnosis.calibrated import ReachModel
from rivid.diagnosis.calibrated import load_model as read_model
from rivid.export import StateSpace, routing, state_space
from rivid.types import Floats

if TYPE_CHECKING:
    from rivid.forecast import Forecast


@dataclass(frozen=True, repr=False, eq=False)
class CalibratedReach:
    """A reach as `rivid diagnose` has calibrated it.

    Attributes
    ----------
    reach : ReachModel
        Response, noise and effects.
    """

    reach: ReachModel

    def __repr__(self) -> str:
        return f"CalibratedReach({self.reach.name}: {self.reach.model.reach.name}, {self.reach.kind})"

    def state_space(self) -> StateSpace:
        """Return the discrete state space about the usual flow; see :func:`rivid.export.state_space`."""
        return state_space(self.reach)

    def step_responses(self, samples: int) -> dict[str, Floats]:
        """Return the output after 1 m3/s more at each dam, shape (samples,) each [m per m3/s, or -]."""
        return self.reach.kernels(samples)

    def routing(self) -> dict[str, float]:
        """Return parameters of routing blocks; see :func:`rivid.export.routing`."""
        return routing(self.reach)

    def forecast(
        self,
        logs: Path | str,
        config: GivenConfig = None,
        *,
        hours: float = 24.0,
        at: dt.datetime | None = None,
    ) -> "Forecast":
        """Forecast the output of the next hours; see :func:`rivid.forecast.forecast`.

        Parameters
        ----------
        logs : Path or str
            DATA_DIR, or one file of many days.
        config : Config, path of a TOML file, or mapping, optional
            That of the diagnosis.
        hours : float
            Longest horizon [h].
        at : datetime.datetime, optional
            Origin, with its zone; default: the last output in the logs.

        Raises
        ------
        NoDataError
            If the logs before the origin are not complete.
        ConfigError
            If the configuration is of another reach.
        """
        from rivid.forecast import forecast, read_logs

        series, notes = read_logs(Path(logs), as_config(config), self.reach, hours=hours, at=at)
        return forecast(self.reach, series, notes=notes)


def load_model(path: Path | str) -> CalibratedReach:
    """Read the calibrated reach of a diagnosis.

    Parameters
    ----------
    path : Path or str
        model.toml of `rivid diagnose`, or its directory.

    Raises
    ------
    ConfigError
        If the file cannot be read or holds no calibration.
    """
    return CalibratedReach(read_model(path))
