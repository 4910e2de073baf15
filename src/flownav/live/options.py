"""The options of a live session, and the limits within which it sends."""

from dataclasses import dataclass
from typing import Literal, get_args

from flownav.live.reception import BESIDE, Accepted
from flownav.navigation.kernel_settings import NO_STATED_NOISE, FlowNoise
from flownav.navigation.settings import NavigatorSettingsFile
from flownav.sensors.datasheet import IdentifiedFlow

Sending = Literal["odometry", "vision", "landing-target", "none"]
SENDINGS = get_args(Sending)


@dataclass(frozen=True)
class Limits:
    """Beyond any of these no estimate is sent.

    age_s: of the newest reading of the vehicle. dead_reckoning_s: of the newest horizontal aid that was fused, the
    horizon's wait included; a vehicle that uses the estimate follows its errors, so this is short. sigma_m,
    sigma_m_s: one standard deviation of horizontal position and velocity. protection_m: how far off the position may
    be although no fault is noticed, the horizontal protection level. sigma_down_m: one of the height. unfused_s: for
    how long readings of a horizontal sensor may arrive without being fused.
    """

    age_s: float = 0.3
    dead_reckoning_s: float = 1.5
    sigma_m: float = 5.0
    sigma_m_s: float = 1.5
    protection_m: float = 20.0
    sigma_down_m: float = 10.0
    unfused_s: float = 5.0


@dataclass(frozen=True)
class Options:
    """The options of a session.

    accept: which senders other than the autopilot may send which message. key: a MAVLink signing key. identified: a
    flow sensor's latency and axes; its gains are the settings'. margin_s: the time that the horizon waits beyond the
    largest delay that is stated: an IMU period and jitter. most_horizon_s: the longest that it waits for any stream.
    listen_s: how long the vehicle is listened to before it is decided which sensors serve. restart_s: a longer silence
    of the vehicle, or its reboot, begins the navigation anew. capacity_bytes_s: the link's capacity each way; None:
    more than is asked for.
    """

    send: Sending = "odometry"
    system: int | None = None
    component: int | None = None
    accept: tuple[Accepted, ...] = BESIDE
    key: bytes | None = None
    gps_delay_s: float = 0.22
    identified: IdentifiedFlow | None = None
    settings: NavigatorSettingsFile = NavigatorSettingsFile()  # noqa: RUF009  (frozen)
    flow_noise: FlowNoise = NO_STATED_NOISE
    limits: Limits = Limits()
    margin_s: float = 0.05
    most_horizon_s: float = 1.0
    listen_s: float = 2.0
    restart_s: float = 10.0
    capacity_bytes_s: float | None = None

    @property
    def least_horizon_s(self) -> float:
        """How old an instant is at least when it is fused, by the delays that are stated."""
        latency_s = self.identified.latency_s if self.identified else 0.0
        return max(self.gps_delay_s, latency_s, 0.1) + self.margin_s
