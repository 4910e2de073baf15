"""Decides whether the current estimate may be sent: alarms of unused sensors, limits, and contradictions."""

from flownav.core.frames import Vector
from flownav.core.measurement import Sensor
from flownav.estimation.gating import Reason
from flownav.live.anchor import PLACES, Anchor
from flownav.live.answers import UNFUSED, estimate_of, fault_of, tilt_cosine, why_withheld
from flownav.live.filtering import Filtering, Keeper
from flownav.live.hearing import GPS, Hearing
from flownav.live.horizon import Refused
from flownav.live.inertial import Heights
from flownav.live.options import Limits
from flownav.live.vehicle_clock import VehicleClock
from flownav.logs.mavlink.outgoing import Estimate
from flownav.navigation.loop import Running
from flownav.navigation.reasons import HORIZONTAL

RECENT_S = 1.0  # an older range or landed state does not determine where a navigator begins: chosen
HEIGHT_DOUBTED = "height_doubted"
# Reasons that an unused sensor may cause.
OUTRANKED = ("", "position_invalid", "dead_reckoning", "flow_doubted", "unprotected")
NAN = float("nan")


class Offering:
    """Judges the estimate before it is sent.

    alarms: sensors that are received and not fused, since when and why; past_alarms: the longest of each sensor;
    settled: an estimate was there to be sent, so that the vehicle is the vehicle.
    """

    def __init__(self, limits: Limits, keeper: Keeper, hearing: Hearing, filtering: Filtering) -> None:
        self.limits, self.keeper, self.hearing, self.filtering = limits, keeper, hearing, filtering
        self.anchor, self.heights = Anchor(), Heights()
        self.alarms: dict[Sensor, Refused] = {}
        self.past_alarms: dict[Sensor, Refused] = {}
        self.settled = False
        self._begun: Running | None = None  # the navigator whose beginning has been judged
        self._raised_m = 0.0

    @property
    def offset_ned_m(self) -> Vector:
        """The navigator's origin in the frame that is sent [m].

        One that begins in flight without GPS begins at 0, and its height above the ground is the range: the sent
        position is relative to the ground below, until an origin and a fix arrive.
        """
        north_m, east_m, down_m = self.hearing.origin.offset_ned_m
        unknown = not (north_m or east_m or down_m)
        return north_m, east_m, down_m - self._raised_m if unknown else down_m

    def _raise(self, t_s: float) -> None:
        """Judge a navigator once, as soon as it has started."""
        on, here_ned_m = self.filtering.running, self.filtering.here_ned_m
        if on is None or here_ned_m is None or on is self._begun:
            return
        self._begun, self._raised_m = on, 0.0
        above, landed = (self.hearing.latest.get(sensor) for sensor in (Sensor.RANGE, Sensor.LANDED))
        if not self.filtering.lacks_gps or above is None or landed is None or landed.value[0]:
            return
        if min(above.t_s, landed.t_s) >= t_s - RECENT_S:
            self._raised_m = max(above.value[0] * tilt_cosine(on.work) + here_ned_m[2], 0.0)
            self.keeper.note(
                t_s, "live", "begun_in_flight", "the height is the range's, above the ground", self._raised_m
            )

    def begin_anew(self) -> None:
        """The vehicle may be elsewhere now."""
        self.anchor.begin_anew()
        self.heights.clear()
        self.alarms = {}

    def watch(self, t_s: float) -> None:
        """Alarms that begin and end go into the record."""
        self._raise(t_s)
        if self.filtering.running is not None:
            self.anchor.watch(self.filtering.running, t_s)
        found = self.hearing.serving.alarms(t_s, self.limits.unfused_s)
        for sensor in found.keys() - self.alarms.keys():
            spell = found[sensor]
            self.keeper.note(t_s, sensor.name.lower(), "unfused", spell.why, t_s - spell.since_s)
        for sensor in self.alarms.keys() - found.keys():
            self.keeper.note(t_s, sensor.name.lower(), "fused_again", "", NAN)
        for sensor, spell in found.items():
            before = self.past_alarms.get(sensor)
            if before is None or spell.until_s - spell.since_s >= before.until_s - before.since_s:
                self.past_alarms[sensor] = spell
        self.alarms = found

    def _spoils(self, sensor: Sensor, t_s: float) -> bool:
        """Whether a sensor that does not serve keeps the estimate from being sent: any that gives the position,
        except a GPS that is refused while the flow, which nobody doubts, agrees with the inertial sensors.
        """
        refused = self.alarms[sensor].why == Reason.INNOVATION_GATE.label
        return sensor in HORIZONTAL and not (sensor in GPS and refused and self.anchor.agrees(t_s))

    def judged(self, t_s: float, clock: VehicleClock, resets: int) -> tuple[str, Estimate | None]:
        """Why the estimate of now may not be sent, "" where it may, and the estimate; None where its velocity may not
        be sent either."""
        on, limits = self.filtering.running, self.limits
        base = self.anchor.base
        reason = why_withheld(on, t_s, self.hearing.newest_s, limits, base)
        if reason in OUTRANKED and any(self._spoils(sensor, t_s) for sensor in self.alarms):
            reason = UNFUSED
        if not reason and on is not None and on.told.equipment.use_imu:
            reason = "" if t_s - self.filtering.newest_imu_s <= limits.age_s else "stale"
        if on is not None and self.heights.doubted(on.clock_s) and reason in ("", *PLACES):
            reason = HEIGHT_DOUBTED
        if not reason and not self.settled and self.hearing.origin.doubted is not None:
            reason = "origin_doubted"
        if on is None or (reason and reason not in PLACES):
            return reason, None
        now, boot_s = self.filtering.now(t_s), clock.boot_s(t_s)
        estimate = estimate_of(on, now, t_s, boot_s, resets, self.offset_ned_m, limits, base)
        fault = fault_of(estimate, limits, base)
        if fault and (not reason or fault not in PLACES):
            reason = fault
        return reason, estimate if not reason or reason in PLACES else None

    def say_origin(self, event: str, t_s: float) -> None:
        """Record what happened to the autopilot's origin."""
        origin = self.hearing.origin
        if event == "moved":
            offset_m = sum(value**2 for value in origin.offset_ned_m) ** 0.5
            self.keeper.note(t_s, "origin", "moved", "the autopilot set its origin; what is sent is about it", offset_m)
        elif event == "refused":
            self.hearing.counts["origin: refused"] += 1
            self.keeper.note(t_s, "origin", "refused", "the vehicle is not where this origin would have it")
