"""A log of the Crazyflie's micro SD deck as a Log. docs/reference/crazyflie.md lists the variables that are read.

Axes. The Crazyflie's body is forward-left-up and its world z up with x where it was switched on: both are half-turned
about x, so that its x is "north" here (there is no true north in such a log). `stateEstimate.pitch` is nose up positive
("legacy CF2 body coordinate system, where pitch is inverted", src/modules/interface/stabilizer_types.h), which is the
pitch of forward-right-down; yaw changes its sign.

Flow. `motion.deltaX`, `deltaY` are the PMW3901's counts since it was last read, every 10 ms
(src/deck/drivers/src/flowdeck_v1v2.c: vTaskDelay(10)), which turns them by the mounting into
N_x = -deltaY, N_y = -deltaX. The estimator (src/modules/src/kalman_core/mm_flow.c, since January 2023) has ten counts
for a pixel, Npix = 35 pixels for thetapix = 0.71674 rad, and predicts
N_x/10 = dt Npix/thetapix (v_x/z - w_y), N_y/10 = dt Npix/thetapix (v_y/z + w_x) in FLU, which is FRD's
flow_y = w_y + v_x/z and flow_x = w_x - v_y/z.

Events. Where the estimator's events are logged, each of its inputs has a block of its own (src/modules/src/estimator/
estimator.c): gyro and accelerometer apart, and the flow only where the sensor saw motion (flowdeck_v1v2.c,
motion == 0xB0). A variable of another task stands in every block that names it, as it was last written.
"""

from collections.abc import Callable
from pathlib import Path
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from flownav.core.errors import InputError, arg
from flownav.core.frames import GRAVITY_M_S2, quaternion_from_euler
from flownav.core.measurement import Array, Sensor, Stream
from flownav.core.record import POSITION_NED, QUATERNION, Table
from flownav.logs.assembly import counted, pressure_altitude_m, readings_once, sensor_stream
from flownav.logs.crazyflie_blocks import Block, Blocks, read_blocks
from flownav.logs.log import Log, absences_of, frd, ned_from_frd_of_nwu, state_table
from flownav.logs.plausible import of_one_clock

COUNTS_PER_PIXEL, PIXELS, APERTURE_RAD = 10.0, 35.0, 0.71674
RAD_PER_COUNT = APERTURE_RAD / (PIXELS * COUNTS_PER_PIXEL)
READ_EVERY_S = 0.010
OUTLIER_COUNTS = 100  # flowdeck_v1v2.c leaves such a reading out
FLOW_EVENT = "estFlow"
# A read without motion is left out of the events, and so is a block for which the deck's buffer had no room. Between
# reads of more than 2 counts (the standard deviation of a reading, flowdeck_v1v2.c) a read without motion is less
# likely than one in 40, and a lost block as likely as one in 20: it stays away.
STILL_COUNTS = 2.0
MOST_STILL_S = 0.1  # of a silence in the air, at either end: a sensor that sees nothing is silent, too; chosen
NEAREST_SEEN_MM = 80.0  # PMW3901MB's datasheet: works from 80 mm on
LONGEST_GAP_S, MOST_READS = 600.0, 1 << 24  # of a clock that has leapt nothing is put back
LONGEST_APART_S = 0.1  # accelerometer and gyro further apart are not one reading; chosen
FARTHEST_MM = 5000.0  # zranger2.c: RANGE_OUTLIER_LIMIT
PA_PER_MBAR = 100.0
UNIT_LENGTH_WITHIN = 0.1
LEAST_ROWS = 2

