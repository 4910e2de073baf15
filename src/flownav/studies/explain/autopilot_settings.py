"""The settings of an autopilot: its parameters in either dialect, read into the same few facts.

PX4 from 1.14 on (EKF2_*_CTRL, EKF2_HGT_REF) and before (EKF2_AID_MASK, EKF2_HGT_MODE); ArduPilot's EKF3 from 4.1 on
(EK3_SRC*). A fact that no parameter states is None: a fact that a hypothesis lacks is reported, not guessed.
"""

from collections.abc import Mapping
from typing import NamedTuple

PX4, ARDUPILOT, INAV, UNKNOWN = "px4", "ardupilot", "inav", ""
INAV_SCALE = "opflow_scale"
BARO, GPS, RANGE, VISION = "barometer", "GPS", "range", "vision"
EKF3_AVERAGING_S = 0.05  # half of flowTimeDeltaAvg_ms, which EKF3 takes off beside EK3_FLOW_DELAY
CENTIMETRE = 0.01
SETS = (1, 2, 3)
OLD_FLOW_BIT, OLD_GPS_BIT = 2, 1  # of EKF2_AID_MASK
FLOW_IN_SET, GPS_IN_SET, EXTERNAL_IN_SET = 5.0, 3.0, 6.0  # of EK3_SRCn_VELXY, of EK3_SRCn_POSXY and VELXY
PX4_EXTERNAL = 0b101  # position and velocity, of EKF2_EV_CTRL
HEIGHTS = {PX4: {0: BARO, 1: GPS, 2: RANGE, 3: VISION}, ARDUPILOT: {1: BARO, 2: RANGE, 3: GPS, 6: VISION}}


class SourceSet(NamedTuple):
    """The sources of one of EKF3's source sets, or of the one that PX4 has. external: velocity or position from
    outside.
    """

    number: int
    flow: bool
    gps: bool
    height: str | None
    compass: bool
    external: bool = False


class AutopilotSettings(NamedTuple):
    """The facts. Delays [s], lengths [m], rates [rad/s]; None where nothing states it.

    height_noise_m: of the height's source. flow_turn_deg: by which the autopilot turns the flow's axes. scale_x, _y:
    factors that it puts on the flow. flow_noise_rad_s: of a good picture.
    """

    dialect: str
    sets: tuple[SourceSet, ...] = ()
    flow_delay_s: float | None = None
    gps_delay_s: float | None = None
    flow_turn_deg: float | None = None
    scale_x: float | None = None
    scale_y: float | None = None
    least_quality: float | None = None
    flow_low_m: float | None = None
    flow_high_m: float | None = None
    flow_fastest_rad_s: float | None = None
    flow_noise_rad_s: float | None = None
    range_low_m: float | None = None
    range_high_m: float | None = None
    height_noise_m: float | None = None

    @property
    def takes_flow(self) -> bool | None:
        """Whether any source set takes flow; None where no parameter states it."""
        return any(one.flow for one in self.sets) if self.sets else None

    def set_at(self, number: int) -> SourceSet | None:
        """A source set by its number."""
        return next((one for one in self.sets if one.number == number), None)


def dialect_of(parameters: Mapping[str, float]) -> str:
    """Whose parameters these are."""
    if any(name.startswith("EKF2_") for name in parameters):
        return PX4
    if any(name.startswith(("EK3_", "EK2_", "AHRS_", "FLOW_", "RNGFND")) for name in parameters):
        return ARDUPILOT
    return INAV if INAV_SCALE in parameters else UNKNOWN


def settings_stated(parameters: Mapping[str, float]) -> AutopilotSettings:
    """The facts that a log's parameters state."""
    return {PX4: _px4, ARDUPILOT: _ardupilot}.get(dialect_of(parameters), lambda _: AutopilotSettings(UNKNOWN))(
        parameters
    )


