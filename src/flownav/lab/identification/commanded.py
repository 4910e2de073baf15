"""A flight's commands, set-points, rates and specific forces on one even clock, from any log that holds commands.

Roll first, then pitch, each about its body axis; a helicopter's cyclic as the blades' angle where the log has it, else
a share of full deflection, as a multirotor's commands are.
"""

from collections.abc import Iterable, Mapping
from pathlib import Path
from typing import Any, NamedTuple

import numpy as np

from flownav.control.learning import EPOCH_S, STIR, STIR_EPOCHS
from flownav.core.errors import InputError
from flownav.core.measurement import Array, Sensor
from flownav.core.record import VELOCITY_BODY, Record, Table
from flownav.logs.dataflash.columns import DataFlash
from flownav.logs.log import Log
from flownav.logs.open_log import log_kind, open_log
from flownav.logs.ulog_topics import read_topics

HELICOPTER, MULTIROTOR = "helicopter", "multirotor"
HELICOPTER_FRAMES = (6.0, 11.0, 13.0)  # ArduPilot's FRAME_CLASS: single, dual, quad
HELICOPTER_TYPE = 4.0  # PX4's MAV_TYPE
SHARE_OF_RATE = 0.35  # of the slowest signal's rate: beyond it samples show other frequencies' images
HIGHEST_HZ = {HELICOPTER: 4.2, MULTIROTOR: 8.0}
LEAST_SPAN_S = 8.0
LONGEST_GAP_S = 0.5
# of our own record: a row has the command of the 4 ms before it, and readings of the IMU arrive 5 ms after their 10 ms
COMMAND_LATE_S, RATES_LATE_S = 0.002, 0.010
STIRRED = 0.5  # share of the most that the cyclics hold of the stir, from which it is in full swing
LEAST_STIR = 0.2  # of the stir in the cyclics, at the most: loops take a part of it away


class Timed(NamedTuple):
    """Samples: t_s (n,) and value (n, k)."""

    t_s: Array
    value: Array


class Source(NamedTuple):
    """Signals that a format's reader found, before it is put on one clock. Names are the log's own."""

    kind: str
    command: Timed  # roll, pitch, collective or thrust, yaw
    rates: Timed  # p, q, r [rad/s]
    force: Timed | None  # specific force [m/s2], body FRD
    setpoint: Timed | None  # of roll and pitch, any unit
    velocity: Timed | None  # forward and right over the ground [m/s]
    landed: Timed | None  # 1 on the ground
    angles: bool
    command_name: str
    setpoint_name: str
    exact: bool = False
    commands_late_s: float = 0.0
    rates_mean_s: float = 0.0


class Commanded(NamedTuple):
    """A flight in the air, row by row, every step_s.

    command (n, 4): roll, pitch, collective or thrust, yaw, angles of the blades [rad] or shares; rates (n, 3) [rad/s];
    force (n, 3) [m/s2] or None; setpoint (n, 2) of roll and pitch in any unit, or None; velocity (n, 2) over the
    ground, forward and right [m/s], or None. highest_hz: up to which commands and rates are both known.
    """

    path: Path
    kind: str
    step_s: float
    command: Array
    rates: Array
    force: Array | None
    setpoint: Array | None
    velocity: Array | None
    angles: bool
    highest_hz: float
    command_name: str
    setpoint_name: str
    exact: bool  # the commands are the vehicle's own angles or shares, without a linkage or a mixer between
    periodic: bool = False  # the set-point is our stir, whole periods in a window
    commands_late_s: float = 0.0  # stamps of the commands after those of the rates, less what is so in the vehicle
    rates_mean_s: float = 0.0  # time over which a row's rates are a mean

    @property
    def span_s(self) -> float:
        """How long it is in the air."""
        return len(self.command) * self.step_s


