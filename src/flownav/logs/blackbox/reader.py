"""A blackbox log of Betaflight or INAV as a Log. docs/reference/blackbox.md lists the fields that are read.

Axes: both firmwares have body forward-left-up and an earth north-west-up: a gyro that turns the nose down is positive,
the accelerometer reads +1 G on z at rest, and `attitude` has pitch positive nose down and yaw clockwise
(src/main/flight/imu.c, imuUpdateEulerAngles: pitch is the arc sine of -rMat[2][0]). INAV's `navPos`, `navVel` are
north, east, up (src/main/navigation/navigation.h).

INAV's flow stands in `debug` where debug_mode is FLOW_RAW (2, src/main/build/debug.h): flow and body rates about x
and y [deg/s] in whole numbers (src/main/sensors/opflow.c). Its estimator has forward speed -(flow_y - body_y) h and
left speed (flow_x - body_x) h (navigation_pos_estimator_flow.c): FRD's flow_x is the same, flow_y of other sign.
Betaflight's flow (debug OPTICALFLOW) changes its meaning between versions, and is not read.
"""

from pathlib import Path

import numpy as np

from flownav.core.errors import InputError, arg
from flownav.core.frames import GRAVITY_M_S2, quaternion_from_euler
from flownav.core.measurement import Array, Sensor, Stream
from flownav.core.record import Table
from flownav.logs.assembly import Origin, content_of, fresh_rows, gps_streams, sensor_stream, sha256_of
from flownav.logs.blackbox.format import Header, headers
from flownav.logs.blackbox.frames import Frames, read_frames
from flownav.logs.log import Log, absences_of, frd, ned_from_frd_of_nwu, state_table
from flownav.logs.plausible import of_one_clock

US, CM, DEG_E7, DECIDEGREE = 1e-6, 1e-2, 1e-7, 0.1
FLOW_RAW = 2  # INAV's debug_mode
QUATERNION_UNIT = 32767.0  # Betaflight's imuQuaternion: 0x7FFF is 1
HIGH_RESOLUTION = 10.0
LEAST_SATELLITES = 5
FIX_3D = 2  # INAV's gpsFixType_e
LEAST_ROWS = 2
FIELDS = frozenset(
    f"{name}[{k}]" for name, count in (("gyroADC", 3), ("gyroData", 3), ("accSmooth", 3), ("attitude", 3),
                                       ("imuQuaternion", 3), ("navPos", 3), ("navVel", 3), ("debug", 4))
    for k in range(count)
) | {"time", "BaroAlt", "baroAlt", "surfaceRaw"}  # fmt: skip

LACKING = {
    "attitude": "no attitude (attitude of INAV, imuQuaternion of Betaflight)",
    "imu": "no IMU (gyroADC with accSmooth)",
    "range": "no range (surfaceRaw)",
    "gps_position": "no GPS fix (GPS frames)",
    "baro": "no barometer (BaroAlt)",
}


@np.errstate(all="ignore")  # a flipped bit makes numbers that overflow; the limits leave them out
def read_blackbox(path: Path, *, flow_instance: int | None = None) -> Log:
    """Read a blackbox log; of a file with several the longest. Times are seconds since its first frame.

    InputError where the file cannot be read, holds no log whose fields are defined, or no reading of a sensor, or a
    flow instance is asked for.
    """
    if flow_instance is not None:
        raise InputError(
            f"{arg('flow_instance')}: {path} is a blackbox log, with one flow sensor at most; leave it out"
        )
    content = content_of(path, "a blackbox log")
    found = headers(content)
    if not found:
        raise InputError(f"{path}: no blackbox log whose header defines its fields; give another log")
    header = max(found, key=lambda each: each.end_byte - each.first_byte)
    frames = read_frames(np.frombuffer(content, np.uint8), header, FIELDS)
    if len(frames.main["time"]) < LEAST_ROWS:
        raise InputError(f"{path}: no whole frame in the log; give another")
    start_us = int(frames.main["time"].min())
    t_s: Array = US * (frames.main["time"] - start_us).astype(float)
    fixes, origin = _gps(header, frames, start_us)
    listed = [_imu(header, frames, t_s), _attitude(frames, t_s), _flow(header, frames, t_s), _range(frames, t_s),
              _baro(frames, t_s), *fixes]  # fmt: skip
    nothing = "no usable reading of any sensor; log gyro, accelerometer, barometer and GPS"
    streams, strays = of_one_clock(path, listed, nothing)
    own = _estimate(frames, t_s, streams.get(Sensor.ATTITUDE))
    return Log(
        path, streams, origin, None, {path.name: sha256_of(content)}, (*_notes(path, found, header, frames), *strays),
        own, header.firmware if own is not None else "", {},
        tuple(absences_of(streams, flow_rate=_no_flow(header), **LACKING)), clock_start_s=US * start_us,
    )  # fmt: skip


