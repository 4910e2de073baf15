"""ArduPilot's simulator: copter and traditional helicopter."""

import math
import time
from collections.abc import Sequence
from contextlib import suppress
from pathlib import Path
from typing import Any, ClassVar

from flownav.core.errors import InputError
from flownav.live.sitl.pilot import ARM_S, LOCAL_HZ, MODE, SOURCE_SET, TRUTH_HZ, NotFlown, Pilot
from flownav.live.sitl.tables import faults_of, parameters_of
from flownav.live.sitl.wire import HOST, Wire, free_port
from flownav.logs.mavlink.framing import Message

GUIDED, LAND = 4, 9
TAKE_OFF, ORIGIN = 22, 48
HOME = (40.072842, -105.230575, 1586.0)
MODELS = {"heli": ("heli", "copter-heli.parm"), "copter": ("quad", "copter.parm")}
DEFAULTS = Path("Tools/autotest/default_params")
INTERLOCK, THROTTLE, RUN_UP_S = 7, 2, 17.0  # channels from 0; a helicopter's rotor needs so long (H_RSC_RUNUP_TIME)
STICKS = (1500, 1500, 1000, 1500, 1800, 1000, 1000, 1000)
STREAMS_HZ = {108: TRUTH_HZ, 32: LOCAL_HZ, 245: 4.0}
LOGGING = {"LOG_BACKEND_TYPE": 1.0, "LOG_DISARMED": 1.0}  # from its start, the ground before take-off with it
EXTERNAL = 2.0  # source set on flownav
FLOW_NOISE_RAD_S, FLOW_HZ = 0.05, 10.0  # SIM_FLOW_RND, SIM_FLOW_RATE


class ArduPilot(Pilot):
    """A vehicle of ArduPilot."""

    vehicles: ClassVar = ("heli", "copter")
    log_pattern: ClassVar = "logs/*.BIN"
    flow_sigma_rad_s: ClassVar = FLOW_NOISE_RAD_S / math.sqrt(3.0)  # even between +-FLOW_NOISE (AP_OpticalFlow_SITL)
    flow_hz: ClassVar = FLOW_HZ

    def connected(self) -> Wire:
        """A wire on free ports of our own, which are given to the simulator."""
        return Wire(free_port(), seed=self.case.seed)

    def start(self) -> None:
        """The simulator with its make's own defaults and what a flight on flownav needs."""
        case = self.case
        model, defaults = MODELS[case.vehicle]
        self.folder.mkdir(parents=True, exist_ok=True)
        own = self.folder / "flownav.parm"
        given = parameters_of("ardupilot", case.vehicle, case.gps, pad=case.pad)
        given |= {"SIM_WIND_SPD": case.wind_m_s, "SIM_WIND_DIR": case.wind_deg, "SYSID_MYGCS": 255}
        given |= LOGGING if self.logs else {}
        own.write_text("".join(f"{name} {value:g}\n" for name, value in given.items()))
        home = ",".join(f"{value:.7f}" for value in (*HOME, case.heading_deg))
        self.spawn(
            [
                str(self.binary), "-w", "--model", model, "--speedup", "1", f"-I{self.slot}",
                "--sysid", str(self.system), "--home", home,
                "--defaults", f"{defaults_of(self.binary, defaults)},{own}",
                "--serial0", f"udpclient:{HOST}:{self.wire.station_port}",
                "--serial1", f"udpclient:{HOST}:{self.wire.companion_port}", "--serial2", "none",
            ]
        )  # fmt: skip
        if not self.wire.until(lambda: "HEARTBEAT" in self.wire.latest, 40.0):
            raise NotFlown(f"no HEARTBEAT; {self.folder / 'simulator.txt'} has the simulator's words")
        for _ in range(2):
            self.streams(STREAMS_HZ)
        if not self.wire.until(lambda: self.wire.history.truth, 10.0):
            raise NotFlown("the simulator does not send the truth (SIM_STATE)")
        if case.gps == "never":
            self.wire.pump(6.0)
            self._origin()

    def _origin(self) -> None:
        """Send a vehicle without GPS its origin, as a ground station does."""
        latitude, longitude, altitude_m = self.wire.history.truth[-1].state.position_deg_m
        place = round(latitude * 1e7), round(longitude * 1e7), round(altitude_m * 1e3)
        self.wire.say(self.wire.mav.set_gps_global_origin_encode(self.system, *place))

    def _channels(self, interlock: int, throttle: int) -> None:
        """Set the stick channels; the mode switch is never moved, or it would choose a mode."""
        self.channels = [*STICKS[:THROTTLE], throttle, *STICKS[THROTTLE + 1 : INTERLOCK], interlock]

    channels: Sequence[int] = STICKS

    def _beat(self, mav: Any) -> list[Message]:
        return [*super()._beat(mav), mav.rc_channels_override_encode(self.system, 1, *self.channels)]

    def _mode(self, number: int) -> None:
        for _ in range(3):
            self.command(MODE, 1.0, float(number))
            if self.wire.until(lambda: self.wire.latest["HEARTBEAT"].custom_mode == number, 3.0):
                return
        raise NotFlown(f"mode {number} is refused")

    def take_off(self, height_m: float) -> None:
        """Guided; a helicopter's rotor is run up first."""
        end_s = time.monotonic() + ARM_S
        while True:  # refused as long as its position is not known
            try:
                self._mode(GUIDED)
                break
            except NotFlown:
                if time.monotonic() > end_s:
                    reasons = [what for _, who, what in self.wire.history.words if who == "autopilot"][-3:]
                    raise NotFlown("guided mode is refused: " + "; ".join(dict.fromkeys(reasons))) from None
        heli = self.case.vehicle == "heli"
        self._channels(1000, 1000)
        self.arm()
        self._channels(2000 if heli else 1000, 1500)
        if heli:
            self.wire.pump(RUN_UP_S)
        if self.command(TAKE_OFF, *(0.0,) * 6, height_m) != 0:
            raise NotFlown("the take-off is refused")
        if not self.wire.until(lambda: self.local_ned_m[2] < 0.5 - height_m, 45.0):
            raise NotFlown("it does not climb")
        self.wire.pump(4.0)

    def fly_on_flownav(self) -> None:
        """Set the second set of sources again: at its first start an ArduPilot that has a flow sensor writes optical
        flow into it (`NavEKF3::convert_parameters`), whatever its defaults say.
        """
        if self.case.gps == "never":
            return
        given = parameters_of("ardupilot", self.case.vehicle, self.case.gps)
        self.set(**{name: value for name, value in given.items() if name.startswith("EK3_SRC2_")})
        if self.command(SOURCE_SET, EXTERNAL) != 0:
            raise NotFlown("the source set of flownav is refused")

    def lose_gps(self) -> None:
        """The receiver falls silent."""
        self.set(SIM_GPS_DISABLE=1)

    def land_mode(self) -> None:
        """LAND."""
        with suppress(NotFlown):
            self._mode(LAND)

    def afflict(self, fault: str, *, on: bool) -> None:
        """By the simulator's own parameters."""
        self.set(**faults_of("ardupilot")[fault].parameters(on=on))


def defaults_of(binary: Path, name: str) -> Path:
    """The parameters that the make's own scripts start a model with. InputError where the source is not at hand."""
    for parent in binary.resolve().parents:
        if (found := parent / DEFAULTS / name).is_file():
            return found
    raise InputError(
        f"{binary}: {DEFAULTS / name} is not beside it; give the program in its source tree (build/sitl/bin)"
    )
