"""A Crazyflie's log as streams: G, degrees, millimetres and counts of pixels become the units of `measurement`.

Axes. The Crazyflie's body is forward-left-up and its world z up with x where it was switched on: both are half-turned
about x, so that its x is "north" here (there is no true north in such a log). `stateEstimate.pitch` is nose up positive
("legacy CF2 body coordinate system, where pitch is inverted", src/modules/interface/stabilizer_types.h), which is the
pitch of forward-right-down; yaw changes its sign.

Flow. `motion.deltaX`, `deltaY` are the PMW3901's counts since it was last read, every 10 ms
(src/deck/drivers/src/flowdeck_v1v2.c: vTaskDelay(10)), which turns them by the mounting into
N_x = -deltaY, N_y = -deltaX. The estimator (src/modules/src/kalman_core/mm_flow.c) has ten counts for a pixel,
Npix = 35 pixels for thetapix = 0.71674 rad, and predicts
N_x/10 = dt Npix/thetapix (v_x/z - w_y), N_y/10 = dt Npix/thetapix (v_y/z + w_x) in FLU, which is FRD's
flow_y = w_y + v_x/z and flow_x = w_x - v_y/z.
"""

from __future__ import annotations

from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from flownav.core.errors import InputError
from flownav.core.frames import GRAVITY_M_S2, quaternion_from_euler
from flownav.core.measurement import Array, Sensor, Stream
from flownav.core.record import POSITION_NED, Table
from flownav.logs.assembly import pressure_altitude_m, sensor_stream
from flownav.logs.crazyflie import Block, Blocks, read_blocks
from flownav.logs.frames import frd, ned_from_frd_of_nwu, state_table
from flownav.logs.log import Log, absences_of
from flownav.logs.plausible import of_one_clock

COUNTS_PER_PIXEL, PIXELS, APERTURE_RAD = 10.0, 35.0, 0.71674
RAD_PER_COUNT = APERTURE_RAD / (PIXELS * COUNTS_PER_PIXEL)
READ_EVERY_S = 0.010
OUTLIER_COUNTS = 100  # flowdeck_v1v2.c leaves such a reading out
FARTHEST_MM = 5000.0  # zranger2.c: RANGE_OUTLIER_LIMIT
PA_PER_MBAR = 100.0
LEAST_ROWS = 2

LACKING = {
    "attitude": "no attitude (stateEstimate.qw ... qz, or stateEstimate.roll, pitch, yaw)",
    "imu": "no IMU (acc.x ... z with gyro.x ... z in one block)",
    "range": "no range (range.zrange)",
    "gps_position": "no GPS: a Crazyflie has none",
    "baro": "no barometer (baro.asl)",
    "flow_rate": "no optical flow (motion.deltaX with motion.deltaY)",
}


@np.errstate(all="ignore")  # a flipped bit makes numbers that overflow; the limits leave them out
def read_crazyflie(path: Path, *, flow_instance: int | None = None) -> Log:
    """Read a log of the micro SD deck; times are seconds since the first reading.

    InputError where it cannot be read, holds none of the variables that are known, or a flow instance is asked for
    (a Crazyflie has one flow deck).
    """
    if flow_instance is not None:
        raise InputError(f"--flow-instance: {path} is of a Crazyflie, with one flow deck; leave it out")
    blocks = read_blocks(path)
    start_s = min((float(np.min(block.t_s)) for block in blocks.found if len(block.t_s)), default=0.0)
    for block in blocks.found:
        block.t_s = block.t_s - start_s
    found = (_imu(blocks), _attitude(blocks), _flow(blocks), _range(blocks), _baro(blocks), _mag(blocks))
    held = sorted({name for block in blocks.found for name in block.columns})
    streams, strays = of_one_clock(
        path, found,
        f"no usable reading of any sensor; it holds {', '.join(held[:8]) or 'nothing'}; log acc, gyro, motion.deltaX, "
        "motion.deltaY and range.zrange in the deck's config.txt",
    )  # fmt: skip
    truth, truth_name = _truth(blocks)
    own = _estimate(blocks)
    scale = f"flow: {RAD_PER_COUNT:.6f} rad a count of the PMW3901, read every {1e3 * READ_EVERY_S:.0f} ms"
    return Log(
        path,
        streams,
        None,
        truth,
        {path.name: blocks.sha256},
        (*blocks.notes, *strays, *([scale] if Sensor.FLOW_RATE in streams else [])),
        own,
        "Crazyflie's Kalman filter" if own is not None else "",
        {"range_m": (0.0, 1e-3 * FARTHEST_MM)} if Sensor.RANGE in streams else {},
        tuple(absences_of(streams, **LACKING)),
        clock_start_s=start_s,
        truth_name=truth_name,
    )


def _matrix(block: Block, *names: str) -> Array:
    return np.column_stack([block.columns[name] for name in names])


def _imu(blocks: Blocks) -> Stream | None:
    """acc [G] and gyro [deg/s], FLU."""
    names = (*(f"gyro.{axis}" for axis in "xyz"), *(f"acc.{axis}" for axis in "xyz"))
    block = blocks.with_variables(*names)
    if block is None:
        return None
    value = _matrix(block, *names)
    rates, force = np.radians(value[:, :3]), GRAVITY_M_S2 * value[:, 3:]
    return sensor_stream(Sensor.IMU, block.t_s, np.column_stack([frd(rates), frd(force)]))