def _px4(p: Mapping[str, float]) -> AutopilotSettings:
    flow, gps, height = _px4_aids(p)
    sets: tuple[SourceSet, ...] = ()
    if flow is not None:
        sets = (
            SourceSet(
                1,
                flow,
                bool(gps),
                height,
                p.get("EKF2_MAG_TYPE", 0.0) != 5.0,
                int(p.get("EKF2_EV_CTRL", 0.0)) & PX4_EXTERNAL != 0,
            ),
        )
    noise = {BARO: "EKF2_BARO_NOISE", RANGE: "EKF2_RNG_NOISE", GPS: "EKF2_GPS_P_NOISE"}.get(height or "", "")
    scale = p.get("SENS_FLOW_SCALE")
    rotation = p.get("SENS_FLOW_ROT")
    return AutopilotSettings(
        PX4, sets,
        flow_delay_s=_times(p.get("EKF2_OF_DELAY"), 1e-3), gps_delay_s=_times(p.get("EKF2_GPS_DELAY"), 1e-3),
        flow_turn_deg=45.0 * rotation if rotation is not None and 0 <= rotation <= 7 else None,
        scale_x=scale, scale_y=scale, least_quality=p.get("EKF2_OF_QMIN"),
        flow_low_m=p.get("SENS_FLOW_MINHGT"), flow_high_m=p.get("SENS_FLOW_MAXHGT"),
        flow_fastest_rad_s=p.get("SENS_FLOW_MAXR"),
        flow_noise_rad_s=p.get("EKF2_OF_N_MIN"), height_noise_m=p.get(noise),
    )  # fmt: skip


def _px4_aids(p: Mapping[str, float]) -> tuple[bool | None, bool | None, str | None]:
    """Whether flow and GPS are taken, and the height's source; of new parameters, else of old ones."""
    if "EKF2_OF_CTRL" in p or "EKF2_GPS_CTRL" in p:
        flow, gps = p.get("EKF2_OF_CTRL", 1.0) >= 1.0, int(p.get("EKF2_GPS_CTRL", 7.0)) & 1 == 1
        gps = gps and p.get("SYS_HAS_GPS", 1.0) > 0.0
        return flow, gps, HEIGHTS[PX4].get(int(p.get("EKF2_HGT_REF", 1.0)))
    if "EKF2_AID_MASK" in p:
        mask = int(p["EKF2_AID_MASK"])
        return bool(mask & OLD_FLOW_BIT), bool(mask & OLD_GPS_BIT), HEIGHTS[PX4].get(int(p.get("EKF2_HGT_MODE", 0.0)))
    return None, None, None


def _ardupilot(p: Mapping[str, float]) -> AutopilotSettings:
    sets = tuple(
        SourceSet(
            n, p.get(f"EK3_SRC{n}_VELXY") == FLOW_IN_SET,
            GPS_IN_SET in (p.get(f"EK3_SRC{n}_POSXY"), p.get(f"EK3_SRC{n}_VELXY")),
            HEIGHTS[ARDUPILOT].get(int(p.get(f"EK3_SRC{n}_POSZ", 0.0))), p.get(f"EK3_SRC{n}_YAW", 1.0) in (1.0, 3.0),
            EXTERNAL_IN_SET in (p.get(f"EK3_SRC{n}_POSXY"), p.get(f"EK3_SRC{n}_VELXY"))
            and p.get("VISO_TYPE", 1.0) > 0.0,
        )
        for n in SETS if f"EK3_SRC{n}_VELXY" in p
    )  # fmt: skip
    delay = _times(p.get("EK3_FLOW_DELAY"), 1e-3)
    turn = p.get("FLOW_ORIENT_YAW")
    low, high = (
        _first(p, (f"RNGFND1_{end}", 1.0), (f"RNGFND1_{end}_CM", CENTIMETRE)) for end in ("MIN", "MAX")
    )  # metres since ArduPilot 4.7
    return AutopilotSettings(
        ARDUPILOT, sets,
        flow_delay_s=None if delay is None else delay + EKF3_AVERAGING_S,
        gps_delay_s=_first(p, ("GPS1_DELAY_MS", 1e-3), ("GPS_DELAY_MS", 1e-3)) or None,
        flow_turn_deg=_times(turn, 0.01),
        scale_x=_scaler(p.get("FLOW_FXSCALER")), scale_y=_scaler(p.get("FLOW_FYSCALER")),
        range_low_m=low, range_high_m=high, height_noise_m=p.get("EK3_ALT_M_NSE"),
        flow_fastest_rad_s=p.get("EK3_FLOW_MAX"), flow_noise_rad_s=p.get("EK3_FLOW_M_NSE"),
    )  # fmt: skip


def _times(value: float | None, factor: float) -> float | None:
    return None if value is None else factor * value


def _scaler(per_mille: float | None) -> float | None:
    return None if per_mille is None else 1.0 + 1e-3 * per_mille


def _first(p: Mapping[str, float], *names: tuple[str, float]) -> float | None:
    return next((p[name] * factor for name, factor in names if name in p), None)
