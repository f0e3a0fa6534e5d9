"""rivid: identification of managed river reaches from what their dams log every day.

The public names are loaded when they are first used: ``import rivid`` itself loads nothing heavy.
"""

from typing import TYPE_CHECKING, Any

__version__ = "0.1.0"

_HOME = {
    "Config": "config",
    "JmapSettings": "core.settings",
    "RividError": "errors",
    "jmap": "core.jmap",
    "load_config": "config",
    "load_delays": "results",
    "load_results": "results",
    "load_scenario": "scenario",
    "map_fir": "core.fir",
    "ml": "core.fir",
    "propose_delays": "core.hydraulics",
    "travel_bounds": "core.hydraulics",
}

__all__ = [
    "Config",
    "JmapSettings",
    "RividError",
    "__version__",
    "jmap",
    "load_config",
    "load_delays",
    "load_results",
    "load_scenario",
    "map_fir",
    "ml",
    "propose_delays",
    "travel_bounds",
]

if TYPE_CHECKING:
    from rivid.config import Config, load_config
    from rivid.core.fir import map_fir, ml
    from rivid.core.hydraulics import propose_delays, travel_bounds
    from rivid.core.jmap import jmap
    from rivid.core.settings import JmapSettings
    from rivid.errors import RividError
    from rivid.results import load_delays, load_results
    from rivid.scenario import load_scenario


def __getattr__(name: str) -> Any:
    from importlib import import_module

    if name not in _HOME:
        raise AttributeError(f"module 'rivid' has no attribute {name!r}")
    value = getattr(import_module(f"rivid.{_HOME[name]}"), name)
    globals()[name] = value  # before a submodule of the same name can take its place
    return value


def __dir__() -> list[str]:
    return sorted(__all__)
