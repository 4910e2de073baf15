"""The autopilot: cascaded PID loops from position to blade angles, with anti-windup.

Position error commands a velocity, velocity error an acceleration (a tilt and a collective), tilt error a
cyclic; heading is held with the tail rotor. Every integrator stops while its output is at a limit (conditional
integration) and while the skids carry the weight. The outer loop runs on the filter's estimate (or on the
truth), the inner loop on the INS attitude and the flybarless unit's gyros.
"""

from typing import NamedTuple

from flownav.control import guidance
from flownav.control.gains import AutopilotGains
from flownav.control.guidance import Reference
from flownav.control.heading import Facing, faced, heading_error
from flownav.core.compile import clamp, equation, magnitude, replacing, smaller
from flownav.core.frames import GRAVITY_M_S2, Rotation, heading_cosine_sine, to_earth


class AutopilotState(NamedTuple):
    """Integrators (in the unit of what they add to), the outer loop's held commands and the mode."""

    accel_forward: float  # [m/s2]
    accel_right: float  # [m/s2]
    gust_forward: float  # acceleration that the tilt does not explain [m/s2]
    gust_right: float  # [m/s2]
    collective: float  # [rad]
    lon: float  # [rad]
    lat: float  # [rad]
    pedal: float  # [rad]
    pitch_sine: float  # commanded sine of pitch
    roll_sine: float  # commanded sine of roll
    collective_command: float  # [rad]
    flying: float  # 1.0 in flight, 0.0 on the skids
    contact_time_s: float  # how long the skids have carried weight
    waited_s: float  # at the gate of the last metre; aloft
    searched_s: float  # for the pad
    away: float  # 1.0 while it goes around
    go_arounds: float
    since_s: float  # for how long it is in doubt, or, aloft, all is well
    learns: float  # 1.0 while it learns its vehicle: a landing with a camera waits for it
    heading_north: float  # of the heading that is held, and what turns it (heading.py)
    heading_east: float
    turn_rad_s: float
    push_forward: float
    push_right: float


with_learning = replacing(AutopilotState, "learns")
with_contact = replacing(AutopilotState, "flying", "contact_time_s")
with_outer_loop = replacing(
    AutopilotState,
    "accel_forward", "accel_right", "gust_forward", "gust_right", "collective",
    "pitch_sine", "roll_sine", "collective_command", "waited_s", "searched_s", "away", "go_arounds", "since_s",
)  # fmt: skip
with_facing = replacing(AutopilotState, *Facing._fields)
with_inner_loop = replacing(AutopilotState, "lon", "lat", "pedal")


class Estimate(NamedTuple):
    """Feedback of the outer loop: position NED [m], velocity and measured specific force body FRD [m/s, m/s2]."""

    pos_n: float
    pos_e: float
    pos_d: float
    u: float
    v: float
    w: float
    force_x: float
    force_y: float
    force_z: float


@equation
def at_rest(gains: AutopilotGains, collective_command: float, flying: float) -> AutopilotState:
    """The state at rest: nothing integrated yet, the tilt of trimmed hover."""
    return AutopilotState(
        0.0, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0,
        gains.pitch_trim_sine, gains.roll_trim_sine, collective_command, flying, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0,
        1.0, 0.0, 0.0, 0.0, 0.0,
    )  # fmt: skip


@equation
def grounded(gains: AutopilotGains) -> AutopilotState:
    """The state of an autopilot on the ground at idle."""
    return at_rest(gains, gains.idle_collective_rad, 0.0)


@equation
def hovering(gains: AutopilotGains) -> AutopilotState:
    """The state of an autopilot in trimmed hover."""
    return at_rest(gains, gains.collective_trim_rad, 1.0)


@equation
def integrate(integral: float, error: float, gain: float, dt: float, output: float, limit: float) -> float:
    """One step of an integrator that stops where its loop's output is at the limit and would go further."""
    further = magnitude(output) >= limit and output * error * gain > 0.0
    return integral if further else integral + gain * error * dt


@equation
def landing_logic(
    state: AutopilotState,
    contact_force_n: float,
    contact_threshold_n: float,
    may_fly: float,
    may_land: float,
    dt: float,
) -> AutopilotState:
    """On the skids until commanded to fly; in flight until the skids have carried weight for 0.1 s after `may_land`."""
    touching = contact_force_n > contact_threshold_n
    contact_time = state.contact_time_s + dt if (touching and may_land > 0.0) else 0.0
    landed = contact_time > 0.1
    grounded_for_good = may_land > 0.0 and state.flying == 0.0
    flying = 0.0 if (landed or grounded_for_good) else may_fly
    return with_contact(state, flying=flying, contact_time_s=contact_time)


HELD_UP_SHARE = 0.5  # chosen: of the landing's speed; gusts leave a fifth


@equation
def held_up(slower_m_s: float, height_m: float, gains: AutopilotGains) -> bool:
    """Below the gate the ground, not the rotors, stops the descent: it sinks slower than commanded by slower_m_s.

    A switch under the skids closes later, when they carry a good part of the weight.
    """
    return height_m < gains.commit_height_m and slower_m_s > HELD_UP_SHARE * gains.land_speed_m_s


