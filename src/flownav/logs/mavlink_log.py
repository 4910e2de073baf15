"""A ground station's MAVLink log (.tlog) as a Log: a vehicle's messages into readings and states on one clock.

docs/reference/mavlink.md lists the messages, their units and traps.
"""

from collections import Counter
from pathlib import Path
from typing import Any, NamedTuple

import numpy as np

from flownav.core.errors import InputError
from flownav.core.frames import Quaternion
from flownav.core.measurement import Array, Sensor, Stream
from flownav.core.record import RATES, Table
from flownav.logs.assembly import Origin, content_of, local_ned, near_the_rest, sha256_of
from flownav.logs.log import SIMULATOR, Log, absences_of, attitude_at, in_order, state_table
from flownav.logs.mavlink.asked import ASKING, Asked
from flownav.logs.mavlink.clock import Aligned, ClockState, align, received_unix_time, stamp_of
from flownav.logs.mavlink.converted import Context, Dropped, Pose
from flownav.logs.mavlink.events import VehicleEvents
from flownav.logs.mavlink.framing import ARDUPILOT, INVALID_AUTOPILOT, PX4, Frame, Message, coder, dialect, tlog_frames
from flownav.logs.mavlink.messages import CONVERTERS, STATES, LocalState, instance_of, measurements
from flownav.logs.mavlink.position_messages import LEAST_FIX, fix_deg_m
from flownav.logs.mavlink.sensor_messages import range_limits_m
from flownav.logs.mavlink_streams import Gathered, Source
from flownav.logs.plausible import of_one_clock
from flownav.logs.references import listed, of_one_origin

AUTOPILOTS = {ARDUPILOT: "ArduPilot", PX4: "PX4"}
EVENT_MESSAGES = ("HEARTBEAT", "STATUSTEXT", "PARAM_VALUE")
WANTED = {*CONVERTERS, *STATES, "SYSTEM_TIME", *EVENT_MESSAGES, *ASKING}
NOTHING = (
    "no usable reading of any sensor; have the autopilot send ATTITUDE or HIGHRES_IMU at 20 Hz or more, and "
    "GPS_RAW_INT or OPTICAL_FLOW_RAD"
)
LACKING = {
    "attitude": "no attitude (ATTITUDE_QUATERNION, ATTITUDE)",
    "imu": "no IMU (HIGHRES_IMU, SCALED_IMU; RAW_IMU of ArduPilot)",
    "range": "no range downwards (DISTANCE_SENSOR, RANGEFINDER)",
    "gps_position": "no GPS fix (GPS_RAW_INT)",
    "baro": "no barometer (SCALED_PRESSURE, HIGHRES_IMU)",
    "flow_rate": "no optical flow (OPTICAL_FLOW, OPTICAL_FLOW_RAD)",
}


class Vehicle(NamedTuple):
    """Whose log it is: the autopilot's system and component, and its make (MAV_AUTOPILOT)."""

    system: int
    component: int
    make: int

    @property
    def name(self) -> str:
        """Its make in words."""
        return AUTOPILOTS.get(self.make, f"autopilot {self.make}")


class Decoder:
    """Messages of a log's frames."""

    def __init__(self, content: bytes) -> None:
        self._content = content
        self._coder: Any = coder()
        self._error = dialect().MAVError
        self._names = {number: kind.msgname for number, kind in dialect().mavlink_map.items()}

    def name(self, frame: Frame) -> str:
        """The name of a frame's message."""
        return str(self._names[frame.message_id])

    def message(self, frame: Frame) -> Message | None:
        """A frame's message; None where pymavlink cannot make one of it."""
        try:
            return self._coder.decode(bytearray(self._content[frame.start : frame.end]))
        except self._error:
            return None

    def all_of(self, frames: list[Frame], name: str) -> list[tuple[Frame, Message]]:
        """Every message of one name, with its frame."""
        found = [(frame, self.message(frame)) for frame in frames if self.name(frame) == name]
        return [(frame, message) for frame, message in found if message is not None]