def read_commanded(path: Path) -> Commanded:
    """The commands of a flight. InputError, one line, where the log holds none, or no rates beside them."""
    kind = log_kind(path) if path.is_file() else ""
    if kind == "record":
        return on_one_clock(path, source_of_record(path, Record.load(path)))
    if kind not in ("ulog", "dataflash"):
        raise InputError(
            f"{path}: no commands are read from this kind of log; give a record of `flownav fly`, a PX4 ULog (.ulg) or "
            "an ArduPilot DataFlash log (.bin)"
        )
    log = open_log(path)
    found = _of_ulog(path, log) if kind == "ulog" else _of_dataflash(path, log)
    return on_one_clock(path, found)


# -- the formats --------------------------------------------------------------------------------------------------
def source_of_record(path: Path, record: Record) -> Source:
    """The commands of a simulated flight's record. InputError where it is another kind of record."""
    tables = record.tables
    if "command" not in tables or "imu" not in tables:
        lacking = "commands" if "command" not in tables else "readings of an IMU (the paper's filter keeps none)"
        raise InputError(f"{path}: the record holds no {lacking}; `flownav fly approach` writes one that does")
    command, imu = tables["command"], tables["imu"]
    given = _columns(command, ("lat_rad", "lon_rad", "col_rad", "ped_rad"))
    described = record.manifest.get("parameters", {}).get("vehicle", {})
    kind = MULTIROTOR if any(str(key).startswith("propeller.") for key in described) else HELICOPTER
    own, truth = tables.get("estimate"), tables.get("truth")
    return Source(
        kind,
        Timed(command["t_s"], given),
        Timed(imu["t_s"], _columns(imu, tuple(f"gyro_{axis}_rad_s" for axis in "xyz"))),
        Timed(imu["t_s"], _columns(imu, tuple(f"accel_{axis}_m_s2" for axis in "xyz"))),
        None,
        None if own is None else Timed(own["t_s"], _columns(own, VELOCITY_BODY[:2])),
        None if truth is None else Timed(truth["t_s"], truth["on_ground"][:, None]),
        kind == HELICOPTER,
        "command",
        "the stir of the hover",
        exact=True,
        commands_late_s=COMMAND_LATE_S - RATES_LATE_S,
        rates_mean_s=EPOCH_S,
    )


def _of_dataflash(path: Path, log: Log) -> Source:
    file = DataFlash(path)
    start_s = log.clock_start_s or 0.0
    if not file.count("RATE"):
        raise InputError(f"{path}: no RATE messages, which hold commands and rates; set bit 0 of LOG_BITMASK")
    table, t_s = _floats(file.table("RATE")), file.times("RATE") - start_s
    kind = HELICOPTER if log.parameters.get("FRAME_CLASS") in HELICOPTER_FRAMES else MULTIROTOR
    command = np.column_stack([table[name] for name in ("ROut", "POut", "AOut", "YOut")])
    name, angles = "RATE", False
    if kind == HELICOPTER and file.count("SWSH"):
        swash, at = _floats(file.table("SWSH")), file.times("SWSH") - start_s
        turned = np.radians(np.column_stack([swash[name] for name in ("RCyc", "PCyc", "Col")]))
        command[:, :3] = _at(Timed(at, turned), t_s)
        name, angles = "SWSH", True
    rates = np.radians(np.column_stack([table[name] for name in ("R", "P", "Y")]))
    asked = np.radians(np.column_stack([table["RDes"], table["PDes"]]))
    return Source(
        kind, Timed(t_s, command), Timed(t_s, rates), _force(log), Timed(t_s, asked), _velocity(log), _landed(log),
        angles, name, "RATE.RDes, PDes",
    )  # fmt: skip


