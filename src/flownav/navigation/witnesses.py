"""The witnesses of the navigator, a row each, and by whom each of its beliefs may be set.

A row states what the judge (`reasons.judged`), the gate and the memory of refusals make of a witness's readings; the
tests read it, hold it against the code, and let each witness lie in turn (tests/navigation/test_lying_witnesses.py).
The readings' way itself is `take.take`.
"""

from typing import Any, NamedTuple

from flownav.core.measurement import Sensor
from flownav.estimation.gating import Reason
from flownav.estimation.laws.attitude import attitude, heading, level
from flownav.estimation.laws.flow import body_velocity, flow_rate
from flownav.estimation.laws.gps import gps_position, gps_velocity
from flownav.estimation.laws.height import baro_altitude, range_along_boresight
from flownav.estimation.laws.pad import pad_fix
from flownav.estimation.laws.still import pad_below, position_itself, velocity_itself
from flownav.estimation.states import (
    ACCEL_BIAS,
    ATTITUDE,
    GPS_FAST,
    GPS_SLOW,
    GPS_VELOCITY,
    GROUND,
    INS_ERROR,
    PAD,
    POSITION,
    VELOCITY,
)


class Witness(NamedTuple):
    """One witness.

    laws: the observation laws that its components are held against. noise: the settings that give its variance where it
    states none; "" stands for none. limits: why the judge finds it out of reach. repeats: whether a value that repeats
    itself is refused. outliers: why other evidence refuses a reading that its own gate might pass. whole: how many
    components pass or fail together. whiteness: how many components have their noise followed. frees: the states that
    a refusal that lasts frees, less sure or set anew. contradicted_by: witnesses that can refute it. first: how many of
    its readings must agree before it sets its datum.
    """

    kind: Sensor
    laws: tuple[Any, ...]
    noise: tuple[str, ...]
    limits: tuple[Reason, ...] = ()
    repeats: bool = False
    outliers: tuple[Reason, ...] = ()
    whole: int = 1
    whiteness: int = 0
    frees: tuple[int, ...] = ()
    contradicted_by: tuple[Sensor, ...] = ()
    first: int = 0


S, R = Sensor, Reason
HEADING = ATTITUDE + 2
PAD_PLACE = tuple(PAD + i for i in range(3))

