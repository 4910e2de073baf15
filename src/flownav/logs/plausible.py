"""Do a log's sensors agree with each other? A unit or a sign that cannot be shows here.

Limits on single values miss degrees in a calm hover, or a position in radians. Two sensors that see the same
motion do not: the accelerometer must see gravity along the attitude's down, the gyros must turn as the
attitude turns, the GPS velocity must integrate to the GPS position. The bounds are wide: only a wrong unit,
axis or sign breaks them, never a bad sensor.
"""

from collections.abc import Iterable
from pathlib import Path

import numpy as np

from flownav.core.errors import InputError
from flownav.core.frames import rotation_from_quaternion
from flownav.core.measurement import Array, Sensor, Stream
from flownav.core.record import LATEST_S, LONGEST_S
from flownav.logs.assembly import UNIT_LENGTH_WITHIN
from flownav.logs.log import attitude_at, attitude_rates, mean_over

# beyond these, in a stream's own unit, a record is damaged: far more than what a live link or a simulation lets through
LARGEST = {
    Sensor.GPS_POSITION: 1e8, Sensor.GPS_VELOCITY: 1e6, Sensor.FLOW_RATE: 1e6, Sensor.FLOW_VELOCITY: 1e6,
    Sensor.RANGE: 1e7, Sensor.IMU: 1e7, Sensor.ATTITUDE: 2.0, Sensor.BARO: 1e8, Sensor.MAG: 1e6, Sensor.POSE: 1e8,
    Sensor.YAW: 1e6, Sensor.PAD: 1e7, Sensor.LANDED: 1.0,
}  # fmt: skip
GRAVITY_LIMITS_M_S2 = (4.0, 25.0)
LARGEST_TILT_ERROR_RAD = 0.6
WRONG_UNIT_FACTOR = 10.0
WRONG_FLOW_FACTOR = 40.0  # flow moves with translation too; degrees are 57 times as fast at least
LEAST_QUICK_RATE_RAD_S = 0.01  # sample-to-sample rotation that a check may rest on
LEAST_RATE_RAD_S = 0.03
INTERVAL_S = 0.25
LEAST_ROWS = 50
GPS_INTERVAL_S = 5.0
LEAST_GPS_TRAVEL_M = 5.0
LEAST_FIELD_GAUSS = 0.05


def check_plausible(where: Path, streams: dict[Sensor, Stream], *, flow: bool = True) -> None:
    """InputError where two sensors cannot be in the stated units, axes and signs at the same time.

    Nothing is compared without an attitude. flow: False leaves the flow sensor out: in an autopilot's own file it can
    only be the vehicle that has it turned, and such a log is to be read.
    """
    check_times(where, streams)
    if Sensor.ATTITUDE not in streams:
        return
    attitude = streams[Sensor.ATTITUDE]
    if Sensor.IMU in streams:
        _check_gravity(where, streams[Sensor.IMU], attitude)
        _check_rates(where, "imu gyro", streams[Sensor.IMU], (0, 1, 2), attitude, signed=True)
    if flow and Sensor.FLOW_RATE in streams:
        _check_rates(where, "flow gyro", streams[Sensor.FLOW_RATE], (2, 3), attitude, signed=True)
        _check_rates(where, "flow", streams[Sensor.FLOW_RATE], (0, 1), attitude, signed=False)
    if Sensor.GPS_POSITION in streams and Sensor.GPS_VELOCITY in streams:
        _check_gps(where, streams[Sensor.GPS_POSITION], streams[Sensor.GPS_VELOCITY])
    if Sensor.MAG in streams:
        field = float(np.median(np.linalg.norm(streams[Sensor.MAG].value, axis=1)))
        if field < LEAST_FIELD_GAUSS:
            raise InputError(f"{where}: mag: a field of {1e3 * field:.3g} mgauss; the earth's is 250 to 650 (gauss?)")


