"""What each carried sensor sees of the plant, and what is told of its readings: functions of one lane's records."""

from __future__ import annotations

from collections.abc import Callable
from typing import Any, NamedTuple

import numpy as np

from flownav.control.autopilot import AutopilotState
from flownav.control.go_around import Knowledge
from flownav.core.compile import equation, replacing, write_function
from flownav.core.frames import Rotation, rotation_from_quaternion, to_earth
from flownav.lab.optics.projection import image_rate_rad_s
from flownav.navigation.records import Reading
from flownav.sensors.barometer import BarometerTruth
from flownav.sensors.beam import BeamHit, Ground, ground_height
from flownav.sensors.flow import FlowParameters, FlowState
from flownav.sensors.flow_camera import (
    FlowCameraNormals,
    FlowCameraParameters,
    FlowCameraState,
    FlowCameraTruth,
    FlowCameraUnit,
    pad_texture,
    step_flow_camera,
)
from flownav.sensors.geometry import LensPose
from flownav.sensors.gps_receiver import GpsReceiverTruth
from flownav.sensors.imu import ImuReading
from flownav.sensors.inertial import (
    InertialNormals,
    InertialParameters,
    InertialReading,
    InertialState,
    InertialUnit,
    step_inertial,
)
from flownav.sensors.pad_camera import (
    PadCameraNormals,
    PadCameraParameters,
    PadCameraReading,
    PadCameraUnit,
    read_pad_camera,
    stated_fix,
)
from flownav.sensors.skid_switch import (
    SkidSwitchNormals,
    SkidSwitchParameters,
    SkidSwitchReading,
    SkidSwitchState,
    SkidSwitchUnit,
    step_skid_switch,
)
from flownav.simulation.onboard import (
    EPOCH_S,
    LEAST_HEIGHT_M,
    PAD_SEEN,
    PHYSICS_PERIOD_S,
    SETTLED_S,
    Fitting,
    Onboard,
    Place,
    beam_of,
    earlier,
    place_of,
)
from flownav.simulation.records import Exposed, Landed, Late, Loads, SeesFlow
from flownav.vehicle.state import HelicopterState

with_unseen = replacing(Knowledge, "pad_unseen_s")
with_landed = replacing(SkidSwitchReading, "landed")


@equation
def attitude_of(state: HelicopterState) -> Rotation:
    """R_EB of now."""
    return rotation_from_quaternion(state.qw, state.qx, state.qy, state.qz)


def told(read: Any, values: tuple[str, ...], variances: tuple[str, ...] = ()) -> Callable[..., Reading]:
    """`say(read)`: the reading of these fields of what a sensor read, with the variances that it states of them."""
    said = [f"read.{name}" for name in values] + ["0.0"] * (3 - len(values))
    said += ["nan"] * (6 - len(said)) + [f"read.{name}" for name in variances] + ["nan"] * (3 - len(variances))
    source = f"def say(read):\n    return Reading({', '.join(said)}, read.quality, read.arrived, 0.0)\n"
    say = write_function("say", source, {"Reading": Reading, "nan": np.nan})
    say.__annotations__ = {"read": read, "return": Reading}
    return equation(say)


# -- receiver, barometer, magnetometer, rangefinder ---------------------------------------------------------------
def see_motion(state: HelicopterState, rotation: Rotation, late: Late) -> GpsReceiverTruth:
    """How the vehicle moves, as its GPS receiver feels it; its position as late as its fixes are."""
    late_s = late.late_s
    vel_n, vel_e, vel_d = to_earth(rotation, state.u, state.v, state.w)
    return GpsReceiverTruth(
        state.pos_n - late_s * vel_n, state.pos_e - late_s * vel_e, state.pos_d - late_s * vel_d, vel_n, vel_e, vel_d,
        state.p, state.q, state.r,
    )  # fmt: skip