def _of_ulog(path: Path, log: Log) -> Source:
    names = ("actuator_controls_0", "vehicle_torque_setpoint", "vehicle_thrust_setpoint", "vehicle_rates_setpoint",
             "vehicle_angular_velocity", "sensor_combined")  # fmt: skip
    topics = read_topics(path, names, ("control", "xyz", "roll", "pitch", "gyro_rad"), ())
    start_s = (log.clock_start_s or 0.0) - topics.start_s
    controls = topics.fullest("actuator_controls_0", needs=("control[0]", "control[3]"))
    torque = topics.fullest("vehicle_torque_setpoint", needs=("xyz[0]",))
    if controls is None and torque is None:
        raise InputError(
            f"{path}: no commands (vehicle_torque_setpoint, or actuator_controls_0 before PX4 1.14); "
            "SDLOG_PROFILE decides what the vehicle writes"
        )
    if torque is not None:
        thrust = topics.fullest("vehicle_thrust_setpoint", needs=("xyz[2]",))
        up = (
            np.full(len(torque), np.nan)
            if thrust is None
            else -np.interp(torque.t_s, thrust.t_s, thrust.column("xyz[2]"))
        )
        command = np.column_stack([*torque.parts("xyz", 2), up, torque.column("xyz[2]")])
        at, name = torque.t_s, torque.name
    else:
        assert controls is not None
        command = np.column_stack([controls.column(f"control[{k}]") for k in (0, 1, 3, 2)])
        at, name = controls.t_s, controls.name
    turning = [
        Timed(topic.t_s - start_s, topic.vector(field, 3))
        for field, topic in (
            ("xyz", topics.fullest("vehicle_angular_velocity", needs=("xyz[2]",))),
            ("gyro_rad", topics.fullest("sensor_combined", needs=("gyro_rad[2]",))),
        )
        if topic is not None
    ]
    if not turning:
        raise InputError(f"{path}: no body rates (vehicle_angular_velocity, sensor_combined) beside the commands")
    asked = topics.fullest("vehicle_rates_setpoint", needs=("roll", "pitch"))
    setpoint = (
        None
        if asked is None
        else Timed(asked.t_s - start_s, np.column_stack([asked.column("roll"), asked.column("pitch")]))
    )
    kind = HELICOPTER if log.parameters.get("MAV_TYPE") == HELICOPTER_TYPE else MULTIROTOR
    return Source(
        kind, Timed(at - start_s, command), turning[0], _force(log), setpoint, _velocity(log), _landed(log), False,
        name, "vehicle_rates_setpoint",
    )  # fmt: skip


def _force(log: Log) -> Timed | None:
    imu = log.streams.get(Sensor.IMU)
    return None if imu is None else Timed(imu.t_s, imu.value[:, 3:6])


def _landed(log: Log) -> Timed | None:
    stream = log.streams.get(Sensor.LANDED)
    return None if stream is None else Timed(stream.t_s, stream.value[:, :1])


def _velocity(log: Log) -> Timed | None:
    table = log.autopilot if log.autopilot is not None else log.truth
    if table is None or VELOCITY_BODY[0] not in table:
        return None
    return Timed(table["t_s"], _columns(table, VELOCITY_BODY[:2]))


def _columns(table: Table, names: Iterable[str]) -> Array:
    return np.column_stack([table[name] for name in names])


def _floats(table: Mapping[str, Any]) -> dict[str, Array]:
    return {name: np.asarray(column, float) for name, column in table.items() if np.asarray(column).dtype.kind in "iuf"}


