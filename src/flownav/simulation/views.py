"""Inputs of each carried sensor from the plant, and the uses of its readings: functions of one lane's records."""

from collections.abc import Callable
from typing import Any, NamedTuple

import numpy as np

from flownav.control.autopilot import AutopilotState
from flownav.control.guidance import Knowledge
from flownav.core.compile import equation, replacing, write_function
from flownav.core.frames import Rotation, rotation_from_quaternion, to_earth
from flownav.navigation.records import Reading
from flownav.sensors import flow_camera, inertial, pad_camera, skid_switch
from flownav.sensors.barometer import BarometerTruth
from flownav.sensors.flow import FlowParameters, FlowState
from flownav.sensors.geometry import BeamHit, Ground, LensPose, ground_height, image_rate_rad_s
from flownav.sensors.gps_receiver import GpsReceiverTruth
from flownav.simulation import onboard
from flownav.simulation.records import Exposed, Landed, Late, Loads, SeesFlow
from flownav.vehicle.state import HelicopterState

with_unseen = replacing(Knowledge, "pad_unseen_s")
with_landed = replacing(skid_switch.SkidSwitchReading, "landed")


@equation
def attitude_of(state: HelicopterState) -> Rotation:
    """R_EB of now."""
    return rotation_from_quaternion(state.qw, state.qx, state.qy, state.qz)


def reads(read: Any, values: tuple[str, ...], variances: tuple[str, ...] = ()) -> Callable[..., Reading]:
    """`say(read)`: the reading of these fields of what a sensor read, with the variances that it states of them."""
    parts = [f"read.{name}" for name in values] + ["0.0"] * (3 - len(values))
    parts += ["nan"] * (6 - len(parts)) + [f"read.{name}" for name in variances] + ["nan"] * (3 - len(variances))
    source = f"def say(read):\n    return Reading({', '.join(parts)}, read.quality, read.arrived, 0.0)\n"
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


def see_altitude(state: HelicopterState, ground: Ground, loads: Loads, *, s: onboard.Onboard) -> BarometerTruth:
    """Altitude, height of the rotor over the ground, and its thrust."""
    over = s.rotor_above_cg_m - state.pos_d - ground_height(state.pos_n, state.pos_e, ground)
    return BarometerTruth(-state.pos_d, over, loads.thrust_n)


def see_power(loads: Loads) -> float:
    """The power that motor and battery carry [W]."""
    return loads.power_w


def see_beam(state: HelicopterState, late: Late, place: onboard.Place, ground: Ground) -> BeamHit:
    """The point on the ground along body down from a lens, as late as its readings are."""
    return onboard.beam_of(onboard.earlier(state, late.late_s), place, ground)


# -- flow camera --------------------------------------------------------------------------------------------------
class Looked(NamedTuple):
    """A flow reading with the vehicle's own gyro beside it; the exposure begins anew."""

    state: flow_camera.FlowCameraState
    reading: Reading
    sees: SeesFlow
    exposed: Exposed


class MeanRates(NamedTuple):
    """How the vehicle turned while the flow camera exposed, and the turning by its own gyro [rad/s]."""

    p: float
    q: float
    r: float
    gyro_x: float
    gyro_y: float


def mean_rates(exposed: Exposed, fitting: onboard.Fitting, *, s: onboard.Onboard) -> MeanRates:
    """Means over the exposure, of which every period of the IMU is a share."""
    share = s.inertial_steps * onboard.PHYSICS_PERIOD_S / (fitting.clock.every * onboard.EPOCH_S)
    return MeanRates(
        share * exposed.rate_p_rad_s,
        share * exposed.rate_q_rad_s,
        share * exposed.rate_r_rad_s,
        share * exposed.gyro_x_rad_s,
        share * exposed.gyro_y_rad_s,
    )


def see_flow(
    state: HelicopterState, flow: FlowState, sensor: FlowParameters, late: Late, ground: Ground, place: onboard.Place,
    turned: MeanRates, *, s: onboard.Onboard,
) -> flow_camera.FlowCameraTruth:  # fmt: skip
    """Motion of the ground under the lens, through the identified dynamics, and the mean rate of the exposure."""
    late_s, rotation = late.late_s, attitude_of(state)
    hit = onboard.beam_of(state, place, ground)
    north, east, down = onboard.place_of(state, place)
    height_m = -down - ground_height(north, east, ground)
    on_pad = flow_camera.pad_texture(LensPose(north, east, height_m, rotation), s.pad_half_size_m, sensor)
    return flow_camera.FlowCameraTruth(
        sensor.gain * (flow.u1 - late_s * flow.u2), sensor.gain * (flow.v1 - late_s * flow.v2),
        sensor.gain * (flow.w1 - late_s * flow.w2),
        turned.p, turned.q, turned.r, hit.distance_m, height_m, rotation[8],
        1.0 if s.texture_everywhere > 0.5 else on_pad,
    )  # fmt: skip


