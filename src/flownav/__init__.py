"""flownav: GPS/INS + optical-flow navigation for precision VTOL take-off and landing.

The public API: `fly`, `replay`, `identify`, `campaign` and `load` give a `Record`, a `Sensor` or a `Campaign`, and
`explain` why a log drifted; `Scenario`, `Sensor` and `Vehicle` are what they take; `build` and `verify` are the
navigator for other processors. Each is loaded when it is first asked for.
"""

from importlib import import_module
from typing import TYPE_CHECKING, Any

from flownav.core.version import __version__

if TYPE_CHECKING:
    from flownav.api.building import build, verify
    from flownav.api.campaign import Campaign
    from flownav.api.campaigning import campaign
    from flownav.api.explaining import explain
    from flownav.api.flying import fly
    from flownav.api.identifying import identify
    from flownav.api.record import Record, load
    from flownav.api.replaying import replay
    from flownav.api.scenario import Scenario
    from flownav.api.sensor import Sensor
    from flownav.api.table import Table
    from flownav.api.vehicle import Vehicle
    from flownav.core.errors import FlownavError, InputError

_PLACES = {
    "Campaign": "flownav.api.campaign",
    "FlownavError": "flownav.core.errors",
    "InputError": "flownav.core.errors",
    "Record": "flownav.api.record",
    "Scenario": "flownav.api.scenario",
    "Sensor": "flownav.api.sensor",
    "Table": "flownav.api.table",
    "Vehicle": "flownav.api.vehicle",
    "build": "flownav.api.building",
    "campaign": "flownav.api.campaigning",
    "explain": "flownav.api.explaining",
    "fly": "flownav.api.flying",
    "identify": "flownav.api.identifying",
    "load": "flownav.api.record",
    "replay": "flownav.api.replaying",
    "verify": "flownav.api.building",
}

__all__ = [
    "Campaign",
    "FlownavError",
    "InputError",
    "Record",
    "Scenario",
    "Sensor",
    "Table",
    "Vehicle",
    "__version__",
    "build",
    "campaign",
    "explain",
    "fly",
    "identify",
    "load",
    "replay",
    "verify",
]


def __getattr__(name: str) -> Any:
    """A public name, loaded when it is first asked for."""
    if name not in _PLACES:
        raise AttributeError(f"module 'flownav' has no attribute {name!r}")
    found = getattr(import_module(_PLACES[name]), name)
    globals()[name] = found
    return found


def __dir__() -> list[str]:
    return sorted(__all__)
