"""A log of the Crazyflie's micro SD deck as a Log: blocks of variables, fixed in rate or written at events.

Format, versions 1 and 2: bitcraze/crazyflie-firmware, src/deck/drivers/src/usddeck.c and tools/usdlog/cfusdlog.py.
0xBC, version and number of block kinds (uint16 each); a kind is its number, its name, and its variables as `name(t)`
with a struct's type letter; then blocks of number (uint16), time (version 1: uint32 ms; 2: uint64 us) and values; a
CRC-32 ends the file. docs/reference/crazyflie.md says which variables are read.

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

import struct
from collections.abc import Callable
from dataclasses import dataclass
from pathlib import Path
from typing import Any, NamedTuple
from zlib import crc32

import numpy as np
from numpy.typing import NDArray

from flownav.core.errors import InputError, arg
from flownav.core.frames import GRAVITY_M_S2, quaternion_from_euler
from flownav.core.measurement import Array, Sensor, Stream
from flownav.core.record import POSITION_NED, Table
from flownav.logs.assembly import MOST_BYTES, content_of, counted, pressure_altitude_m, sensor_stream, sha256_of
from flownav.logs.log import Log, absences_of, frd, ned_from_frd_of_nwu, state_table
from flownav.logs.plausible import of_one_clock

MAGIC = 0xBC
LETTERS = {"B": "u1", "b": "i1", "H": "u2", "h": "i2", "I": "u4", "i": "i4", "Q": "u8", "q": "i8", "e": "f2", "f": "f4"}
CODES = {letter: np.dtype(f"<{kind}") for letter, kind in (LETTERS | {"d": "f8", "?": "?"}).items()}
MOST_KINDS, MOST_VARIABLES, LONGEST_NAME = 256, 256, 80
TIME_STAMPS = {1: (np.dtype("<u4"), 1e-3), 2: (np.dtype("<u8"), 1e-6)}
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


@dataclass
class Block:
    """One kind of block: its name ("fixedFrequency", "estFlow"), times [s] and variables by name."""

    name: str
    t_s: NDArray[np.float64]
    columns: dict[str, NDArray[np.float64]]

    def matrix(self, *names: str) -> Array:
        """Variables side by side (n, len(names))."""
        return np.column_stack([self.columns[name] for name in names])


@dataclass
class Blocks:
    """What a file holds, and what is wrong with it."""

    found: list[Block]
    sha256: str
    notes: list[str]

    def with_variables(self, *names: str) -> Block | None:
        """The block with all these variables that was written most often; None where there is none."""
        usable = [block for block in self.found if set(names) <= block.columns.keys() and len(block.t_s)]
        return max(usable, key=lambda block: len(block.t_s), default=None)


class _Kind(NamedTuple):
    name: str
    variables: tuple[str, ...]
    row: np.dtype[np.void]


def read_blocks(path: Path) -> Blocks:
    """The blocks of a file. InputError where it cannot be read or its head is none of the two versions."""
    content = content_of(path, "a log of the micro SD deck", MOST_BYTES)
    version, kinds, place = _head(path, content)
    sound = len(content) >= 9 and crc32(content[:-4]) == int.from_bytes(content[-4:], "little")
    end = len(content) - 4 if sound else len(content)
    rows, stop = _rows(content, place, end, kinds)
    notes = [] if sound else ["the checksum does not fit: the log was not closed, or is damaged"]
    if stop < end and sound:
        notes.append(f"damaged at byte {stop}: {end - stop} bytes are left out")
    elif stop < end:
        notes.append(f"{end - stop} bytes at the end belong to no whole block and are left out")
    unit_s = TIME_STAMPS[version][1]
    found = []
    for number, kind in kinds.items():
        table = np.frombuffer(b"".join(rows[number]), kind.row)
        columns = {name: table[f"v{k}"].astype(float) for k, name in enumerate(kind.variables)}
        found.append(Block(kind.name, unit_s * table["time"].astype(float), columns))
    return Blocks(found, sha256_of(content), notes)


def looks_like(head: bytes) -> bool:
    """Whether a file's first bytes are those of such a log: magic, version, and a first kind with a sane name."""
    if len(head) < 12 or head[0] != MAGIC or int.from_bytes(head[1:3], "little") not in TIME_STAMPS:
        return False
    count, name = int.from_bytes(head[3:5], "little"), head[7 : 7 + LONGEST_NAME].split(b"\0")[0]
    return 0 < count <= MOST_KINDS and len(name) > 0 and name.isascii() and name.decode().isprintable()


def _head(path: Path, content: bytes) -> tuple[int, dict[int, _Kind], int]:
    """Version, kinds by number, and where the blocks begin."""
    if len(content) < 5 or content[0] != MAGIC:
        raise InputError(f"{path}: no log of the micro SD deck (it begins with 0xBC)")
    version, count = struct.unpack_from("<HH", content, 1)
    if version not in TIME_STAMPS:
        raise InputError(f"{path}: version {version} of the micro SD deck's log; 1 and 2 are known")
    if not 0 < count <= MOST_KINDS:
        raise InputError(f"{path}: a damaged head ({count} kinds of blocks); give another log")
    kinds: dict[int, _Kind] = {}
    place = 5
    try:
        for _ in range(count):
            number = struct.unpack_from("<H", content, place)[0]
            name, place = _name(content, place + 2)
            variables = struct.unpack_from("<H", content, place)[0]
            place += 2
            if variables > MOST_VARIABLES:
                raise ValueError(f"{variables} variables")
            fields: list[tuple[str, Any]] = [("number", np.dtype("<u2")), ("time", TIME_STAMPS[version][0])]
            names = []
            for k in range(variables):
                spelled, place = _name(content, place)
                if len(spelled) < 4 or spelled[-3] != "(" or spelled[-1] != ")" or spelled[-2] not in CODES:
                    raise ValueError(f"variable {spelled!r}")
                names.append(spelled[:-3])
                fields.append((f"v{k}", CODES[spelled[-2]]))
            kinds.setdefault(number, _Kind(name, tuple(names), np.dtype(fields)))
    except (struct.error, ValueError) as error:
        raise InputError(f"{path}: a damaged head ({error}); give another log") from error
    return version, kinds, place