def look(
    state: flow_camera.FlowCameraState, unit: flow_camera.FlowCameraUnit, truth: flow_camera.FlowCameraTruth,
    n: flow_camera.FlowCameraNormals, sensor: FlowParameters, p: flow_camera.FlowCameraParameters, turned: MeanRates,
) -> Looked:  # fmt: skip
    """Angular flow over the exposure, with the sensor's own gyro and the vehicle's over the same time beside it."""
    after, read = flow_camera.step_flow_camera(state, unit, truth, n, sensor, p)
    reading = Reading(
        read.flow_x_rad_s, read.flow_y_rad_s, read.gyro_x_rad_s, read.gyro_y_rad_s, turned.gyro_x, turned.gyro_y,
        np.nan, np.nan, np.nan, read.quality, read.arrived, 0.0,
    )  # fmt: skip
    return Looked(after, reading, SeesFlow(1.0 if read.quality > 0.0 else 0.0), Exposed(0.0, 0.0, 0.0, 0.0, 0.0))


# -- pad camera ---------------------------------------------------------------------------------------------------
class OverPad(NamedTuple):
    """A lens, its height that above the pad, and how fast the ground straight below passes [rad/s]."""

    lens: LensPose
    image_rate_rad_s: float


def see_pad(state: HelicopterState, late: Late, place: onboard.Place) -> OverPad:
    """The lens where it was when the frame was taken."""
    north, east, down = onboard.place_of(onboard.earlier(state, late.late_s), place)
    above = -down if -down > onboard.LEAST_HEIGHT_M else onboard.LEAST_HEIGHT_M
    ahead, aside = image_rate_rad_s(state.u, state.v, state.p, state.q, above)
    lens = LensPose(north, east, -down, attitude_of(state))
    return OverPad(lens, np.sqrt(ahead * ahead + aside * aside))


def look_for_pad(
    unit: pad_camera.PadCameraUnit, over: OverPad, n: pad_camera.PadCameraNormals, p: pad_camera.PadCameraParameters,
    fitting: onboard.Fitting, *, s: onboard.Onboard, epoch: int,
) -> pad_camera.PadCameraReading:  # fmt: skip
    """A fix of the pad: by the model, or what was seen in this frame where the flight's frames were rendered."""
    rate, known = over.image_rate_rad_s, fitting.p
    fix = pad_camera.read_pad_camera(unit, over.lens, rate, n, p, known)
    seen = (epoch - fitting.clock.first) // fitting.clock.every * onboard.PAD_SEEN
    if seen + onboard.PAD_SEEN <= len(s.pad_seen):
        shown_m = s.pad_seen[seen + 3]
        fix = pad_camera.stated_fix(
            unit, s.pad_seen[seen], s.pad_seen[seen + 1], s.pad_seen[seen + 2], 1.0 if shown_m > 0.0 else 0.0, shown_m,
            rate, known,
        )  # fmt: skip
    return fix


def note_seen(reading: Reading, known: Knowledge) -> Knowledge:
    """Whether the camera saw the pad in the frame that has just arrived."""
    return with_unseen(known, pad_unseen_s=0.0 if reading.arrived > 0.0 else known.pad_unseen_s)


# -- skid switch --------------------------------------------------------------------------------------------------
class Touched(NamedTuple):
    """The switch for the autopilot, and the vehicle's report of it."""

    state: skid_switch.SkidSwitchState
    landed: Landed
    reading: skid_switch.SkidSwitchReading


def see_load(loads: Loads) -> float:
    """Load on the skids [N]."""
    return loads.contact_n


def touch(
    state: skid_switch.SkidSwitchState, unit: skid_switch.SkidSwitchUnit, load_n: float,
    n: skid_switch.SkidSwitchNormals, p: skid_switch.SkidSwitchParameters, autopilot: AutopilotState,
) -> Touched:  # fmt: skip
    """The skid switch, and the vehicle's report of it: on the ground, not about to fly, and settled."""
    after, read = skid_switch.step_skid_switch(state, unit, load_n, n, p)
    landed = 1.0 if at_rest(read.landed, autopilot) else 0.0
    return Touched(after, Landed(read.landed), with_landed(read, landed=landed))


@equation
def at_rest(switch: float, autopilot: AutopilotState) -> bool:
    """The switch is closed, the autopilot does not fly, and after a landing the skids have taken the weight."""
    settled = autopilot.contact_time_s == 0.0 or autopilot.contact_time_s > onboard.SETTLED_S
    return switch > 0.5 and autopilot.flying == 0.0 and settled


# -- inertial unit ------------------------------------------------------------------------------------------------
class Moved(NamedTuple):
    """An inertial reading, added to what the flow camera's exposure turned."""

    state: inertial.InertialState
    reading: inertial.InertialReading
    exposed: Exposed


def feel_motion(
    state: inertial.InertialState,
    unit: inertial.InertialUnit,
    truth: inertial.ImuReading,
    n: inertial.InertialNormals,
    p: inertial.InertialParameters,
    e: Exposed,
) -> Moved:
    """The inertial reading of the period that ends now."""
    after, read = inertial.step_inertial(state, unit, truth, n, p)
    exposed = Exposed(
        e.rate_p_rad_s + truth.gyro_x_rad_s,
        e.rate_q_rad_s + truth.gyro_y_rad_s,
        e.rate_r_rad_s + truth.gyro_z_rad_s,
        e.gyro_x_rad_s + read.gyro_x_rad_s,
        e.gyro_y_rad_s + read.gyro_y_rad_s,
    )
    return Moved(after, read, exposed)