def see_altitude(state: HelicopterState, ground: Ground, loads: Loads, *, s: Onboard) -> BarometerTruth:
    """Altitude, height of the rotor over the ground, and its thrust."""
    over = s.rotor_above_cg_m - state.pos_d - ground_height(state.pos_n, state.pos_e, ground)
    return BarometerTruth(-state.pos_d, over, loads.thrust_n)


def see_power(loads: Loads) -> float:
    """The power that motor and battery carry [W]."""
    return loads.power_w


def see_beam(state: HelicopterState, late: Late, place: Place, ground: Ground) -> BeamHit:
    """What a lens looks at along body down, as late as its readings are."""
    return beam_of(earlier(state, late.late_s), place, ground)


# -- flow camera --------------------------------------------------------------------------------------------------
class Looked(NamedTuple):
    """A flow reading with the vehicle's own gyro beside it; the exposure begins anew."""

    state: FlowCameraState
    said: Reading
    sees: SeesFlow
    exposed: Exposed


class MeanRates(NamedTuple):
    """How the vehicle turned while the flow camera exposed, and how its own gyro said that it did [rad/s]."""

    p: float
    q: float
    r: float
    gyro_x: float
    gyro_y: float


def mean_rates(exposed: Exposed, fitting: Fitting, *, s: Onboard) -> MeanRates:
    """Means over the exposure, of which every period of the IMU is a share."""
    share = s.inertial_steps * PHYSICS_PERIOD_S / (fitting.clock.every * EPOCH_S)
    return MeanRates(
        share * exposed.rate_p_rad_s,
        share * exposed.rate_q_rad_s,
        share * exposed.rate_r_rad_s,
        share * exposed.gyro_x_rad_s,
        share * exposed.gyro_y_rad_s,
    )


def see_flow(
    state: HelicopterState, flow: FlowState, sensor: FlowParameters, late: Late, ground: Ground, place: Place,
    turned: MeanRates, *, s: Onboard,
) -> FlowCameraTruth:  # fmt: skip
    """What passes under the lens, through the identified dynamics, and the mean rate of the exposure."""
    late_s, rotation = late.late_s, attitude_of(state)
    hit = beam_of(state, place, ground)
    north, east, down = place_of(state, place)
    height_m = -down - ground_height(north, east, ground)
    on_pad = pad_texture(LensPose(north, east, height_m, rotation), s.pad_half_size_m, sensor)
    return FlowCameraTruth(
        sensor.gain * (flow.u1 - late_s * flow.u2), sensor.gain * (flow.v1 - late_s * flow.v2),
        sensor.gain * (flow.w1 - late_s * flow.w2),
        turned.p, turned.q, turned.r, hit.distance_m, height_m, rotation[8],
        1.0 if s.texture_everywhere > 0.5 else on_pad,
    )  # fmt: skip


def look(
    state: FlowCameraState, unit: FlowCameraUnit, truth: FlowCameraTruth, n: FlowCameraNormals, sensor: FlowParameters,
    p: FlowCameraParameters, turned: MeanRates,
) -> Looked:  # fmt: skip
    """Angular flow over the exposure, with the sensor's own gyro and the vehicle's over the same time beside it."""
    after, read = step_flow_camera(state, unit, truth, n, sensor, p)
    said = Reading(
        read.flow_x_rad_s, read.flow_y_rad_s, read.gyro_x_rad_s, read.gyro_y_rad_s, turned.gyro_x, turned.gyro_y,
        np.nan, np.nan, np.nan, read.quality, read.arrived, 0.0,
    )  # fmt: skip
    return Looked(after, said, SeesFlow(1.0 if read.quality > 0.0 else 0.0), Exposed(0.0, 0.0, 0.0, 0.0, 0.0))


# -- pad camera ---------------------------------------------------------------------------------------------------
class OverPad(NamedTuple):
    """A lens, its height that above the pad, and how fast the ground straight below passes [rad/s]."""

    lens: LensPose
    image_rate_rad_s: float