def _quaternion(block: Block) -> Array | None:
    """Body FRD to NED (n, 4), of the estimator's quaternion or of its angles [deg]; None where neither is logged."""
    if {f"stateEstimate.q{part}" for part in "wxyz"} <= block.columns.keys():
        return ned_from_frd_of_nwu(_matrix(block, *(f"stateEstimate.q{part}" for part in "wxyz")))
    names = ("stateEstimate.roll", "stateEstimate.pitch", "stateEstimate.yaw")
    if set(names) <= block.columns.keys():
        roll, pitch, yaw = np.radians(_matrix(block, *names)).T
        return np.column_stack(quaternion_from_euler(roll, pitch, -yaw))
    return None


def _attitude(blocks: Blocks) -> Stream | None:
    quaternions = tuple(f"stateEstimate.q{part}" for part in "wxyz")
    block = blocks.with_variables(*quaternions) or blocks.with_variables(
        "stateEstimate.roll", "stateEstimate.pitch", "stateEstimate.yaw"
    )
    turned = None if block is None else _quaternion(block)
    return None if block is None or turned is None else sensor_stream(Sensor.ATTITUDE, block.t_s, turned)


def _flow(blocks: Blocks) -> Stream | None:
    """Counts of 10 ms each; a log that is faster repeats them, and has each once here."""
    block = blocks.with_variables("motion.deltaX", "motion.deltaY")
    if block is None:
        return None
    delta = _matrix(block, "motion.deltaX", "motion.deltaY")
    quality = block.columns.get("motion.squal", np.full(len(delta), 255.0))
    fresh = _each_read_once(block.t_s)
    inside = (np.abs(delta) < OUTLIER_COUNTS).all(axis=1)
    rates = -RAD_PER_COUNT / READ_EVERY_S * delta
    value = np.column_stack([rates, np.full_like(rates, np.nan)])
    good = fresh & inside
    counts = {"outlier": fresh & ~inside, "repeated": ~fresh}
    rejected = {reason: int(np.count_nonzero(bad)) for reason, bad in counts.items() if bad.any()}
    return sensor_stream(
        Sensor.FLOW_RATE, block.t_s[good], value[good], quality=quality[good], delay_s=0.5 * READ_EVERY_S,
        rejected=rejected,
    )  # fmt: skip


def _each_read_once(t_s: Array) -> NDArray[np.bool_]:
    """The rows that lie a reading apart: the first, and each that is 0.9 of 10 ms after the last one taken."""
    keep = np.zeros(len(t_s), bool)
    last = -np.inf
    for row, t in enumerate(t_s.tolist()):
        if t - last >= 0.9 * READ_EVERY_S or t < last:
            keep[row], last = True, t
    return keep


def _range(blocks: Blocks) -> Stream | None:
    block = blocks.with_variables("range.zrange")
    if block is None:
        return None
    range_mm = block.columns["range.zrange"]
    heard = (range_mm > 0.0) & (range_mm < FARTHEST_MM)
    invalid = int(np.count_nonzero(~heard))
    return sensor_stream(
        Sensor.RANGE, block.t_s[heard], 1e-3 * range_mm[heard], rejected={"invalid": invalid} if invalid else {}
    )


def _baro(blocks: Blocks) -> Stream | None:
    block = blocks.with_variables("baro.asl")
    if block is not None:
        return sensor_stream(Sensor.BARO, block.t_s, block.columns["baro.asl"])
    block = blocks.with_variables("baro.pressure")
    if block is None:
        return None
    return sensor_stream(Sensor.BARO, block.t_s, pressure_altitude_m(PA_PER_MBAR * block.columns["baro.pressure"]))


def _mag(blocks: Blocks) -> Stream | None:
    """[gauss], FLU."""
    block = blocks.with_variables("mag.x", "mag.y", "mag.z")
    return (
        None if block is None else sensor_stream(Sensor.MAG, block.t_s, frd(_matrix(block, "mag.x", "mag.y", "mag.z")))
    )


def _estimate(blocks: Blocks) -> Table | None:
    """The estimator's own state: position [m], velocity [m/s] in its world, attitude where it is in the same block."""
    names = (*(f"stateEstimate.{axis}" for axis in "xyz"), *(f"stateEstimate.v{axis}" for axis in "xyz"))
    block = blocks.with_variables(*names)
    if block is None:
        return None
    state = _matrix(block, *names)
    rows = _ordered(block.t_s, state)
    if len(rows) < LEAST_ROWS:
        return None
    turned = _quaternion(block)
    turned = None if turned is None or not np.isfinite(turned[rows]).all() else turned[rows]
    if turned is not None and not np.all(np.abs(np.linalg.norm(turned, axis=1) - 1.0) < 0.1):
        turned = None
    return state_table(block.t_s[rows], frd(state[rows, :3]), frd(state[rows, 3:]), turned)


def _truth(blocks: Blocks) -> tuple[Table | None, str]:
    """What was sent to the vehicle from outside: motion capture (locSrv), else the lighthouse deck's position."""
    for group, name in (("locSrv", "motion capture (locSrv)"), ("lighthouse", "the lighthouse deck")):
        names = tuple(f"{group}.{axis}" for axis in "xyz")
        block = blocks.with_variables(*names)
        if block is None:
            continue
        place = _matrix(block, *names)
        rows = _ordered(block.t_s, place)
        if len(rows) >= LEAST_ROWS and np.ptp(place[rows], axis=0).any():
            position = frd(place[rows])
            return {"t_s": block.t_s[rows], **dict(zip(POSITION_NED, position.T, strict=True))}, name
    return None, ""


def _ordered(t_s: Array, values: Array) -> NDArray[np.int64]:
    """Rows with finite, possible numbers, in order of time."""
    good = np.isfinite(t_s) & np.isfinite(values).all(axis=1) & (np.abs(values) < 1e6).all(axis=1)
    rows = np.flatnonzero(good)
    return rows[np.argsort(t_s[rows], kind="stable")]
