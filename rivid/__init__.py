"""rivid: identification of managed river reaches from what their dams log every day.

The public names are loaded when they are first used: ``import rivid`` itself loads nothing heavy.
"""

from importlib import import_module
from typing import TYPE_CHECKING, Any

__version__ = "0.2.0"

__all__ = [
    "CalibratedReach", "Config", "Day", "DelayEstimate", "DelayProbabilities", "DiagnosisResult",
    "JmapSettings", "RividError", "SimulatedSeason", "__version__", "cusum", "diagnose", "direct",
    "indirect", "jmap", "load_config", "load_delays", "load_model", "load_results", "load_scenario",
    "map_fir", "ml", "posterior", "propose_delays", "read_day", "simulate", "travel_bounds",
]  # fmt: skip

_MODULES = {
    "api.day": "Day read_day",
    "api.diagnosis": "DiagnosisResult diagnose",
    "api.estimate": "DelayEstimate DelayProbabilities cusum direct indirect jmap map_fir ml posterior",
    "api.model": "CalibratedReach load_model",
    "api.season": "SimulatedSeason simulate",
    "config": "Config load_config",
    "core.hydraulics": "propose_delays travel_bounds",
    "core.settings": "JmapSettings",
    "errors": "RividError",
    "results.read": "load_delays load_results",
    "simulation.scenario": "load_scenario",
}

if TYPE_CHECKING:
    from rivid.api.day import Day, read_day
    from rivid.api.diagnosis import DiagnosisResult, diagnose
    from rivid.api.estimate import (
        DelayEstimate,
        DelayProbabilities,
        cusum,
        direct,
        indirect,
        jmap,
        map_fir,
        ml,
        posterior,
    )
    from rivid.api.model import CalibratedReach, load_model
    from rivid.api.season import SimulatedSeason, simulate
    from rivid.config import Config, load_config
    from rivid.core.hydraulics import propose_delays, travel_bounds
    from rivid.core.settings import JmapSettings
    from rivid.errors import RividError
    from rivid.results.read import load_delays, load_results
    from rivid.simulation.scenario import load_scenario


def __getattr__(name: str) -> Any:
    for module, names in _MODULES.items():
        if name in names.split():
            value = getattr(import_module(f"rivid.{module}"), name)
            globals()[name] = value  # before a submodule of the same name can take its place
            return value
    raise AttributeError(f"module 'rivid' has no attribute {name!r}")


def __dir__() -> list[str]:
    return sorted(__all__)