def check_times(where: Path, streams: dict[Sensor, Stream]) -> None:
    """InputError where times cannot be seconds of one flight, each stream by itself and all together.

    A clock that has leapt makes a log of years, and everything on a grid of its times fills the memory.
    """
    spans = {s.name.lower(): (float(t.t_s[0]), float(t.t_s[-1])) for s, t in streams.items() if len(t)}
    for name, (first, last) in spans.items():
        if last - first > LONGEST_S:
            raise InputError(
                f"{where}: {name} covers {first:g} to {last:g} s, more than two days; the clock has leapt: cut the log "
                "there"
            )
        if not max(-first, last) < LATEST_S:
            raise InputError(f"{where}: {name} covers {first:g} to {last:g} s; no clock shows that in seconds")
    if not spans:
        return
    (early, (first, _)), (late, (_, last)) = (
        min(spans.items(), key=lambda span: span[1][0]), max(spans.items(), key=lambda span: span[1][1])
    )  # fmt: skip
    if last - first > LONGEST_S:
        raise InputError(
            f"{where}: {early} begins at {first:g} s and {late} ends at {last:g} s, more than two days apart; all "
            "sensors need one clock, in seconds"
        )


def check_values(where: Path, streams: dict[Sensor, Stream]) -> None:
    """InputError where a reading is none that a sensor can give: too large, infinite, of a negative variance."""
    for sensor, stream in streams.items():
        name = sensor.name.lower()
        beyond = np.abs(stream.value) > LARGEST[sensor]
        if beyond.any():
            worst = float(stream.value[beyond][0])
            raise InputError(f"{where}: {name}: a reading of {worst:g}; at most {LARGEST[sensor]:g} can be")
        length = np.linalg.norm(stream.value, axis=1)
        if sensor == Sensor.ATTITUDE and not np.all(abs(length - 1.0) < UNIT_LENGTH_WITHIN):
            raise InputError(f"{where}: attitude: a quaternion whose length is far from 1")
        if np.any((stream.variance < 0.0) | np.isinf(stream.variance)):
            raise InputError(f"{where}: {name}: a variance below 0, or infinite")
        if not np.all((stream.quality >= 0.0) & (stream.quality <= 255.0)):
            raise InputError(f"{where}: {name}: a quality that is not from 0 to 255")


