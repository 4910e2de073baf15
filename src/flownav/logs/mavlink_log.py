"""A ground station's MAVLink log (.tlog) as a Log.

docs/reference/mavlink.md lists the messages, their units and traps.
"""

from __future__ import annotations

import hashlib
from collections import Counter
from pathlib import Path

from flownav.core.errors import InputError
from flownav.core.guard import an_input
from flownav.core.measurement import Sensor, Stream
from flownav.logs.absences import absences_of
from flownav.logs.log import SIMULATOR, Log
from flownav.logs.mavlink_flight import STATES, Decoder, Flight, find_vehicle
from flownav.logs.plausible import check_times, of_one_clock
from flownav.mavlink.framing import Frame, tlog_frames

LACKING = {
    "attitude": "no attitude (ATTITUDE_QUATERNION, ATTITUDE)",
    "imu": "no IMU (HIGHRES_IMU, SCALED_IMU; RAW_IMU of ArduPilot)",
    "range": "no range downwards (DISTANCE_SENSOR, RANGEFINDER)",
    "gps_position": "no GPS fix (GPS_RAW_INT)",
    "baro": "no barometer (SCALED_PRESSURE, HIGHRES_IMU)",
    "flow_rate": "no optical flow (OPTICAL_FLOW, OPTICAL_FLOW_RAD)",
}


def read_tlog(path: Path, *, flow_instance: int | None = None) -> Log:
    """Read a .tlog: 8 bytes of UNIX microseconds (big-endian) before each MAVLink 1 or 2 frame.

    The log's clock is the autopilot's time since boot [s]. flow_instance: the `sensor_id` of the flow sensor to
    take; without, the one with the most readings. Damaged bytes are skipped and counted in the notes, readings that
    cannot be are counted in `Stream.rejected`; signatures are not verified.
    InputError, one line, where the file cannot be read, holds no MAVLink frame, no reading of any sensor, or no flow
    sensor of that instance, and where pymavlink is not installed.
    """
    content = _content(path)
    damage: Counter[str] = Counter()
    frames = list(tlog_frames(content, damage))
    if not frames:
        raise InputError(f"{path}: no MAVLink frame in {len(content)} bytes; a .tlog of a ground station is needed")
    decoder = Decoder(content)
    vehicle, choice = find_vehicle(decoder, frames)
    flight = Flight(decoder, vehicle, [frame for frame in frames if frame.system == vehicle.system])
    try:
        streams, chosen = flight.gathered.streams(flow_instance)
    except InputError as error:
        raise InputError(f"{path}: {error}") from None
    streams, strays = of_one_clock(streams)
    _check_needed(path, streams)
    check_times(path, streams)
    truth = flight.truth()
    return Log(
        path,
        streams,
        flight.origin_deg_m,
        truth,
        {path.name: hashlib.sha256(content).hexdigest()},
        (*choice, *_damage_notes(damage, frames), *_flight_notes(flight), *chosen, *strays),
        flight.autopilot(streams.get(Sensor.ATTITUDE)),
        vehicle.name,
        flight.limits,
        tuple(absences_of(streams, **LACKING)),
        clock_start_s=0.0,
        truth_name=SIMULATOR,
    )


def _content(path: Path) -> bytes:
    try:
        return an_input(path).read_bytes()
    except OSError as error:
        raise InputError(f"{path}: cannot be read ({error.strerror}); give a .tlog file") from error


def _damage_notes(damage: Counter[str], frames: list[Frame]) -> list[str]:
    notes = []
    if damage["skipped_bytes"]:
        kinds = [f"{damage[kind]} {kind.replace('_', ' ')}" for kind in ("bad_checksum", "truncated") if damage[kind]]
        listed = f" ({', '.join(kinds)})" if kinds else ""
        notes.append(f"damage: {damage['skipped_bytes']} bytes belong to no whole frame{listed} and are skipped")
    if damage["unknown_message"]:
        notes.append(f"{damage['unknown_message']} frames are of messages that pymavlink does not know")
    signed = sum(frame.signed for frame in frames)
    if signed:
        notes.append(f"{signed} frames are signed; a log's signatures are not verified")
    return notes


def _flight_notes(flight: Flight) -> list[str]:
    notes = []
    if flight.counts["clock_jump"]:
        jumps = flight.counts["clock_jump"]
        notes.append(f"{jumps} jumps of a clock (a reboot, or a clock that was set); times go on by the arrivals")
    if flight.counts["undecodable"]:
        notes.append(f"{flight.counts['undecodable']} messages cannot be decoded")
    unused = "GLOBAL_POSITION_INT" if flight.states["LOCAL_POSITION_NED"] else ""
    for name in STATES:
        lost = {key.split()[1]: count for key, count in flight.counts.items() if key.startswith(f"{name} ")}
        if lost and name != unused:
            reasons = ", ".join(f"{count} {reason}" for reason, count in sorted(lost.items()))
            notes.append(f"{name}: {sum(lost.values())} left out ({reasons})")
    if flight.states["LOCAL_POSITION_NED"] and flight.origin_deg_m is not None and not flight.states_its_origin:
        notes.append("no GPS_GLOBAL_ORIGIN: the autopilot's path may lie shifted, its origin is not in the log")
    return notes


def _check_needed(path: Path, streams: dict[Sensor, Stream]) -> None:
    if not streams:
        raise InputError(
            f"{path}: no usable reading of any sensor; have the autopilot send ATTITUDE or HIGHRES_IMU at 20 Hz or "
            "more, and GPS_RAW_INT or OPTICAL_FLOW_RAD"
        )