def _name(content: bytes, place: int) -> tuple[str, int]:
    """A text up to its zero, and the place after it. ValueError where it does not end or is no text."""
    end = content.find(b"\0", place, place + LONGEST_NAME)
    if end < 0:
        raise ValueError("a name without an end")
    return content[place:end].decode("ascii"), end + 1


def _rows(content: bytes, place: int, end: int, kinds: dict[int, _Kind]) -> tuple[dict[int, list[bytes]], int]:
    """Each kind's blocks as bytes, and where the first byte lies that belongs to no whole block."""
    rows: dict[int, list[bytes]] = {number: [] for number in kinds}
    sizes = {number: kind.row.itemsize for number, kind in kinds.items()}
    while place + 2 <= end:
        number = content[place] | content[place + 1] << 8
        size = sizes.get(number)
        if size is None or place + size > end:
            break
        rows[number].append(content[place : place + size])
        place += size
    return rows, place


# -- the log ------------------------------------------------------------------------------------------------
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
    imu, attitude, baro, mag = (_plain(blocks, sensor) for sensor in PLAIN)
    found = (imu, attitude, _flow(blocks), _range(blocks), baro, mag)
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
        path, streams, None, truth, {path.name: blocks.sha256},
        (*blocks.notes, *strays, *([scale] if Sensor.FLOW_RATE in streams else [])),
        own, "Crazyflie's Kalman filter" if own is not None else "",
        {"range_m": (0.0, 1e-3 * FARTHEST_MM)} if Sensor.RANGE in streams else {},
        tuple(absences_of(streams, **LACKING)), clock_start_s=start_s, truth_name=truth_name,
    )  # fmt: skip


def _xyz(name: str) -> tuple[str, ...]:
    return tuple(f"{name}{axis}" for axis in "xyz")


# how a sensor's values follow from variables of one block [deg/s, G, gauss, mbar; FLU]; the first that are logged serve
PLAIN: dict[Sensor, tuple[tuple[tuple[str, ...], Callable[[Array], Array]], ...]] = {
    Sensor.IMU: ((
        (*_xyz("gyro."), *_xyz("acc.")),
        lambda value: np.column_stack([frd(np.radians(value[:, :3])), frd(GRAVITY_M_S2 * value[:, 3:])]),
    ),),
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
}  # fmt: skip


def _plain(blocks: Blocks, sensor: Sensor) -> Stream | None:
    for names, convert in PLAIN[sensor]:
        block = blocks.with_variables(*names)
        if block is not None:
            return sensor_stream(sensor, block.t_s, convert(block.matrix(*names)))
    return None


def _quaternion(block: Block) -> Array | None:
    """Body FRD to NED (n, 4), of the estimator's quaternion or of its angles; None where neither is logged."""
    logged = (
        turn(block.matrix(*names)) for names, turn in PLAIN[Sensor.ATTITUDE] if set(names) <= block.columns.keys()
    )
    return next(logged, None)


def _flow(blocks: Blocks) -> Stream | None:
    """Counts of 10 ms each; a log that is faster repeats them, and has each once here."""
    block = blocks.with_variables("motion.deltaX", "motion.deltaY")
    if block is None:
        return None
    delta = block.matrix("motion.deltaX", "motion.deltaY")
    quality = block.columns.get("motion.squal", np.full(len(delta), 255.0))
    fresh = _each_read_once(block.t_s)
    inside = (np.abs(delta) < OUTLIER_COUNTS).all(axis=1)
    rates = -RAD_PER_COUNT / READ_EVERY_S * delta
    value = np.column_stack([rates, np.full_like(rates, np.nan)])
    good = fresh & inside
    return sensor_stream(
        Sensor.FLOW_RATE, block.t_s[good], value[good], quality=quality[good], delay_s=0.5 * READ_EVERY_S,
        rejected=counted(outlier=fresh & ~inside, repeated=~fresh),
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
    return sensor_stream(Sensor.RANGE, block.t_s[heard], 1e-3 * range_mm[heard], rejected=counted(invalid=~heard))


def _estimate(blocks: Blocks) -> Table | None:
    """The estimator's own state: position [m], velocity [m/s] in its world, attitude where it is in the same block."""
    names = (*_xyz("stateEstimate."), *_xyz("stateEstimate.v"))
    block = blocks.with_variables(*names)
    if block is None:
        return None
    state = block.matrix(*names)
    rows = _ordered(block.t_s, state)
    if len(rows) < LEAST_ROWS:
        return None
    turned = _quaternion(block)
    if turned is not None:
        turned = turned[rows] if np.all(np.abs(np.linalg.norm(turned[rows], axis=1) - 1.0) < 0.1) else None
    return state_table(block.t_s[rows], frd(state[rows, :3]), frd(state[rows, 3:]), turned)


def _truth(blocks: Blocks) -> tuple[Table | None, str]:
    """What was sent to the vehicle from outside: motion capture (locSrv), else the lighthouse deck's position."""
    for group, name in (("locSrv", "motion capture (locSrv)"), ("lighthouse", "the lighthouse deck")):
        names = _xyz(f"{group}.")
        block = blocks.with_variables(*names)
        if block is None:
            continue
        place = block.matrix(*names)
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
