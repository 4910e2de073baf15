"""The rates that a link can carry: of the requested streams, and of the estimates that are sent.

A line that is asked for more than it carries gives no error: the autopilot's buffer fills, readings arrive later and
later, and frames that do not fit are lost at random. So rates come down in the stated order until they fit, those of
the navigator's main sensors last: inertial readings, flow, range and GPS. A serial line carries a tenth of its baud
rate in bytes.
"""

from typing import NamedTuple

from flownav.logs.mavlink.framing import ARDUPILOT, PX4

# of estimates: EKF3 drops one whose stamp is less than 20 ms after the last's (AP_NavEKF3.h, extNavIntervalMin_ms), so
# that 60 a second are 30
ARDUPILOT_MOST_HZ = 1.0 / 0.021
PX4_LEAST_HZ = 30.0  # of estimates; EKF2 does not fuse fewer (docs/en/ros/external_position_estimation.md)
# message: id and rate [Hz]; the IMU moves the state, the others correct it
# Other inertial sensors are compared with the one in use (live/inertial.py); a vehicle without them sends none.
OTHER_IMU = {"SCALED_IMU2": (116, 50), "SCALED_IMU3": (129, 50)}
COMMON = {
    "ATTITUDE_QUATERNION": (31, 50),
    "DISTANCE_SENSOR": (132, 25),
    "GPS_RAW_INT": (24, 10),
    "SCALED_PRESSURE": (29, 10),
    "EXTENDED_SYS_STATE": (245, 5),
    "SYSTEM_TIME": (2, 1),
}
STREAMS = {
    True: {"RAW_IMU": (27, 100), "OPTICAL_FLOW": (100, 50), **OTHER_IMU, **COMMON},  # ArduPilot
    # PX4 has no parameter that shows a simulator, and a vehicle has no truth to send
    False: {
        "SCALED_IMU": (26, 100),
        "HIGHRES_IMU": (105, 100),
        "OPTICAL_FLOW_RAD": (106, 250),
        "OPTICAL_FLOW": (100, 250),
        **OTHER_IMU,
        **COMMON,
        "HIL_STATE_QUATERNION": (115, 25),
    },
}
# Of the line; the rest is for HEARTBEAT, TIMESYNC, texts, answers and what others ask of the vehicle. Asked for
# everything, 115200 baud lose 67 frames a second and readings are 109 ms old; with this none, and 15 (live.md).
LINE_SHARE = 0.8
OVERFULL_SHARE = 0.95  # of the line: more comes than was planned, the autopilot's buffer fills; full lines are at 98 %
LOOK_S = 5.0  # chosen
SIGNATURE_BYTES = 13
# bytes of a MAVLink 2 frame, as ArduPilot and PX4 fill them (zeros at a payload's end are not sent)
FRAME_BYTES = {
    "RAW_IMU": 41, "SCALED_IMU": 36, "SCALED_IMU2": 36, "SCALED_IMU3": 36, "HIGHRES_IMU": 75,
    "OPTICAL_FLOW": 46, "OPTICAL_FLOW_RAD": 56, "ATTITUDE_QUATERNION": 44,
    "DISTANCE_SENSOR": 51, "GPS_RAW_INT": 64, "SCALED_PRESSURE": 28, "EXTENDED_SYS_STATE": 14, "SYSTEM_TIME": 24,
    "SIM_STATE": 96, "HIL_STATE_QUATERNION": 76,
}  # fmt: skip
ESTIMATE_BYTES = {"odometry": 244, "vision": 129 + 69, "landing-target": 72, "none": 0}
ABSENT = {
    True: ("SCALED_IMU3",),
    False: ("OPTICAL_FLOW", "SCALED_IMU2", "SCALED_IMU3", "HIL_STATE_QUATERNION"),
}  # by ArduPilot or not: asked for in case, and takes no part of the line
TRUTHS = ("SIM_STATE", "HIL_STATE_QUATERNION")
# in this order: messages, and the rate that they come down to [Hz]
STEPS: tuple[tuple[tuple[str, ...], float], ...] = (
    (TRUTHS, 5),
    (("SCALED_IMU2", "SCALED_IMU3"), 1),  # too few below 30 Hz to hold another against (live/inertial.py)
    (("SCALED_PRESSURE",), 5),
    (("OPTICAL_FLOW_RAD", "OPTICAL_FLOW"), 100),
    (("ATTITUDE_QUATERNION",), 25),
    (("GPS_RAW_INT",), 5),
    (("DISTANCE_SENSOR",), 15),
    (("OPTICAL_FLOW_RAD", "OPTICAL_FLOW"), 50),
    (TRUTHS, 1),
    (("ATTITUDE_QUATERNION",), 10),
    (("SCALED_IMU",), 1),  # of PX4, whose HIGHRES_IMU then serves
    (("HIGHRES_IMU", "RAW_IMU"), 50),
    (("OPTICAL_FLOW_RAD", "OPTICAL_FLOW"), 25),
    (("SCALED_PRESSURE", "EXTENDED_SYS_STATE"), 2),
    (("DISTANCE_SENSOR",), 10),
    (("HIGHRES_IMU", "RAW_IMU"), 40),
    (("OPTICAL_FLOW_RAD", "OPTICAL_FLOW"), 15),
    (("ATTITUDE_QUATERNION",), 5),
    (("HIGHRES_IMU", "RAW_IMU"), 33),  # below it the filter is reset by GPS (benchmarks/test_bench_serial.py)
    (("OPTICAL_FLOW_RAD", "OPTICAL_FLOW"), 10),
    (("DISTANCE_SENSOR",), 5),
    (("HIGHRES_IMU", "RAW_IMU"), 25),
)
Streams = dict[str, tuple[int, float]]  # by message: its number and its rate [Hz]


