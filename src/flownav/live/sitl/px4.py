"""PX4's simulator in hardware (SIH) as a quadrotor; the flow sensor that it lacks is ours."""

import time
from contextlib import suppress
from pathlib import Path
from typing import ClassVar

from flownav.core.errors import InputError
from flownav.live.sitl.eyes import EXPOSURE_S, NOISE_RAD_S, FlowSensor, Receiver
from flownav.live.sitl.pilot import MODE, POSITION_AND_YAW, NotFlown, Pilot
from flownav.live.sitl.tables import Eyes, faults_of, parameters_of
from flownav.live.sitl.wire import Wire, free_port

OFFBOARD, AUTO, AUTO_LAND = 6, 4, 6  # main modes, and a sub-mode
STATION_PORT, ONBOARD_PORT = 18570, 14540  # of instance 0, as PX4 ships them (init.d-posix/px4-rc.mavlink)
MOST_SLOT = 9  # beyond, PX4's instances share a port
HOME = (47.397742, 8.545594, 489.4)
MODEL = "sihsim_quadx"
HIL_STATE, LOCAL = 115, 32
TRUTH_HZ, LOCAL_HZ = 100.0, 20.0  # the flow sensor looks at the truth
CLIMB_S = 25.0
LOGGING = {"SDLOG_MODE": 2.0, "SDLOG_PROFILE": 3.0}  # from its start, the ground with it; each reading of each sensor


class Px4(Pilot):
    """A quadrotor of PX4."""

    vehicles: ClassVar = ("quad",)
    log_pattern: ClassVar = "log/**/*.ulg"
    flow_sigma_rad_s: ClassVar = NOISE_RAD_S
    flow_hz: ClassVar = 1.0 / EXPOSURE_S
    target_every: ClassVar = 1  # offboard mode wants it twice a second at least
    target_mask: ClassVar = POSITION_AND_YAW

    def connected(self) -> Wire:
        """PX4's own ports of an instance. InputError where somebody has them."""
        if self.slot > MOST_SLOT:
            raise InputError(f"PX4 runs {MOST_SLOT} instances beside each other; fly fewer at once")
        try:
            return Wire(free_port(), ONBOARD_PORT + self.slot, STATION_PORT + self.slot, seed=self.case.seed)
        except OSError as error:
            raise InputError(
                f"port {ONBOARD_PORT + self.slot} is taken ({error.strerror}); another PX4 may be running: end it"
            ) from error

    def start(self) -> None:
        """The simulator with what a flight on flownav needs."""
        etc = etc_of(self.binary)
        given = parameters_of("px4", self.case.vehicle, self.case.gps)
        given |= LOGGING if self.logs else {}
        environment = {f"PX4_PARAM_{name}": f"{value:g}" for name, value in given.items()}
        for name, value in zip(("LAT", "LON", "ALT"), HOME, strict=True):
            environment[f"PX4_HOME_{name}"] = f"{value}"
        start = ["-d", "-i", str(self.slot), "-w", str(self.folder), "-s", "etc/init.d-posix/rcS", str(etc)]
        self.spawn([str(self.binary), *start], {"PX4_SIM_MODEL": MODEL, **environment})
        self.sensors = FlowSensor(self.wire, self.system, HOME[2], self.case.seed), Receiver(self.wire, self.system)
        if not self.wire.until(lambda: "HEARTBEAT" in self.wire.latest, 40.0):
            raise NotFlown(f"no HEARTBEAT; {self.folder / 'simulator.txt'} has the simulator's words")
        self.streams({HIL_STATE: TRUTH_HZ, LOCAL: LOCAL_HZ})
        if not self.wire.until(lambda: self.wire.history.truth, 10.0):
            raise NotFlown("the simulator does not send the truth (HIL_STATE_QUATERNION)")

    def _mode(self, main: int, sub: int = 0) -> bool:
        for _ in range(3):
            self.command(MODE, 1.0, float(main), float(sub))
            if self.wire.until(lambda: self.wire.latest["HEARTBEAT"].custom_mode >> 16 == main | sub << 8, 2.0):
                return True
        return False

    def take_off(self, height_m: float) -> None:
        """Offboard, to a place above."""
        if not self.wire.until(lambda: self.local_ned_m[0] == self.local_ned_m[0], 60.0):
            raise NotFlown("the autopilot has no position")
        north_m, east_m, down_m = self.local_ned_m
        self.target = north_m, east_m, down_m
        self.wire.pump(1.5)
        end_s = time.monotonic() + 60.0
        while not self._mode(OFFBOARD):
            if time.monotonic() > end_s:
                raise NotFlown("offboard mode is refused")
        self.arm()
        self.target = north_m, east_m, down_m - height_m
        if not self.wire.until(lambda: self.local_ned_m[2] < down_m - height_m + 0.5, CLIMB_S):
            raise NotFlown("it does not climb")
        self.wire.pump(4.0)

    def fly_on_flownav(self) -> None:
        """EKF2 fuses no GPS; the receiver stays on, and flownav receives it."""
        if self.case.gps != "never":
            self.set(EKF2_GPS_CTRL=0)

    def lose_gps(self) -> None:
        """The receiver has no fix any more."""
        self.set(SIM_GPS_USED=0)

    def land_mode(self) -> None:
        """AUTO.LAND."""
        with suppress(NotFlown):
            self._mode(AUTO, AUTO_LAND)

    def afflict(self, fault: str, *, on: bool) -> None:
        """By the simulator's own parameters, or in our sensors."""
        found = faults_of("px4")[fault]
        if found.on:
            self.set(**found.parameters(on=on))
        if found.eyes is not None:
            for sensor in self.sensors:
                sensor.state = found.eyes if on else Eyes()


def etc_of(binary: Path) -> Path:
    """PX4's start-up files beside its program. InputError where they are not at hand."""
    found = binary.resolve().parent.parent / "etc"
    if not (found / "init.d-posix" / "rcS").is_file():
        raise InputError(
            f"{binary}: etc/init.d-posix/rcS is not beside its folder; give build/px4_sitl_default/bin/px4"
        )
    return found
