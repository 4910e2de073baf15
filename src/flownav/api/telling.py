"""A simulated flight told over MAVLink, as an autopilot on a link tells its own: a vehicle to try `live` with."""

from __future__ import annotations

from pathlib import Path
from typing import Any

from flownav.campaigns.faults.table import log_of
from flownav.core.errors import InputError
from flownav.core.record import Record
from flownav.live.byte_links import open_link
from flownav.live.loop import run_vehicle, stoppable
from flownav.live.simulated import SimulatedVehicle
from flownav.mavlink.signing import load_key
from flownav.simulation.assemble import Setup


def tell(setup: Setup, record: Record, url: str, speed: float, key: Path | None) -> dict[str, Any]:
    """Tell a flight of `setup` on a link; how far it came, and what was heard.

    speed: 1 is real time. key: a file that signs what is told. InputError where the flight has no sensors of its own,
    or the link cannot be opened.
    """
    if "imu" not in record.tables or "gps_velocity" not in record.tables:
        raise InputError("--mavlink: the flight has no IMU or no GPS velocity; give --filter landing --gps midg")
    vehicle = SimulatedVehicle(log_of(record, setup), key=load_key(key) if key else None)
    link = open_link(url)
    try:
        with stoppable() as asked:
            reached_s = run_vehicle(vehicle, link, speed, asked)
    finally:
        link.close()
    return {"flight_s": min(reached_s, vehicle.end_s), "speed": speed, "heard": dict(vehicle.counts)}