@equation
def along_heading(rotation: Rotation, n: float, e: float) -> tuple[float, float]:
    """A horizontal vector, forward along the heading and to its right."""
    cos_heading, sin_heading = heading_cosine_sine(rotation)
    return cos_heading * n + sin_heading * e, cos_heading * e - sin_heading * n


@equation
def unexplained_acceleration(estimate: Estimate, rotation: Rotation, gains: AutopilotGains) -> tuple[float, float]:
    """Specific force forward and to the right [m/s2], less the part due to the tilt against trim.

    A gust's push and a wind's drag: felt at once, where the velocity shows them only later.
    """
    force_n, force_e, _ = to_earth(rotation, estimate.force_x, estimate.force_y, estimate.force_z)
    forward, right = along_heading(rotation, force_n, force_e)
    pitch, roll = -rotation[6] - gains.pitch_trim_sine, rotation[7] - gains.roll_trim_sine
    return forward + GRAVITY_M_S2 * pitch, right - GRAVITY_M_S2 * roll


class Steered(NamedTuple):
    """Velocity still to be gained, forward along the heading, to its right and down [m/s]; whether the pad is looked
    for; since when the vehicle waits at the gate or aloft [s]; what becomes of the landing; whether it touches.
    """

    forward: float
    right: float
    down: float
    looking: bool
    waited_s: float
    around: guidance.GoAround
    touching: bool


@equation
def steer(
    state: AutopilotState, reference: Reference, estimate: Estimate, known: guidance.Knowledge, rotation: Rotation,
    gains: AutopilotGains, may_land: float, dt: float,
) -> Steered:  # fmt: skip
    """Position errors to velocities, through the gate before the touchdown and the way round."""
    skids_n, skids_e = guidance.skids_beside(rotation, gains)
    off_n, off_e = reference.pos_n - estimate.pos_n - skids_n, reference.pos_e - estimate.pos_e - skids_e
    height_m = gains.pad_pos_d_m - estimate.pos_d
    looking = guidance.seeks(known, state.away, height_m, gains)
    search_n, search_e = guidance.search_offset(state.searched_s, gains)
    off_n, off_e = off_n + (search_n if looking else 0.0), off_e + (search_e if looking else 0.0)
    vel_n, vel_e = gains.position_gain * off_n, gains.position_gain * off_e
    speed_limit = gains.horizontal_speed_limit_m_s
    vel_n = reference.vel_n + clamp(vel_n, -speed_limit, speed_limit)
    vel_e = reference.vel_e + clamp(vel_e, -speed_limit, speed_limit)
    climb_limit = gains.climb_limit_m_s
    vel_d = reference.vel_d + clamp(gains.height_gain * (reference.pos_d - estimate.pos_d), -climb_limit, climb_limit)

    est_n, est_e, est_d = to_earth(rotation, estimate.u, estimate.v, estimate.w)
    landing = state.flying > 0.0 and may_land > 0.0 and state.contact_time_s == 0.0
    off_m2, speed_m2_s2 = off_n * off_n + off_e * off_e, est_n * est_n + est_e * est_e
    now = guidance.Approach(off_m2, speed_m2_s2, height_m, state.waited_s, state.searched_s, landing)
    around = guidance.mind_landing(
        guidance.GoAround(state.away, state.go_arounds, state.since_s), known, now, gains, dt
    )
    away = around.away > 0.0
    known_place = known.pad_found > 0.0 or gains.search_height_m == 0.0
    waiting = known_place and guidance.misaligned(off_n, off_e, est_n, est_e, height_m, state.waited_s, gains)
    aloft = looking or guidance.learns_first(state.learns, known, height_m, gains)
    gate_m = gains.search_height_m if aloft else gains.align_height_m
    gated_d = smaller(vel_d, guidance.descent_limit(waiting or aloft, gate_m, height_m, reference.vel_d, gains))
    vel_d = guidance.climb_out(height_m, gains) if away else gated_d
    vel_d = guidance.sunk(vel_d, known, state.contact_time_s, landing, gains) if not away else vel_d
    vel_d = guidance.unpowered(height_m, known) if guidance.powerless(known) else smaller(vel_d, gains.sink_limit_m_s)
    waited_s = state.waited_s + dt if (waiting and landing) or away else state.waited_s

    error_forward, error_right = along_heading(rotation, vel_n - est_n, vel_e - est_e)
    touching = state.contact_time_s > 0.0 or (landing and not away and held_up(vel_d - est_d, height_m, gains))
    return Steered(error_forward, error_right, vel_d - est_d, looking, waited_s, around, touching)