def see_pad(state: HelicopterState, late: Late, place: Place) -> OverPad:
    """The lens where it was when the frame was taken."""
    north, east, down = place_of(earlier(state, late.late_s), place)
    above = -down if -down > LEAST_HEIGHT_M else LEAST_HEIGHT_M
    ahead, aside = image_rate_rad_s(state.u, state.v, state.p, state.q, above)
    lens = LensPose(north, east, -down, attitude_of(state))
    return OverPad(lens, np.sqrt(ahead * ahead + aside * aside))


def look_for_pad(
    unit: PadCameraUnit, over: OverPad, n: PadCameraNormals, p: PadCameraParameters, fitting: Fitting, *, s: Onboard,
    epoch: int,
) -> PadCameraReading:  # fmt: skip
    """A fix of the pad: by the model, or what was seen in this frame where the flight's frames were rendered."""
    rate, known = over.image_rate_rad_s, fitting.p
    fix = read_pad_camera(unit, over.lens, rate, n, p, known)
    seen = (epoch - fitting.clock.first) // fitting.clock.every * PAD_SEEN
    if seen + PAD_SEEN <= len(s.pad_seen):
        shown_m = s.pad_seen[seen + 3]
        fix = stated_fix(
            unit, s.pad_seen[seen], s.pad_seen[seen + 1], s.pad_seen[seen + 2], 1.0 if shown_m > 0.0 else 0.0, shown_m,
            rate, known,
        )  # fmt: skip
    return fix


def note_seen(reading: Reading, known: Knowledge) -> Knowledge:
    """Whether the camera saw the pad in the frame that it has just told of."""
    return with_unseen(known, pad_unseen_s=0.0 if reading.arrived > 0.0 else known.pad_unseen_s)


# -- skid switch --------------------------------------------------------------------------------------------------
class Touched(NamedTuple):
    """The switch for the autopilot, and what the vehicle says of it."""

    state: SkidSwitchState
    landed: Landed
    said: SkidSwitchReading


def see_load(loads: Loads) -> float:
    """What the skids carry [N]."""
    return loads.contact_n


def touch(
    state: SkidSwitchState, unit: SkidSwitchUnit, load_n: float, n: SkidSwitchNormals, p: SkidSwitchParameters,
    autopilot: AutopilotState,
) -> Touched:  # fmt: skip
    """The skid switch, and what the vehicle says of it: on the ground, not about to fly, and settled."""
    after, read = step_skid_switch(state, unit, load_n, n, p)
    landed = 1.0 if at_rest(read.landed, autopilot) else 0.0
    return Touched(after, Landed(read.landed), with_landed(read, landed=landed))


@equation
def at_rest(switch: float, autopilot: AutopilotState) -> bool:
    """The switch is closed, the autopilot does not fly, and after a landing the skids have taken the weight."""
    settled = autopilot.contact_time_s == 0.0 or autopilot.contact_time_s > SETTLED_S
    return switch > 0.5 and autopilot.flying == 0.0 and settled


# -- inertial unit ------------------------------------------------------------------------------------------------
class Moved(NamedTuple):
    """An inertial reading, added to what the flow camera's exposure turned."""

    state: InertialState
    said: InertialReading
    exposed: Exposed


def feel_motion(
    state: InertialState, unit: InertialUnit, truth: ImuReading, n: InertialNormals, p: InertialParameters, e: Exposed
) -> Moved:
    """The inertial reading of the period that ends now."""
    after, read = step_inertial(state, unit, truth, n, p)
    exposed = Exposed(
        e.rate_p_rad_s + truth.gyro_x_rad_s,
        e.rate_q_rad_s + truth.gyro_y_rad_s,
        e.rate_r_rad_s + truth.gyro_z_rad_s,
        e.gyro_x_rad_s + read.gyro_x_rad_s,
        e.gyro_y_rad_s + read.gyro_y_rad_s,
    )
    return Moved(after, read, exposed)