# -- one clock ----------------------------------------------------------------------------------------------------
def on_one_clock(path: Path, found: Source) -> Commanded:
    """The longest stretch in the air, on the clock of the slowest of commands and rates."""
    wanted = [found.command, found.rates, *([found.setpoint] if found.setpoint is not None else [])]
    steps = [float(np.median(np.diff(each.t_s))) if len(each.t_s) > 1 else np.inf for each in wanted]
    step_s = max(steps)
    start_s, end_s = _stretch(wanted, found.landed)
    if not end_s - start_s >= LEAST_SPAN_S:
        raise InputError(
            f"{path}: {max(end_s - start_s, 0.0):.1f} s in the air with commands and rates; "
            f"{LEAST_SPAN_S:g} s are needed"
        )
    t_s = np.arange(start_s, end_s, step_s)
    flight = Commanded(
        path, found.kind, step_s, _at(found.command, t_s), _at(found.rates, t_s), _maybe(found.force, t_s),
        _maybe(found.setpoint, t_s), _maybe(found.velocity, t_s), found.angles,
        min(SHARE_OF_RATE / step_s, HIGHEST_HZ[found.kind]), found.command_name, found.setpoint_name,
        found.exact, commands_late_s=found.commands_late_s, rates_mean_s=found.rates_mean_s,
    )  # fmt: skip
    if found.setpoint is None:
        stir = stir_in(flight)
        flight = flight._replace(
            setpoint=stir, setpoint_name="" if stir is None else found.setpoint_name, periodic=True
        )
    return flight


def _stretch(wanted: Iterable[Timed], landed: Timed | None) -> tuple[float, float]:
    """The longest time without a gap in any signal and in the air."""
    times = [each.t_s for each in wanted]
    begins, ends = max(t[0] for t in times), min(t[-1] for t in times)
    cuts = [(t[k], t[k + 1]) for t in times for k in np.flatnonzero(np.diff(t) > LONGEST_GAP_S)]
    if landed is not None and len(landed.t_s):
        down = landed.value[:, 0] > 0.5
        until = np.append(landed.t_s[1:], max(ends, landed.t_s[-1]))
        changes = np.flatnonzero(np.diff(down.astype(int), prepend=0, append=0))
        cuts += [(landed.t_s[a], until[b - 1]) for a, b in zip(changes[::2], changes[1::2], strict=True)]
    at, best = begins, (begins, begins)
    for low, high in sorted(cuts):
        if min(low, ends) - at > best[1] - best[0]:
            best = (at, min(low, ends))
        at = max(at, high)
    return best if best[1] - best[0] >= ends - at else (at, ends)


def _at(found: Timed, t_s: Array) -> Array:
    return np.column_stack([np.interp(t_s, found.t_s, column) for column in found.value.T])


def _maybe(found: Timed | None, t_s: Array) -> Array | None:
    return None if found is None or len(found.t_s) < 2 else _at(found, t_s)


# -- our own stir -------------------------------------------------------------------------------------------------
def stir_in(flight: Commanded) -> Array | None:
    """The stir of our own autopilot (`control.learning`) where the cyclics hold it, (n, 2) of roll and pitch [rad];
    None where they do not. Its law is known, so it is the set-point that knows nothing of gusts.
    """
    if flight.kind != HELICOPTER or not flight.angles or not np.isclose(flight.step_s, EPOCH_S, rtol=1e-3):
        return None
    cyclic = flight.command[:, 1::-1] - flight.command[:, 1::-1].mean(axis=0)  # lon and lat, as STIR has them
    if len(cyclic) < STIR_EPOCHS:
        return None
    whole = len(cyclic) // STIR_EPOCHS * STIR_EPOCHS
    folded = cyclic[:whole].reshape(-1, STIR_EPOCHS, 2).sum(axis=0)
    spectrum = np.conj(np.fft.rfft(STIR, axis=0)) * np.fft.rfft(folded, axis=0)
    turn = int(np.argmax(np.fft.irfft(spectrum.sum(axis=1), STIR_EPOCHS)))
    stir = STIR[(np.arange(len(cyclic)) - turn) % STIR_EPOCHS]
    power = float((STIR**2).sum(axis=1).mean())
    window = np.ones(STIR_EPOCHS) / STIR_EPOCHS
    share = np.convolve((cyclic * stir).sum(axis=1), window, "same") / power
    active = share > STIRRED * share.max()
    enough = share.max() > LEAST_STIR and active.sum() >= 2 * STIR_EPOCHS
    return np.asarray((stir * active[:, None])[:, ::-1]) if enough else None