WITNESSES: tuple[Witness, ...] = (
    Witness(
        S.GPS_POSITION, (gps_position, pad_below), ("gps_white_sigma_m", "gps_white_sigma_down_m", "gps_white_share"),
        outliers=(R.INNOVATION_GATE,), whole=2, whiteness=3,
        frees=tuple(first + i for first in (POSITION, GPS_SLOW, GPS_FAST, PAD) for i in range(3)),
        contradicted_by=(S.FLOW_RATE, S.FLOW_VELOCITY, S.RANGE),
    ),
    Witness(
        S.GPS_VELOCITY, (gps_velocity,), ("gps_velocity_white_m_s", "gps_velocity_white_down_m_s"),
        outliers=(R.INNOVATION_GATE,), whole=2, whiteness=3,
        frees=tuple(first + i for first in (VELOCITY, GPS_VELOCITY) for i in range(3)),
        contradicted_by=(S.FLOW_RATE, S.FLOW_VELOCITY, S.RANGE),
    ),
    Witness(
        S.FLOW_RATE, (flow_rate,), ("flow_sigma_rad_s", "flow_low_quality_sigma_rad_s"),
        limits=(R.NO_HEIGHT, R.OUT_OF_RANGE, R.TILTED, R.NEAR_GROUND), outliers=(R.NO_HEADING,),
        frees=(VELOCITY, VELOCITY + 1), contradicted_by=(S.GPS_POSITION, S.GPS_VELOCITY),
    ),
    Witness(
        S.FLOW_VELOCITY, (body_velocity,), ("flow_sigma_rad_s", "flow_low_quality_sigma_rad_s"),
        limits=(R.TILTED, R.NEAR_GROUND), outliers=(R.NO_HEADING,),
        frees=(VELOCITY, VELOCITY + 1), contradicted_by=(S.GPS_POSITION, S.GPS_VELOCITY),
    ),
    Witness(
        S.RANGE, (range_along_boresight,), ("range_sigma_m", "range_relative_sigma"),
        limits=(R.OUT_OF_RANGE, R.TILTED), repeats=True, outliers=(R.DATUM,), whiteness=1,
        frees=(GROUND, POSITION + 2, VELOCITY + 2, *(ACCEL_BIAS + i for i in range(3))),
        contradicted_by=(S.IMU, S.BARO, S.GPS_POSITION), first=3,
    ),
    Witness(
        S.BARO, (baro_altitude,), ("baro_sigma_m",), whiteness=1, contradicted_by=(S.LANDED,), first=1,
    ),
    Witness(
        S.ATTITUDE, (attitude, level, heading), ("ins_tilt_white_rad", "heading_noise_rad"),
        contradicted_by=(S.IMU, S.GPS_VELOCITY), frees=(HEADING, INS_ERROR + 2),
    ),
    Witness(
        S.MAG, (heading,), ("heading_noise_rad",), outliers=(R.NO_HEADING, R.INNOVATION_GATE),
        frees=(HEADING, INS_ERROR + 2), contradicted_by=(S.FLOW_RATE, S.IMU, S.GPS_VELOCITY),
    ),
    Witness(
        S.YAW, (heading,), ("heading_noise_rad",), outliers=(R.NO_HEADING, R.INNOVATION_GATE),
        frees=(HEADING, INS_ERROR + 2), contradicted_by=(S.FLOW_RATE, S.IMU, S.GPS_VELOCITY),
    ),
    Witness(
        S.POSE, (position_itself,), ("pose_sigma_m",), outliers=(R.INNOVATION_GATE,), whole=2,
    ),
    Witness(
        S.PAD, (pad_fix,), ("pad_angle_sigma_rad", "pad_distance_sigma"), limits=(R.OUT_OF_RANGE,),
        outliers=(R.DATUM, R.INNOVATION_GATE), whole=3, frees=PAD_PLACE, first=3,
    ),
    Witness(
        S.LANDED, (velocity_itself, pad_below), ("still_sigma_m_s",), outliers=(R.INNOVATION_GATE,),
        contradicted_by=(S.RANGE, S.GPS_VELOCITY, S.FLOW_RATE),
    ),
)  # fmt: skip


class Belief(NamedTuple):
    """One thing that the navigator believes: the witnesses who may set it, and those who alone can do so at once.

    alone: of the witnesses those of whom a single reading sets it; what it sets is unsure by the doubt that is stated.
    doubt: the name of that doubt, "" where nobody sets it alone.
    """

    name: str
    witnesses: tuple[Sensor, ...]
    alone: tuple[Sensor, ...] = ()
    doubt: str = ""


BELIEFS: tuple[Belief, ...] = (
    Belief("level", (S.IMU, S.ATTITUDE, S.GPS_VELOCITY, S.FLOW_RATE), (S.IMU,), "start.LEVELLED_FLOOR_RAD"),
    Belief("heading", (S.MAG, S.YAW, S.ATTITUDE, S.GPS_VELOCITY, S.FLOW_RATE), (S.MAG, S.YAW, S.ATTITUDE),
           "start.COMPASS_HEADING_RAD"),
    Belief("rest", (S.IMU, S.RANGE, S.GPS_VELOCITY, S.FLOW_RATE, S.LANDED)),
    Belief("height over ground", (S.RANGE, S.BARO, S.GPS_POSITION, S.IMU), (S.RANGE,), "verdicts.UNKNOWN_M"),
    Belief("velocity", (S.GPS_VELOCITY, S.FLOW_RATE, S.FLOW_VELOCITY, S.IMU, S.LANDED)),
    Belief("position", (S.GPS_POSITION, S.POSE, S.PAD, S.FLOW_RATE), (S.GPS_POSITION, S.POSE), "gps_slow_sigma_m"),
    Belief("biases", (S.IMU, S.GPS_VELOCITY, S.FLOW_RATE, S.RANGE)),
    Belief("scale", (S.FLOW_RATE, S.GPS_VELOCITY)),
    Belief("pad", (S.PAD, S.LANDED), (S.LANDED,), "verdicts.UNKNOWN_M"),
)  # fmt: skip


def witness(kind: Sensor) -> Witness:
    """The row of a kind of sensor. KeyError where it is none: inertial readings move the filter and are not judged."""
    return {row.kind: row for row in WITNESSES}[kind]