class Flight:
    """The content of the messages of one vehicle's system.

    gathered: readings by sensor and source. states: (log time, state) by message name. origin_deg_m, limits: as in
    Log. counts: messages left out, by what they are; clock jumps. notes: on changes made to the states.
    """

    def __init__(self, decoder: Decoder, vehicle: Vehicle, frames: list[Frame]) -> None:
        self.gathered = Gathered()
        self.states: dict[str, list[tuple[float, Any]]] = {name: [] for name in STATES}
        self.counts: Counter[str] = Counter()
        self.notes: list[str] = []
        self.limits: dict[str, tuple[float, float]] = {}
        self.events, self.asked = VehicleEvents(vehicle.make), Asked(vehicle.make)
        self._quaternion: Quaternion = (1.0, 0.0, 0.0, 0.0)
        self._pose: Pose | None = None
        self._vehicle = vehicle
        own = [frame for frame in frames if frame.component == vehicle.component]
        self.origin_deg_m, self.states_its_origin = _origin(decoder, own)
        self._clock = ClockState((vehicle.system, vehicle.component, "boot"))
        for frame in frames:
            if decoder.name(frame) in WANTED:
                message = decoder.message(frame)
                if message is None:
                    self.counts["undecodable"] += 1
                else:
                    self._take(frame, message)
        self._flow_limits()

    def _take(self, frame: Frame, message: Message) -> None:
        stamp = stamp_of(message, frame.system, frame.component, self._clock.reference_s)
        self._clock, aligned = align(self._clock, frame.arrival_us * 1e-6, stamp)
        if aligned.event:
            self.counts[aligned.event] += 1
        own = frame.component == self._vehicle.component
        name = message.msgname
        if name in CONVERTERS:
            self._measured(frame, message, aligned, own)
        elif name in STATES and own:
            self._stated(message, aligned)
        elif name == "SYSTEM_TIME" and own and message.time_boot_ms:
            unix = (frame.system, frame.component, "unix")
            unix_s, boot_s = message.time_unix_usec * 1e-6, message.time_boot_ms * 1e-3
            self._clock = received_unix_time(self._clock, unix, unix_s, boot_s)
        elif name in EVENT_MESSAGES and own:
            self.events.take(aligned.t_s, message)
        elif name in ASKING and own and not aligned.reason:
            self.asked.take(aligned.t_s, message)

    def _measured(self, frame: Frame, message: Message, aligned: Aligned, own: bool) -> None:
        context = Context(own and self._vehicle.make == ARDUPILOT, own, self.origin_deg_m, self._pose)
        source = Source(frame.component, message.msgname, instance_of(message))
        for outcome in measurements(message, aligned.t_s, context):
            if isinstance(outcome, Dropped):
                self.gathered.take(source, outcome)
            elif aligned.reason:
                self.gathered.take(source, Dropped(outcome.sensor, aligned.reason))
            else:
                self.gathered.take(source, outcome)
                if own and outcome.sensor == Sensor.ATTITUDE:
                    w, x, y, z = outcome.value
                    self._quaternion = (w, x, y, z)
        if message.msgname == "DISTANCE_SENSOR" and "range_m" not in self.limits:
            stated = range_limits_m(message)
            if stated is not None:
                self.limits["range_m"] = stated

    def _stated(self, message: Message, aligned: Aligned) -> None:
        state = STATES[message.msgname](message)
        if state is None or aligned.reason:
            self.counts[f"{message.msgname} {aligned.reason or 'not_possible'}"] += 1
            return
        self.states[message.msgname].append((aligned.t_s, state))
        if isinstance(state, LocalState):
            self._pose = Pose(state.pos_ned_m, self._quaternion)

    @property
    def parameters(self) -> dict[str, float]:
        """Those that the ground station asked for."""
        return {name: value for name, value in self.events.parameters.items() if np.isfinite(value)}

    def _flow_limits(self) -> None:
        """PX4's parameters of the flow sensor, where the ground station asked for them."""
        known = self.parameters
        if known.get("SENS_FLOW_MAXR", 0.0) > 0.0:
            self.limits["flow_rad_s"] = (0.0, known["SENS_FLOW_MAXR"])
        if known.get("SENS_FLOW_MAXHGT", 0.0) > known.get("SENS_FLOW_MINHGT", 0.0) >= 0.0:
            self.limits["flow_height_m"] = (known.get("SENS_FLOW_MINHGT", 0.0), known["SENS_FLOW_MAXHGT"])

    def autopilot(self, attitude: Stream | None) -> Table | None:
        """The autopilot's own estimate: its local position, else its global one about the origin.

        Body velocity and attitude only where the log has an attitude.
        """
        found = self.states["LOCAL_POSITION_NED"] or (self.states["GLOBAL_POSITION_INT"] if self.origin_deg_m else [])
        if not found:
            return None
        t_s, states = np.array([t for t, _ in found]), [state for _, state in found]
        local = isinstance(states[0], LocalState)
        position = self._about_one_origin(t_s, states) if local else self._local(states)
        velocity = np.array([state.vel_ned_m_s for state in states])
        return in_order(state_table(t_s, position, velocity, None if attitude is None else attitude_at(attitude, t_s)))

    def _about_one_origin(self, t_s: Array, states: list[LocalState]) -> Array:
        """Local positions (n, 3) about the first origin where the global ones show that it moved; noted."""
        position, known = np.array([state.pos_ned_m for state in states]), self.states["GLOBAL_POSITION_INT"]
        if not known or np.any(np.diff(t_s) < 0.0):
            return position
        known_t_s, there = np.array([t for t, _ in known]), [state for _, state in known]
        order, about = np.argsort(known_t_s, kind="stable"), self.origin_deg_m or there[0].position_deg_m
        path = local_ned(np.array([state.position_deg_m for state in there]), about)[order]
        position, moves = of_one_origin(t_s, position, known_t_s[order], path)
        if moves:
            self.notes.append(
                f"LOCAL_POSITION_NED: its origin moved {listed(moves)}, as GLOBAL_POSITION_INT shows; what follows is "
                "about the first"
            )
        return position

    def truth(self) -> Table | None:
        """The simulator's truth about the log's origin (about its own first position without one)."""
        found = self.states["HIL_STATE_QUATERNION"] or self.states["SIM_STATE"]
        if not found:
            return None
        t_s, states = np.array([t for t, _ in found]), [state for _, state in found]
        if self.origin_deg_m is None:
            self.origin_deg_m = states[0].position_deg_m
        velocity = np.array([state.vel_ned_m_s for state in states])
        quaternion = np.array([state.quaternion for state in states])
        rates = np.array([state.rate_frd_rad_s for state in states])
        table = state_table(t_s, self._local(states), velocity, quaternion)
        return in_order(table | dict(zip(RATES, rates.T, strict=True)))

    def _local(self, states: list[Any]) -> Array:
        return local_ned(np.array([state.position_deg_m for state in states]), self.origin_deg_m or (0.0, 0.0, 0.0))