class Plan(NamedTuple):
    """The rates that a link can carry. bytes_s: what the streams take; estimate_hz: infinite where nothing limits it.

    lacks: the needs that it is too slow for, in words; "" where it carries the minimum.
    """

    streams: Streams
    bytes_s: float
    estimate_hz: float
    lacks: str = ""


def bytes_of(streams: Streams, *, ardupilot: bool, signed: bool = False) -> float:
    """The capacity that streams take of a line [bytes/s]."""
    extra = SIGNATURE_BYTES if signed else 0
    return sum(
        rate_hz * (FRAME_BYTES.get(name, 0) + extra)
        for name, (_, rate_hz) in streams.items()
        if name not in ABSENT[ardupilot]
    )


def plan(
    make: int,
    capacity_bytes_s: float | None,
    send: str,
    *,
    signed: bool = False,
    beside: Streams | None = None,
    spare: float = 1.0,
) -> Plan:
    """Rates for a make (MAV_AUTOPILOT) over a link. beside: streams that are asked for as well (a simulator's truth).

    spare: the part of the line's share that may be planned with; less where others fill it.
    """
    ardupilot = make == ARDUPILOT
    most_hz = ARDUPILOT_MOST_HZ if ardupilot and send in ("odometry", "vision") else float("inf")
    wanted = STREAMS[ardupilot] | (beside or {})
    if capacity_bytes_s is None:
        return Plan(wanted, bytes_of(wanted, ardupilot=ardupilot, signed=signed), most_hz)
    most_bytes_s = LINE_SHARE * spare * capacity_bytes_s

    def taken(steps: list[int]) -> tuple[Streams, float]:
        streams = dict(wanted)
        for names, rate_hz in (STEPS[step] for step in steps):
            for name in streams.keys() & set(names):
                streams[name] = streams[name][0], min(streams[name][1], rate_hz)
        return streams, bytes_of(streams, ardupilot=ardupilot, signed=signed)

    steps: list[int] = []
    while taken(steps)[1] > most_bytes_s and len(steps) < len(STEPS):
        steps.append(len(steps))
    for step in reversed(steps):  # a step that a later one has made needless is taken back
        fewer = [other for other in steps if other != step]
        steps = fewer if taken(fewer)[1] <= most_bytes_s else steps
    streams, bytes_s = taken(steps)
    frame = ESTIMATE_BYTES[send] + (SIGNATURE_BYTES if signed else 0)
    estimate_hz = min(LINE_SHARE * capacity_bytes_s / frame, most_hz) if ESTIMATE_BYTES[send] else float("inf")
    lacks = ["the least rates of the sensors"] if bytes_s > most_bytes_s else []
    lacks += (
        [f"the {PX4_LEAST_HZ:.0f} estimates/s that PX4 fuses"] if make == PX4 and estimate_hz < PX4_LEAST_HZ else []
    )
    return Plan(streams, bytes_s, estimate_hz, " and ".join(lacks))


class Rates:
    """The plan of one session, and whether what arrives keeps to it.

    capacity_bytes_s: of the link, each way; None where nothing is known to limit it.
    """

    def __init__(self, capacity_bytes_s: float | None, send: str, *, signed: bool) -> None:
        self.capacity_bytes_s = capacity_bytes_s
        self._send, self._signed = send, signed
        self._make = -1
        self._beside: Streams = {}
        self._spare = 1.0
        self._bytes, self._since_s = 0, float("nan")
        self.plan = Plan({}, 0.0, float("inf"))

    def begin(self, make: int, beside: Streams | None = None) -> Streams:
        """The streams to ask a vehicle for."""
        self._make, self._beside = make, self._beside | (beside or {})
        self.plan = plan(
            make, self.capacity_bytes_s, self._send, signed=self._signed, beside=self._beside, spare=self._spare
        )
        return self.plan.streams

    @property
    def estimate_every_s(self) -> float:
        """The least time from one estimate to the next."""
        return 1.0 / self.plan.estimate_hz

    def received(self, size: int, now_s: float, *, settled: bool = True) -> bool:
        """Note bytes that arrived. True where the line has been overfull: the streams are to be asked for anew, lower.

        settled: the vehicle has been asked for all planned streams; before, arriving bytes do not test the plan.
        """
        if self.capacity_bytes_s is None:
            return False
        if not settled or not now_s - self._since_s <= 2.0 * LOOK_S:
            self._bytes, self._since_s = 0, now_s
        self._bytes += size
        if now_s - self._since_s < LOOK_S:
            return False
        filled = self._bytes / (now_s - self._since_s) / self.capacity_bytes_s
        self._bytes, self._since_s = 0, now_s
        if filled < OVERFULL_SHARE or self._make < 0 or self._spare < 0.3:
            return False
        self._spare *= 0.8
        return True