@equation
def outer_loop(
    state: AutopilotState, reference: Reference, estimate: Estimate, known: guidance.Knowledge, rotation: Rotation,
    gains: AutopilotGains, may_land: float, dt: float,
) -> AutopilotState:  # fmt: skip
    """Position and velocity errors to tilt and collective commands (50 Hz)."""
    error_forward, error_right, error_down, looking, waited_s, around, touching = steer(
        state, reference, estimate, known, rotation, gains, may_land, dt
    )
    felt_forward, felt_right = unexplained_acceleration(estimate, rotation, gains)
    gust_forward = felt_forward + gains.gust_decay_forward * (state.gust_forward - felt_forward)
    gust_right = felt_right + gains.gust_decay_right * (state.gust_right - felt_right)
    accel_forward = gains.forward_gain * error_forward + state.accel_forward - gains.gust_share * gust_forward
    accel_right = gains.right_gain * error_right + state.accel_right - gains.gust_share * gust_right
    tilt_accel = GRAVITY_M_S2 * gains.tilt_limit
    collective = -gains.collective_gain * error_down + state.collective
    flying = state.flying > 0.0

    forward = integrate(state.accel_forward, error_forward, gains.forward_integral, dt, accel_forward, tilt_accel)
    right = integrate(state.accel_right, error_right, gains.right_integral, dt, accel_right, tilt_accel)
    heave = integrate(
        state.collective, error_down, -gains.collective_integral, dt, collective, gains.collective_limit_rad
    )
    most = gains.collective_limit_rad + (guidance.FLARE_RAD if guidance.powerless(known) else 0.0)
    in_flight = gains.collective_trim_rad + clamp(collective, -gains.collective_limit_rad, most)
    pressed = not flying or (touching and gains.presses_on > 0.0)
    settling = state.collective_command - gains.spool_rate_rad_s * dt
    on_ground = settling if settling > gains.idle_collective_rad else gains.idle_collective_rad
    facing = faced(
        Facing(state.heading_north, state.heading_east, state.turn_rad_s, state.push_forward, state.push_right),
        gust_forward, gust_right, flying and state.contact_time_s == 0.0, gains, dt,
    )  # fmt: skip
    limit = gains.tilt_limit
    pitch = -clamp(accel_forward / GRAVITY_M_S2, -limit, limit) if flying else 0.0
    roll = clamp(accel_right / GRAVITY_M_S2, -limit, limit) if flying else 0.0
    flown = with_outer_loop(
        state,
        accel_forward=forward if flying else 0.0,
        accel_right=right if flying else 0.0,
        gust_forward=gust_forward if flying else 0.0,
        gust_right=gust_right if flying else 0.0,
        collective=heave if flying else 0.0,
        pitch_sine=gains.pitch_trim_sine + pitch,
        roll_sine=gains.roll_trim_sine + roll,
        collective_command=on_ground if pressed else in_flight,
        waited_s=waited_s if around.away == state.away else 0.0,
        searched_s=state.searched_s + dt if looking else 0.0,
        away=around.away,
        go_arounds=around.times,
        since_s=around.since_s,
    )
    return with_facing(
        flown,
        heading_north=facing.heading_north,
        heading_east=facing.heading_east,
        turn_rad_s=facing.turn_rad_s,
        push_forward=facing.push_forward,
        push_right=facing.push_right,
    )


@equation
def inner_loop(
    state: AutopilotState, rotation: Rotation, p: float, q: float, r: float, gains: AutopilotGains, dt: float
) -> tuple[AutopilotState, float, float, float, float]:
    """Tilt, rates and heading to blade angles lon, lat, col, ped [rad] (250 Hz)."""
    error_pitch = state.pitch_sine + rotation[6]  # sin(pitch) = -R_31
    error_roll = state.roll_sine - rotation[7]  # sin(roll) cos(pitch) = R_32
    off = heading_error(rotation, state.heading_north, state.heading_east)
    error_rate_yaw = gains.heading_gain * off + state.turn_rad_s - r
    flying = state.flying > 0.0

    lon = gains.pitch_gain * error_pitch - gains.pitch_damping * q + state.lon
    lat = gains.roll_gain * error_roll - gains.roll_damping * p + state.lat
    pedal = gains.yaw_rate_gain * error_rate_yaw + state.pedal
    torque = gains.pedal_per_collective * (state.collective_command - gains.collective_trim_rad)
    limit = gains.cyclic_limit_rad
    next_lon = integrate(state.lon, error_pitch, gains.pitch_integral, dt, lon, limit)
    next_lat = integrate(state.lat, error_roll, gains.roll_integral, dt, lat, limit)
    next_pedal = integrate(state.pedal, error_rate_yaw, gains.yaw_rate_integral, dt, pedal, gains.pedal_limit_rad)
    after = with_inner_loop(
        state,
        lon=next_lon if flying else 0.0,
        lat=next_lat if flying else 0.0,
        pedal=next_pedal if flying else 0.0,
    )
    return (
        after,
        gains.lon_trim_rad + (clamp(lon, -limit, limit) if flying else 0.0),
        gains.lat_trim_rad + (clamp(lat, -limit, limit) if flying else 0.0),
        state.collective_command,
        gains.pedal_trim_rad
        + torque
        + (clamp(pedal, -gains.pedal_limit_rad, gains.pedal_limit_rad) if flying else 0.0),
    )
