"""pymavlink's tables, loaded when first needed: ardupilotmega includes all of MAVLink's common messages."""

from __future__ import annotations

from types import ModuleType
from typing import Any

from flownav.core.errors import InputError

# MAV_AUTOPILOT: who answers a HEARTBEAT; a ground station and a camera say that they are none
ARDUPILOT, PX4, INVALID_AUTOPILOT = 3, 12, 8

Message = Any  # a message that pymavlink decoded or built


def dialect() -> ModuleType:
    """The MAVLink 2 dialect module. InputError where pymavlink is not installed."""
    try:
        from pymavlink.dialects.v20 import ardupilotmega
    except ImportError as error:
        raise InputError("MAVLink needs pymavlink; install it with `pip install 'flownav[live]'`") from error
    return ardupilotmega  # type: ignore[no-any-return]


def coder(system: int = 1, component: int = 1) -> Any:
    """A pymavlink `MAVLink` that packs messages as this system and component, and decodes any."""
    return dialect().MAVLink(None, srcSystem=system, srcComponent=component)