LACKING = {
    "attitude": "no attitude (stateEstimate.qw ... qz, or stateEstimate.roll, pitch, yaw)",
    "imu": "no IMU (gyro.x ... z with acc.x ... z)",
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
        raise InputError(f"{arg('flow_instance')}: {path} is of a Crazyflie, with one flow deck; leave it out")
    blocks = read_blocks(path)
    start_s = min((float(np.min(block.t_s)) for block in blocks.found if len(block.t_s)), default=0.0)
    for block in blocks.found:
        block.t_s = block.t_s - start_s
    notes: list[str] = []
    found = (_imu(blocks), *(_plain(blocks, sensor) for sensor in PLAIN), _flow(blocks, notes), _range(blocks))
    held = sorted({name for block in blocks.found for name in block.columns})
    streams, strays = of_one_clock(
        path, found,
        f"no usable reading of any sensor; it holds {', '.join(held[:8]) or 'nothing'}; log acc, gyro, motion.deltaX, "
        "motion.deltaY and range.zrange in the deck's config.txt",
    )  # fmt: skip
    truth, truth_name = _truth(blocks)
    own = _estimate(blocks)
    return Log(
        path, streams, None, truth, {path.name: blocks.sha256}, (*blocks.notes, *strays, *notes),
        own, "Crazyflie's Kalman filter" if own is not None else "",
        {"range_m": (0.0, 1e-3 * FARTHEST_MM)} if Sensor.RANGE in streams else {},
        tuple(absences_of(streams, **LACKING)), clock_start_s=start_s, truth_name=truth_name,
    )  # fmt: skip


def _xyz(name: str) -> tuple[str, ...]:
    return tuple(f"{name}{axis}" for axis in "xyz")


# -- inertial readings, attitude, pressure and field ---------------------------------------------------------
GYRO, FORCE = _xyz("gyro."), _xyz("acc.")

# how a sensor's values follow from variables of one block [deg, gauss, mbar; FLU]; the first that are logged serve
PLAIN: dict[Sensor, tuple[tuple[tuple[str, ...], Callable[[Array], Array]], ...]] = {
    Sensor.ATTITUDE: (
        (tuple(f"stateEstimate.q{part}" for part in "wxyz"), ned_from_frd_of_nwu),
        (
            ("stateEstimate.roll", "stateEstimate.pitch", "stateEstimate.yaw"),
            lambda angles: np.column_stack(quaternion_from_euler(*(np.radians(angles) * (1.0, 1.0, -1.0)).T)),
        ),
    ),
    Sensor.BARO: (
        (("baro.asl",), lambda height: height),
        (("baro.pressure",), lambda pressure: pressure_altitude_m(PA_PER_MBAR * pressure)),
    ),
    Sensor.MAG: ((_xyz("mag."), frd),),
}
SLOW = (Sensor.BARO, Sensor.MAG)  # measured less often than a block may be written


def _imu(blocks: Blocks) -> Stream | None:
    """gyro [deg/s] and acc [G], FLU; those of two blocks are one reading at the gyro's time."""
    gyro, force = blocks.with_variables(*GYRO), blocks.with_variables(*FORCE)
    if gyro is None or force is None:
        return None
    pushed, met = (force.matrix(*FORCE), np.ones(len(gyro.t_s), bool)) if gyro is force else _at_times_of(gyro, force)
    value = np.column_stack([frd(np.radians(gyro.matrix(*GYRO))), frd(GRAVITY_M_S2 * pushed)])
    return sensor_stream(Sensor.IMU, gyro.t_s[met], value[met], rejected=counted(no_accelerometer=~met))


def _at_times_of(gyro: Block, force: Block) -> tuple[Array, NDArray[np.bool_]]:
    """Specific force at the gyro's times (n, 3), linear between the readings, and where there are some near by (n,)."""
    rows = _ordered(force.t_s, force.matrix(*FORCE))
    if len(rows) < LEAST_ROWS:
        return np.full((len(gyro.t_s), 3), np.nan), np.zeros(len(gyro.t_s), bool)
    t_s, value = force.t_s[rows], force.matrix(*FORCE)[rows]
    after = np.clip(np.searchsorted(t_s, gyro.t_s), 1, len(t_s) - 1)
    apart_s = np.maximum(t_s[after], gyro.t_s) - np.minimum(t_s[after - 1], gyro.t_s)
    at = np.column_stack([np.interp(gyro.t_s, t_s, column) for column in value.T])
    return at, apart_s <= LONGEST_APART_S


def _plain(blocks: Blocks, sensor: Sensor) -> Stream | None:
    for names, convert in PLAIN[sensor]:
        block = blocks.with_variables(*names)
        if block is not None:
            value = block.matrix(*names)
            news = readings_once(block.t_s, value) if sensor in SLOW else np.ones(len(value), bool)
            return sensor_stream(sensor, block.t_s[news], convert(value[news]), rejected=counted(repeated=~news))
    return None


# -- flow and range ------------------------------------------------------------------------------------------
def _flow(blocks: Blocks, notes: list[str]) -> Stream | None:
    """Counts of a read each, about every 10 ms: a log that is faster repeats them, and has each once here; a log of
    events leaves out those without motion, and has them again here."""
    block = blocks.with_variables("motion.deltaX", "motion.deltaY")
    if block is None:
        return None
    delta = block.matrix("motion.deltaX", "motion.deltaY")
    quality = block.columns.get("motion.squal", np.full(len(delta), 255.0))
    fresh = _each_read_once(block.t_s)
    inside = (np.abs(delta) < OUTLIER_COUNTS).all(axis=1)
    good = fresh & inside
    t_s, delta, quality, every_s = block.t_s[good], delta[good], quality[good], READ_EVERY_S
    put_back = ""
    if block.name == FLOW_EVENT and len(t_s) > 1:
        every_s = _read_period_s(t_s)
        reads = _with_still_reads(t_s, delta, every_s, blocks)
        t_s, delta, quality = reads.t_s, np.where(reads.still[:, None], 0.0, delta[reads.row]), quality[reads.row]
        if reads.still.any():
            put_back = f"; {np.count_nonzero(reads.still)} reads without motion, which are no events, are put back"
    notes.append(f"flow: {RAD_PER_COUNT:.6f} rad a count of the PMW3901, read every {1e3 * every_s:.3g} ms{put_back}")
    rates = -RAD_PER_COUNT / every_s * delta
    return sensor_stream(
        Sensor.FLOW_RATE, t_s, np.column_stack([rates, np.full_like(rates, np.nan)]), quality=quality,
        delay_s=0.5 * every_s, rejected=counted(outlier=fresh & ~inside, repeated=~fresh),
    )  # fmt: skip


def _each_read_once(t_s: Array) -> NDArray[np.bool_]:
    """The rows that lie a reading apart: the first, and each that is 0.9 of 10 ms after the last one taken."""
    keep = np.zeros(len(t_s), bool)
    last = -np.inf
    for row, t in enumerate(t_s.tolist()):
        if t - last >= 0.9 * READ_EVERY_S or t < last:
            keep[row], last = True, t
    return keep


def _read_period_s(t_s: Array) -> float:
    """How often the sensor was read, by the events that follow each other at once; 10 ms where none do."""
    steps = np.diff(t_s)
    next_to = steps[(steps > 0.5 * READ_EVERY_S) & (steps < 1.5 * READ_EVERY_S)]
    return round(float(np.median(next_to)), 5) if len(next_to) else READ_EVERY_S


class _Reads(NamedTuple):
    """The reads of the sensor: the event's row of each, its time, and whether it is put back, without motion."""

    row: NDArray[np.int64]
    t_s: Array
    still: NDArray[np.bool_]


def _with_still_reads(t_s: Array, delta: Array, every_s: float, blocks: Blocks) -> _Reads:
    """The events' reads, and those without motion among them, between the first and the last block of the log.

    They are put back between reads of few counts: the first and the last of a silence, and all of one on the ground.
    """
    spans = [block.t_s for block in blocks.found if len(block.t_s)]
    at = np.concatenate([[min(map(np.min, spans))], t_s, [max(map(np.max, spans))]])
    counts = np.vstack([np.zeros(2), delta, np.zeros(2)])
    steps = np.diff(at)
    slow = np.hypot(*(0.5 * (counts[1:] + counts[:-1])).T) <= STILL_COUNTS
    missing = np.where(slow & (steps < LONGEST_GAP_S), np.maximum(np.rint(steps / every_s) - 1.0, 0.0), 0.0).astype(int)
    missing *= missing.sum() < MOST_READS
    row = np.repeat(np.arange(len(steps)), 1 + missing)
    place = np.arange(len(row)) - np.searchsorted(row, row)  # 0 for the read itself, counted on behind it
    times = at[row] + place * (steps / (1 + missing))[row]
    most = round(MOST_STILL_S / every_s)
    near = (place <= most) | (missing[row] - place < most)
    kept = (place == 0) | near | _on_ground(times, blocks)
    kept[0] = False  # the log's beginning, which is no read
    return _Reads(np.clip(row - 1, 0, len(t_s) - 1)[kept], times[kept], (place > 0)[kept])


def _on_ground(t_s: Array, blocks: Blocks) -> NDArray[np.bool_]:
    """Whether the last range was nearer than the flow sensor sees (n,)."""
    block = blocks.with_variables("range.zrange")
    if block is None:
        return np.zeros(len(t_s), bool)
    order = np.argsort(block.t_s, kind="stable")
    last = np.maximum(np.searchsorted(block.t_s[order], t_s, side="right") - 1, 0)
    return np.asarray(block.columns["range.zrange"][order][last] <= NEAREST_SEEN_MM)


def _range(blocks: Blocks) -> Stream | None:
    """range.zrange [mm], each reading once."""
    block = blocks.with_variables("range.zrange")
    if block is None:
        return None
    range_mm = block.columns["range.zrange"]
    within = (range_mm > 0.0) & (range_mm < FARTHEST_MM)
    news = readings_once(block.t_s, range_mm[:, None])
    good = within & news
    return sensor_stream(
        Sensor.RANGE, block.t_s[good], 1e-3 * range_mm[good], rejected=counted(invalid=~within, repeated=within & ~news)
    )


# -- what others say of the flight ---------------------------------------------------------------------------
def _estimate(blocks: Blocks) -> Table | None:
    """The estimator's own state: position [m], velocity [m/s] in its world, attitude where it is in the same block."""
    found = (
        (block, unit * block.matrix(*names))
        for group, unit in (("stateEstimate", 1.0), ("stateEstimateZ", 1e-3))  # the second in mm and mm/s
        if (block := blocks.with_variables(*(names := (*_xyz(f"{group}."), *_xyz(f"{group}.v"))))) is not None
    )
    block, state = next(found, (None, np.zeros((0, 6))))
    if block is None:
        return None
    rows = _ordered(block.t_s, state)
    if len(rows) < LEAST_ROWS:
        return None
    logged = (turn(block.matrix(*each)) for each, turn in PLAIN[Sensor.ATTITUDE] if set(each) <= block.columns.keys())
    turned = next(logged, None)
    turned = turned[rows] if turned is not None and _are_unit(turned[rows]).all() else None
    return state_table(block.t_s[rows], frd(state[rows, :3]), frd(state[rows, 3:]), turned)


# what was sent to the vehicle from outside, by the names of its position; the first that moves serves
REFERENCES = (
    (_xyz("locSrv."), "motion capture (locSrv)"),
    (_xyz("lighthouse."), "the lighthouse deck"),
    (("x", "y", "z"), "the lighthouse deck"),  # the event lhPosition
)
SENT_ATTITUDE = tuple(f"locSrv.q{part}" for part in "wxyz")


def _truth(blocks: Blocks) -> tuple[Table | None, str]:
    """Motion capture, with its attitude where that was sent, else the lighthouse deck's position."""
    for names, name in REFERENCES:
        block = blocks.with_variables(*names)
        if block is None:
            continue
        place = block.matrix(*names)
        rows = _ordered(block.t_s, place)
        if len(rows) < LEAST_ROWS or not np.ptp(place[rows], axis=0).any():
            continue
        position = frd(place[rows])
        table = {"t_s": block.t_s[rows], **dict(zip(POSITION_NED, position.T, strict=True))}
        if names == REFERENCES[0][0] and set(SENT_ATTITUDE) <= block.columns.keys():
            turned = block.matrix(*SENT_ATTITUDE)[rows]
            if _are_unit(turned).all():
                table |= dict(zip(QUATERNION, ned_from_frd_of_nwu(turned).T, strict=True))
        return table, name
    return None, ""


def _are_unit(quaternion: Array) -> NDArray[np.bool_]:
    return np.asarray(np.abs(np.linalg.norm(quaternion, axis=1) - 1.0) < UNIT_LENGTH_WITHIN)


def _ordered(t_s: Array, values: Array) -> NDArray[np.int64]:
    """Rows with finite, possible numbers, in order of time."""
    good = np.isfinite(t_s) & np.isfinite(values).all(axis=1) & (np.abs(values) < 1e6).all(axis=1)
    rows = np.flatnonzero(good)
    return rows[np.argsort(t_s[rows], kind="stable")]