def _notes(path: Path, found: list[Header], header: Header, frames: Frames) -> list[str]:
    notes = [f"{header.firmware}, frames of {len(frames.main['time'])} instants"]
    if len(found) > 1:
        notes.append(f"{path.name} holds {len(found)} logs; the longest, number {found.index(header) + 1}, is read")
    if frames.damaged_bytes:
        notes.append(f"{frames.damaged_bytes} bytes belong to no whole frame and are left out")
    return notes


def _no_flow(header: Header) -> str:
    if header.is_inav:
        return "no optical flow (set debug_mode = FLOW_RAW in INAV: it logs flow nowhere else)"
    return "no optical flow (Betaflight logs none in a fixed unit)"


def _matrix(frames: Frames, name: str, count: int) -> Array | None:
    """The fields name[0] ... side by side; None where one is not logged."""
    names = [f"{name}[{k}]" for k in range(count)]
    if not set(names) <= frames.main.keys():
        return None
    return np.column_stack([frames.main[each] for each in names]).astype(float)


def _imu(header: Header, frames: Frames, t_s: Array) -> Stream | None:
    """gyroADC [deg/s by gyro_scale; a tenth with blackbox_high_resolution] and accSmooth [acc_1G counts a G], FLU.

    Cleanflight of 2015 called them gyroData and gyro.scale.
    """
    gyro, force = _matrix(frames, "gyroADC", 3), _matrix(frames, "accSmooth", 3)
    gyro = _matrix(frames, "gyroData", 3) if gyro is None else gyro
    one_g = header.number("acc_1G", 0.0)
    if gyro is None or force is None or not 16.0 <= one_g <= 65536.0:
        return None
    scale = header.number("gyro_scale", header.number("gyro.scale", 1.0))
    scale = scale if 1e-4 < scale < 1e4 else 1.0
    if header.number("blackbox_high_resolution", 0.0) == 1.0:
        scale /= HIGH_RESOLUTION
    value = np.column_stack([frd(np.radians(scale * gyro)), frd(GRAVITY_M_S2 / one_g * force)])
    return sensor_stream(Sensor.IMU, t_s, value)


def _attitude(frames: Frames, t_s: Array) -> Stream | None:
    """INAV's angles [0.1 deg], or the vector part of Betaflight's quaternion, whose scalar part is not negative."""
    angles = _matrix(frames, "attitude", 3)
    if angles is not None:
        rows = fresh_rows(t_s, angles)
        roll, pitch, yaw = np.radians(DECIDEGREE * angles[rows]).T
        return sensor_stream(Sensor.ATTITUDE, t_s[rows], np.column_stack(quaternion_from_euler(roll, -pitch, yaw)))
    vector = _matrix(frames, "imuQuaternion", 3)
    if vector is None:
        return None
    rows = fresh_rows(t_s, vector)
    xyz = vector[rows] / QUATERNION_UNIT
    w = np.sqrt(np.maximum(1.0 - np.sum(xyz * xyz, axis=1), 0.0))
    return sensor_stream(Sensor.ATTITUDE, t_s[rows], ned_from_frd_of_nwu(np.column_stack([w, xyz])))


def _flow(header: Header, frames: Frames, t_s: Array) -> Stream | None:
    """INAV's flow and body rates, each reading once: the numbers stand until the next one of good quality."""
    rates = _matrix(frames, "debug", 4)
    if rates is None or not header.is_inav or header.number("debug_mode", 0.0) != FLOW_RAW:
        return None
    news = np.append(False, (np.diff(rates, axis=0) != 0).any(axis=1))
    value = np.radians(rates[news]) * (1.0, -1.0, 1.0, -1.0)
    return sensor_stream(Sensor.FLOW_RATE, t_s[news], value) if news.any() else None


