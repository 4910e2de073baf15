"""Decides whether the current estimate may be sent: alarms of unused sensors, limits, and contradictions."""

from flownav.core.frames import Vector
from flownav.core.measurement import Sensor
from flownav.estimation.gating import Reason
from flownav.live.anchor import PLACES, Anchor
from flownav.live.answers import UNFUSED, estimate_of, fault_of, why_withheld
from flownav.live.beginning import ANEW, Beginning
from flownav.live.filtering import Filtering, Keeper
from flownav.live.horizon import Refused
from flownav.live.inertial import Heights
from flownav.live.intake import GPS, Intake
from flownav.live.options import Limits
from flownav.live.origin import Geodetic
from flownav.live.vehicle_clock import VehicleClock
from flownav.logs.mavlink.outgoing import Estimate
from flownav.navigation.reasons import HORIZONTAL

HEIGHT_DOUBTED, BEGINS_IN_FLIGHT = "height_doubted", "begins_in_flight"
# Reasons that an unused sensor may cause.
OUTRANKED = ("", "position_invalid", "dead_reckoning", "flow_doubted", "unprotected")
NAN = float("nan")


class Offering:
    """Judges the estimate before it is sent.

    alarms: sensors that are received and not fused, since when and why; past_alarms: the longest of each sensor;
    settled: an estimate was there to be sent, so that the vehicle is the vehicle.
    """

    def __init__(self, limits: Limits, keeper: Keeper, intake: Intake, filtering: Filtering) -> None:
        self.limits, self.keeper, self.intake, self.filtering = limits, keeper, intake, filtering
        self.anchor, self.heights = Anchor(), Heights()
        self.alarms: dict[Sensor, Refused] = {}
        self.past_alarms: dict[Sensor, Refused] = {}
        self.settled = False
        self.beginning = Beginning(filtering)
        self._doubted: Geodetic | None = None  # the origin that the autopilot was asked about
        self._opened = False

    @property
    def offset_ned_m(self) -> Vector:
        """The navigator's origin in the frame that is sent [m].

        One that begins in flight without GPS begins at 0, and its height above the ground is the range: the sent
        position is relative to the ground below, until an origin and a fix arrive.
        """
        north_m, east_m, down_m = self.intake.origin.offset_ned_m
        unknown = not (north_m or east_m or down_m)
        return north_m, east_m, down_m - self.beginning.raised_m if unknown else down_m

    def _begin(self, t_s: float) -> None:
        """How high a navigator is that has just started goes into the record."""
        above, landed = (self.intake.latest.get(sensor) for sensor in (Sensor.RANGE, Sensor.LANDED))
        by = self.beginning.watch(above, landed, t_s)
        if by == ANEW:
            self.keeper.note(t_s, "live", "restart", "range and autopilot agree on the height now", NAN)
        elif by:
            detail = f"the height above the ground is by {by}"
            self.keeper.note(t_s, "live", "begun_in_flight", detail, self.beginning.raised_m)

    def asks_where(self, t_s: float) -> bool:
        """Whether the autopilot is to be asked for its own position from now on: it decides about an origin, or about
        the height of a navigator that begins in flight."""
        doubted, opened = self.intake.origin.doubted, self.beginning.is_open
        asks = doubted not in (None, self._doubted) or (opened and not self._opened)
        if doubted not in (None, self._doubted):
            detail = "it is far off; the autopilot is asked where it is in it"
            self.keeper.note(t_s, "origin", "doubted", detail, NAN)
        self._doubted, self._opened = doubted, opened
        return asks

    def begin_anew(self) -> None:
        """The vehicle may be elsewhere now."""
        self.anchor.begin_anew()
        self.heights.clear()
        self.alarms = {}

    def watch(self, t_s: float) -> None:
        """Alarms that begin and end go into the record."""
        self._begin(t_s)
        if self.filtering.running is not None:
            self.anchor.watch(self.filtering.running, t_s)
        found = self.intake.serving.alarms(t_s, self.limits.unfused_s)
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
        but a GPS that is refused while the flow, which nobody doubts, agrees with the inertial sensors."""
        refused = self.alarms[sensor].why == Reason.INNOVATION_GATE.label
        return sensor in HORIZONTAL and not (sensor in GPS and refused and self.anchor.agrees(t_s))

    def judged(self, t_s: float, clock: VehicleClock, resets: int) -> tuple[str, Estimate | None]:
        """Why the estimate of now may not be sent, "" where it may, and the estimate; None where its velocity may not
        be sent either."""
        on, limits = self.filtering.running, self.limits
        base = self.anchor.base
        reason = why_withheld(on, t_s, self.intake.newest_s, limits, base)
        if reason in OUTRANKED and any(self._spoils(sensor, t_s) for sensor in self.alarms):
            reason = UNFUSED
        if not reason and on is not None and on.given.equipment.use_imu:
            reason = "" if t_s - self.filtering.newest_imu_s <= limits.age_s else "stale"
        if on is not None and self.heights.doubted(on.clock_s) and reason in ("", *PLACES):
            reason = HEIGHT_DOUBTED
        if self.beginning.is_open and reason in ("", *PLACES):
            reason = BEGINS_IN_FLIGHT
        if not reason and not self.settled and self.intake.origin.doubted is not None:
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
        origin = self.intake.origin
        if event == "moved":
            offset_m = sum(value**2 for value in origin.offset_ned_m) ** 0.5
            self.keeper.note(t_s, "origin", "moved", "the autopilot set its origin; what is sent is about it", offset_m)
        elif event == "refused":
            self.intake.counts["origin: refused"] += 1
            self.keeper.note(t_s, "origin", "refused", "the vehicle is not where this origin would have it")
