"""Readings that wait: how they lie on the rings of `waiting`, whose sizes are stated."""

from typing import Annotated, Generic, NamedTuple, TypeVar

import numpy as np

from flownav.core.compile import Work, equation, width_of
from flownav.core.measurement import Sensor

IMU, ATTITUDE, FLOW_RATE = float(Sensor.IMU), float(Sensor.ATTITUDE), float(Sensor.FLOW_RATE)
AS_IS, WITHHELD, SILENT = 0.0, 1.0, 2.0
Value = TypeVar("Value")


class Sizes(NamedTuple):
    """How many readings there is room for: rows of the ring, of the table, of the attitudes; most: that may wait."""

    ring: float
    table: float
    attitudes: float
    most: float


class Queue(NamedTuple):
    """Places of waiting readings: first of the ring's rows, how many lie there and how many of these were fed; how many
    in the table; first of the attitudes and how many. order: of the newest reading that arrived. released_s: the
    instant up to which readings were fed; newest_s: the newest that was described.
    """

    first: float = 0.0
    count: float = 0.0  # type: ignore[assignment]  # a record's field hides tuple's method
    fed: float = 0.0
    table: float = 0.0
    attitude_first: float = 0.0
    attitudes: float = 0.0
    order: float = 0.0
    released_s: float = -np.inf
    newest_s: float = -np.inf


class Kept(NamedTuple):
    """The newest inertial reading that was no spike: its time, minus infinity before the first; body FRD."""

    read_s: float = -np.inf
    gyro_x: float = 0.0
    gyro_y: float = 0.0
    gyro_z: float = 0.0
    accel_x: float = 0.0
    accel_y: float = 0.0
    accel_z: float = 0.0


class OwnGyro(NamedTuple):
    """A flow sensor's own gyro that was taken for dead: its first reading about forward and right [rad/s], NaN before
    that, infinite once it has read something else; over how many readings it was compared with the inertial unit, and
    how much more it reads on average [rad/s].
    """

    first_x: float = np.nan
    first_y: float = np.nan
    readings: float = 0.0
    bias_x: float = 0.0
    bias_y: float = 0.0


class Arrival(NamedTuple):
    """A reading of another sensor: the instant that it describes, which one it was in order of arrival, its sensor,
    values and variances as `records.Reading` has them, quality; end_s: when it arrived, and a flow's exposure ended;
    exposure_s: how long that was, 0 where no turning is to be found for it. withheld: AS_IS, WITHHELD (it is judged and
    not fused), SILENT (the sensor was due and did not come: the filter is brought to that instant and no more).
    """

    t_s: float
    order: float
    sensor: float
    value_0: float
    value_1: float
    value_2: float
    value_3: float
    value_4: float
    value_5: float
    variance_0: float
    variance_1: float
    variance_2: float
    quality: float
    end_s: float
    exposure_s: float
    withheld: float


class Stored(NamedTuple):
    """A reading as it lies in the table: its instant; its tag (order of arrival, quality, exposure or none, withheld,
    sensor); three values; and three numbers more: variances, or values beyond the third where its sensor has such, of
    which a flow with an exposure has one, and then end_s and exposure_s.
    """

    t_s: float
    tag: float
    value_0: float
    value_1: float
    value_2: float
    more_0: float
    more_1: float
    more_2: float


class Inertial(NamedTuple):
    """An inertial reading of the ring: its instant, its order of arrival, below 0 where it is a spike; body FRD."""

    t_s: float
    order: float
    gyro_x: float
    gyro_y: float
    gyro_z: float
    accel_x: float
    accel_y: float
    accel_z: float


class StatedAttitude(NamedTuple):
    """An external attitude: its instant and quaternion, body to earth."""

    t_s: float
    qw: float
    qx: float
    qy: float
    qz: float


# -- how a reading lies in the table --------------------------------------------------------------------------
TAGS = 256.0  # numbers below a quality: 128 with an exposure, 32 times withheld, and the sensor
BELOW_ORDER = 256.0 * TAGS  # numbers below an order of arrival


@equation
def stored(a: Arrival, order: float) -> Stored:
    """A reading as it lies in the table."""
    exposed = a.sensor == FLOW_RATE and a.exposure_s > 0.0
    below = whole_quality(a.quality) * TAGS + (128.0 if exposed else 0.0) + 32.0 * a.withheld + a.sensor
    longer = has_more(a.sensor)
    beyond_0 = a.value_3 if longer else a.variance_0
    beyond_1 = a.end_s if exposed else (a.value_4 if longer else a.variance_1)
    beyond_2 = a.exposure_s if exposed else (a.value_5 if longer else a.variance_2)
    return Stored(
        a.t_s, order * BELOW_ORDER + below, a.value_0, a.value_1, a.value_2, beyond_0, beyond_1, beyond_2
    )  # fmt: skip


@equation
def arrived(m: Stored) -> Arrival:
    """The reading that lies so in the table."""
    order = order_of(m.tag)
    quality = np.floor((m.tag - order * BELOW_ORDER) / TAGS)
    rest = m.tag - order * BELOW_ORDER - quality * TAGS
    exposed = rest >= 128.0
    rest = rest - 128.0 if exposed else rest
    withheld = np.floor(rest / 32.0)
    sensor = rest - 32.0 * withheld
    longer, unstated = has_more(sensor), np.nan
    return Arrival(
        m.t_s, order, sensor, m.value_0, m.value_1, m.value_2,
        m.more_0 if longer else unstated,
        m.more_1 if longer and not exposed else unstated,
        m.more_2 if longer and not exposed else unstated,
        unstated if longer else m.more_0,
        unstated if longer else m.more_1,
        unstated if longer else m.more_2,
        quality, m.more_1 if exposed else m.t_s, m.more_2 if exposed else 0.0, withheld,
    )  # fmt: skip


@equation
def order_of(tag: float) -> float:
    """Which reading it was, in order of arrival."""
    order: float = np.floor(tag / BELOW_ORDER)
    return order


@equation
def whole_quality(quality: float) -> float:
    """A quality as it is kept: a whole number from 0 to 255; 0, no data, where it is none."""
    if not quality >= 0.0:
        return 0.0
    whole: float = np.floor(quality) if quality <= 255.0 else 255.0
    return whole


@equation
def has_more(sensor: float) -> bool:
    """Whether a sensor's readings have more than three values."""
    return (sensor == FLOW_RATE) | (sensor == IMU) | (sensor == ATTITUDE)


# -- how a reading is passed in ---------------------------------------------------------------------------
class BoardReading(NamedTuple, Generic[Value]):
    """A sensor's reading: values as `measurement.COLUMNS` has them; variances, NaN where the sensor states none and its
    datasheet serves; quality, a whole number from 0 to 255, 255 where it has none. It describes the instant delay_s
    before its time. exposure_s: for how long a flow sensor looked, up to its time: the vehicle's turning then is found
    for it; 0 for others. withheld: 0; 1: it is judged and not fused; 2: the sensor was due and did not come.
    """

    value: Annotated[Value, 6]
    variance: Annotated[Value, 3]
    quality: Value
    delay_s: Value
    exposure_s: Value
    withheld: Value


READING = width_of(BoardReading)


@equation
def arrival_of(at: Work, reading: Work) -> Arrival:
    """A reading that arrives: at: when, and its sensor; reading: the numbers of `BoardReading`."""
    return Arrival(
        at[0] - reading[10], 0.0, at[1], reading[0], reading[1], reading[2], reading[3], reading[4], reading[5],
        reading[6], reading[7], reading[8], reading[9], at[0], reading[11], reading[12],
    )  # fmt: skip