def find_vehicle(decoder: Decoder, frames: list[Frame]) -> tuple[Vehicle, list[str]]:
    """The sender of autopilot's HEARTBEATs with the most frames; without one, the sender of the most frames. And
    notes.
    """
    sent = Counter((frame.system, frame.component) for frame in frames)
    makes = {
        (frame.system, frame.component): int(message.autopilot)
        for frame, message in decoder.all_of(frames, "HEARTBEAT")
        if message.autopilot != INVALID_AUTOPILOT
    }
    system, component = max(makes or sent, key=lambda who: (sent[who], -who[0], -who[1]))
    vehicle = Vehicle(system, component, makes.get((system, component), INVALID_AUTOPILOT))
    others = sorted({who[0] for who in makes} - {system})
    if not makes:
        return vehicle, [f"no autopilot's HEARTBEAT; system {system}, component {component} sent the most and is taken"]
    if others:
        listed = ", ".join(map(str, others))
        return vehicle, [f"several vehicles; system {system} ({vehicle.name}) sent the most; left out: system {listed}"]
    return vehicle, []


def _origin(decoder: Decoder, frames: list[Frame]) -> tuple[Origin | None, bool]:
    """The autopilot's own origin, which its local positions are about (True); else the first fix near the others."""
    for _, message in decoder.all_of(frames, "GPS_GLOBAL_ORIGIN"):
        if (message.latitude or message.longitude) and abs(message.latitude) <= 90e7:
            return (message.latitude * 1e-7, message.longitude * 1e-7, message.altitude * 1e-3), True
    received = [
        fix_deg_m(message) for _, message in decoder.all_of(frames, "GPS_RAW_INT") if message.fix_type >= LEAST_FIX
    ]
    fixes = np.array([fix for fix in received if fix is not None])
    if not len(fixes):
        return None, False
    latitude, longitude, altitude = fixes[np.argmax(near_the_rest(fixes[:, 0], fixes[:, 1]))]
    return (float(latitude), float(longitude), float(altitude)), False


# -- the log ------------------------------------------------------------------------------------------------
def read_tlog(path: Path, *, flow_instance: int | None = None) -> Log:
    """Read a .tlog: 8 bytes of UNIX microseconds (big-endian) before each MAVLink 1 or 2 frame.

    The log's clock is the autopilot's time since boot [s]. flow_instance: the `sensor_id` of the flow sensor to
    take; without, the one with the most readings. Damaged bytes are skipped and counted in the notes, readings that
    cannot be are counted in `Stream.rejected`; signatures are not verified.
    InputError, one line, where the file cannot be read, holds no MAVLink frame, no reading of any sensor, or no flow
    sensor of that instance, and where pymavlink is not installed.
    """
    content = content_of(path, "a .tlog file")
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
    streams, strays = of_one_clock(path, streams.values(), NOTHING)
    truth, own = flight.truth(), flight.autopilot(streams.get(Sensor.ATTITUDE))
    return Log(
        path, streams, flight.origin_deg_m, truth, {path.name: sha256_of(content)},
        (*choice, *_damage_notes(damage, frames), *_flight_notes(flight), *flight.notes, *chosen, *strays),
        own, vehicle.name, flight.limits,
        tuple(absences_of(streams, **LACKING)), clock_start_s=0.0, truth_name=SIMULATOR,
        parameters=flight.parameters, happened=flight.events.happened(),
        setpoints=flight.asked.setpoints(), battery=flight.asked.battery(),
    )  # fmt: skip


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