def _range(frames: Frames, t_s: Array) -> Stream | None:
    """surfaceRaw [cm]; out of range it is negative."""
    if "surfaceRaw" not in frames.main:
        return None
    range_m = CM * frames.main["surfaceRaw"].astype(float)
    rows = fresh_rows(t_s, range_m[:, None]) & (range_m > 0.0)
    return sensor_stream(Sensor.RANGE, t_s[rows], range_m[rows])


def _baro(frames: Frames, t_s: Array) -> Stream | None:
    """[cm]"""
    name = next((name for name in ("BaroAlt", "baroAlt") if name in frames.main), "")
    if not name:
        return None
    height = CM * frames.main[name].astype(float)
    rows = fresh_rows(t_s, height[:, None])
    return sensor_stream(Sensor.BARO, t_s[rows], height[rows])


def _gps(header: Header, frames: Frames, start_us: int) -> tuple[list[Stream], Origin | None]:
    """Positions [1e-7 deg]; altitude in metres (INAV), tenths of a metre (Betaflight). Velocity north, east, down
    where it is logged [cm/s], else from speed [cm/s] and course [0.1 deg] without its vertical part."""
    fixes = {name: column.astype(float) for name, column in frames.gps.items()}
    if not {"GPS_coord[0]", "GPS_coord[1]"} <= fixes.keys() or not len(fixes["time"]):
        return [], None
    count = len(fixes["time"])
    unknown = np.full(count, np.nan)
    if "GPS_fixType" in fixes:
        fix_type = np.where(fixes["GPS_fixType"] >= FIX_3D, 3.0, 0.0)
    else:
        fix_type = np.where(fixes.get("GPS_numSat", unknown) >= LEAST_SATELLITES, 3.0, 0.0)
    altitude = (1.0 if header.is_inav else 0.1) * fixes.get("GPS_altitude", unknown)
    velocity = CM * np.column_stack([fixes.get(f"GPS_velned[{k}]", unknown) for k in range(3)])
    if "GPS_velned[0]" not in fixes and {"GPS_speed", "GPS_ground_course"} <= fixes.keys():
        speed, course = CM * fixes["GPS_speed"], np.radians(DECIDEGREE * fixes["GPS_ground_course"])
        velocity = np.column_stack([speed * np.cos(course), speed * np.sin(course), unknown])
    sigma = CM * np.column_stack([fixes.get(name, unknown) for name in ("GPS_eph", "GPS_eph", "GPS_epv")])
    return gps_streams(
        US * (fixes["time"] - start_us), fix_type,
        (DEG_E7 * fixes["GPS_coord[0]"], DEG_E7 * fixes["GPS_coord[1]"], altitude),
        velocity, position_variance=sigma**2,
    )  # fmt: skip


def _estimate(frames: Frames, t_s: Array, attitude: Stream | None) -> Table | None:
    """INAV's own position [cm] and velocity [cm/s], north, east, up; with the attitude where it is logged."""
    place, speed = _matrix(frames, "navPos", 3), _matrix(frames, "navVel", 3)
    if place is None or speed is None:
        return None
    rows = np.flatnonzero(fresh_rows(t_s, np.column_stack([place, speed])))
    rows = rows[np.append(True, np.diff(t_s[rows]) > 0)] if len(rows) else rows
    rows = rows[np.concatenate([[True], t_s[rows][1:] >= np.maximum.accumulate(t_s[rows])[:-1]])] if len(rows) else rows
    if len(rows) < LEAST_ROWS or not place[rows].any():
        return None
    up_is_down = np.array([1.0, 1.0, -1.0])
    turned = None
    if attitude is not None and len(attitude) > 1:
        from flownav.logs.log import attitude_at

        turned = attitude_at(attitude, t_s[rows])
    return state_table(t_s[rows], CM * place[rows] * up_is_down, CM * speed[rows] * up_is_down, turned)