def of_one_clock(where: Path, found: Iterable[Stream | None], nothing: str) -> tuple[dict[Sensor, Stream], list[str]]:
    """The streams of most others' clock, by sensor, and a note on each left out, whose clock is days away.

    InputError where there are none, with `nothing` as the reason, and as of `check_times`.
    """
    streams = {stream.sensor: stream for stream in found if stream is not None}
    if not streams:
        raise InputError(f"{where}: {nothing}")
    starts = sorted(float(stream.t_s[0]) for stream in streams.values() if len(stream))
    usual = starts[(len(starts) - 1) // 2] if starts else 0.0
    far = {s for s, stream in streams.items() if len(stream) and abs(stream.t_s[0] - usual) > LONGEST_S}
    notes = [
        f"{sensor.name.lower()} is left out: its clock shows {streams[sensor].t_s[0]:g} s where the others' show "
        f"{usual:g} s ({len(streams[sensor])} readings)"
        for sensor in sorted(far)
    ]
    streams = {sensor: stream for sensor, stream in streams.items() if sensor not in far}
    check_times(where, streams)
    return streams, notes


def _check_gravity(where: Path, imu: Stream, attitude: Stream) -> None:
    if len(imu) < LEAST_ROWS:
        return
    force = imu.value[:, 3:]
    size = float(np.linalg.norm(np.median(force, axis=0)))  # what a vehicle that shakes feels in the middle
    if not GRAVITY_LIMITS_M_S2[0] < size < GRAVITY_LIMITS_M_S2[1]:
        raise InputError(f"{where}: imu accel: a median of {size:.3g} m/s2 is not gravity; m/s2 are needed (g? mg?)")
    rotation = rotation_from_quaternion(*attitude_at(attitude, imu.t_s).T)
    in_earth = np.column_stack([sum(rotation[3 * i + j] * force[:, j] for j in range(3)) for i in range(3)])
    mean = np.median(in_earth, axis=0)
    tilt = float(np.arccos(np.clip(-mean[2] / np.linalg.norm(mean), -1.0, 1.0)))
    if tilt > LARGEST_TILT_ERROR_RAD:
        raise InputError(
            f"{where}: attitude and imu accel disagree about down by {np.degrees(tilt):.0f} degrees; radians, "
            "axes forward-right-down and a specific force of -9.8 m/s2 on z at rest are needed"
        )


def _check_rates(
    where: Path, name: str, stream: Stream, columns: tuple[int, ...], attitude: Stream, signed: bool
) -> None:
    """The slope of the logged rates on the attitude's own, axis by axis."""
    values = stream.value[:, columns]
    known = np.isfinite(values).all(axis=1)
    t_s, values = stream.t_s[known], values[known]
    if len(t_s) < LEAST_ROWS:
        return
    edges = np.arange(max(t_s[0], attitude.t_s[0]), min(t_s[-1], attitude.t_s[-1]), INTERVAL_S)
    if len(edges) < LEAST_ROWS:
        return
    logged = mean_over(t_s, values, edges[:-1], edges[1:])
    turned = attitude_rates(attitude, edges[:-1], edges[1:])
    for column, axis in enumerate(("x", "y", "z")[: len(columns)]):
        reference = turned[:, column]
        if np.sqrt(np.mean(reference**2)) < LEAST_RATE_RAD_S:
            continue
        slope = _slope(reference, logged[:, column])
        likeness = float(np.corrcoef(reference, logged[:, column])[0, 1]) if np.ptp(logged[:, column]) > 0 else 0.0
        factor = WRONG_UNIT_FACTOR if signed else WRONG_FLOW_FACTOR
        if slope > factor and likeness > 0.5 and (signed or not _turns_along(t_s, values[:, column], attitude, column)):
            raise InputError(
                f"{where}: {name}_{axis} is {slope:.0f} times as fast as the attitude turns; rad/s are needed (deg/s?)"
            )
        if signed and likeness < -0.5:
            raise InputError(
                f"{where}: {name}_{axis} turns against the attitude (correlation {likeness:.2f}); axes "
                "forward-right-down are needed"
            )


def _turns_along(t_s: Array, flow: Array, attitude: Stream, axis: int) -> bool:
    """Whether the flow's quick changes are as large as the attitude's: no translation is as quick.

    Slow flight low over the ground moves the flow many times as much as its rotation does, and in step with it.
    """
    later = np.diff(t_s) > 0
    turned = attitude_rates(attitude, t_s[:-1][later], t_s[1:][later])[:, axis]
    quick = np.diff(turned, 2)
    if len(quick) < LEAST_ROWS or np.sqrt(np.mean(quick**2)) < LEAST_QUICK_RATE_RAD_S:
        return False
    return _slope(quick, np.diff(flow[1:][later], 2)) < WRONG_UNIT_FACTOR


def _check_gps(where: Path, position: Stream, velocity: Stream) -> None:
    """Displacements against integrated velocities, over some seconds each."""
    t_s = position.t_s
    if len(t_s) < LEAST_ROWS or t_s[-1] - t_s[0] < 2 * GPS_INTERVAL_S:
        return
    known = np.isfinite(velocity.value).all(axis=1)
    if np.count_nonzero(known) < LEAST_ROWS:
        return
    edges = np.arange(t_s[0], t_s[-1], GPS_INTERVAL_S)
    flown = mean_over(velocity.t_s[known], velocity.value[known, :2], edges[:-1], edges[1:]) * GPS_INTERVAL_S
    moved = np.diff(np.column_stack([np.interp(edges, t_s, column) for column in position.value[:, :2].T]), axis=0)
    continuous = _gap_at(t_s, edges) <= GPS_INTERVAL_S
    continuous = continuous[:-1] & continuous[1:]
    if not continuous.any() or np.sqrt(np.mean(flown[continuous] ** 2)) < LEAST_GPS_TRAVEL_M:
        return
    slope = _slope(flown[continuous].ravel(), moved[continuous].ravel())
    if not 0.2 < slope < 5.0:
        raise InputError(
            f"{where}: gps: positions move {slope:.2g} times as far as the velocities say; degrees (lat_deg, lon_deg) "
            "and m/s (vel_n_m_s, vel_e_m_s) are needed"
        )


def _gap_at(t_s: Array, at_s: Array) -> Array:
    """How far the readings before and after an instant are apart [s]."""
    after = np.clip(np.searchsorted(t_s, at_s), 1, len(t_s) - 1)
    return np.asarray(t_s[after] - t_s[after - 1])


def _slope(reference: Array, logged: Array) -> float:
    return float(np.sum(reference * logged) / np.sum(reference * reference)) if np.any(reference) else np.inf
