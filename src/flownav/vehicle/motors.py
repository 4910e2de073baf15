"""A multirotor's motors and propellers: mixer, motors with lag, battery that sags; thrust, torque, flapping and drag.

Block 1, actuators. Controls are shares of a rotor's full thrust: `col` of each, `lon`, `lat` and `ped` of the
difference between rotors.

Block 2, a fixed-pitch propeller and the ground under it. Svacha, Mohta and Kumar (ICUAS 2017) and RotorPy (Folk,
Paulos and Kumar 2023): thrust, drag and axial damping linear in Ω·velocity; the coefficients follow from the
propeller's static thrust, see `MultirotorParameters`.
"""

from typing import NamedTuple

import numpy as np

from flownav.core.compile import clamp, equation, larger, smaller
from flownav.vehicle.parameters import MultirotorParameters
from flownav.vehicle.rotor import source_and_image
from flownav.vehicle.state import Controls, Six

LEAST_SHARE = 1e-6


@equation
def highest(x: Six, hexa: bool) -> float:
    """The largest of four numbers, or of six."""
    four = larger(larger(x.one, x.two), larger(x.three, x.four))
    return larger(four, larger(x.five, x.six)) if hexa else four


@equation
def lowest(x: Six, hexa: bool) -> float:
    """The smallest of four numbers, or of six."""
    four = smaller(smaller(x.one, x.two), smaller(x.three, x.four))
    return smaller(four, smaller(x.five, x.six)) if hexa else four


@equation
def mixed(controls: Controls, hexa: bool, vehicle: MultirotorParameters) -> Six:
    """Each rotor's share of its full thrust, idle_share..1.

    lon > 0 lifts the front, lat > 0 the left, ped > 0 the rotors that turn left, whose torque turns the nose right.
    Where they do not fit: tilt is scaled down to the whole range, the collective gives way to it, yaw takes what is
    left (as PX4's and ArduPilot's mixers do with air mode on).
    """
    low, room = vehicle.idle_share, 1.0 - vehicle.idle_share
    lon, lat = controls.lon * vehicle.per_arm_1_m, controls.lat * vehicle.per_arm_1_m
    tilt = Six(
        lon * vehicle.x_1_m - lat * vehicle.y_1_m,
        lon * vehicle.x_2_m - lat * vehicle.y_2_m,
        lon * vehicle.x_3_m - lat * vehicle.y_3_m,
        lon * vehicle.x_4_m - lat * vehicle.y_4_m,
        lon * vehicle.x_5_m - lat * vehicle.y_5_m if hexa else 0.0,
        lon * vehicle.x_6_m - lat * vehicle.y_6_m if hexa else 0.0,
    )
    top, bottom = highest(tilt, hexa), lowest(tilt, hexa)
    fits = room / larger(top - bottom, room)
    top, bottom = top * fits, bottom * fits
    base = clamp(controls.col, low - bottom, 1.0 - top)
    left = smaller(1.0 - top - base, base + bottom - low)
    yaw = clamp(controls.ped, -left, left)
    return Six(
        tilt.one * fits + base + yaw,
        tilt.two * fits + base - yaw,
        tilt.three * fits + base + yaw,
        tilt.four * fits + base - yaw,
        tilt.five * fits + base + yaw if hexa else 0.0,
        tilt.six * fits + base - yaw if hexa else 0.0,
    )


@equation
def shaft_power(speed: float, vehicle: MultirotorParameters) -> float:
    """Power at the shaft of one rotor [W]."""
    return vehicle.torque_n_m_s2 * speed * speed * speed


@equation
def battery_voltage(power_w: float, used_as: float, vehicle: MultirotorParameters) -> float:
    """The voltage at the motors [V] while they take this shaft power: V = V_rest - R·I, V·I·efficiency = P.

    At a power that the battery cannot give, half its voltage at rest.
    """
    rest = vehicle.full_v - vehicle.volt_per_as * used_as
    under_root = rest * rest - 4.0 * vehicle.resistance_ohm * power_w / vehicle.efficiency
    root: float = np.sqrt(larger(under_root, 1e-12))
    return 0.5 * (rest + root)


@equation
def root_of_share(share: float) -> float:
    """Share of the full speed that gives a share of the full thrust."""
    root: float = np.sqrt(larger(share, LEAST_SHARE))
    return root


@equation
def roots_of_shares(x: Six, hexa: bool) -> Six:
    """Roots of each rotor's share: the mixer's shares hold for a step, and so do their roots."""
    return Six(
        root_of_share(x.one),
        root_of_share(x.two),
        root_of_share(x.three),
        root_of_share(x.four),
        root_of_share(x.five) if hexa else 0.0,
        root_of_share(x.six) if hexa else 0.0,
    )


@equation
def commanded_speed(root: float, voltage_v: float, vehicle: MultirotorParameters) -> float:
    """The speed for the root of a share [rad/s]; it falls with the battery's voltage."""
    full: float = vehicle.full_speed_rad_s * voltage_v * (1.0 / vehicle.full_v)
    return full * root


@equation
def speed_rate(speed: float, commanded: float, vehicle: MultirotorParameters) -> float:
    """First-order lag of a motor [rad/s2]."""
    return vehicle.motor_rate_1_s * (commanded - speed)


@equation
def torque_of(speed: float, thrust_n: float, vehicle: MultirotorParameters) -> float:
    """Torque of the air on a rotor [N m]; thrust_n: in free air, by which it differs from a hover at this speed."""
    hover_n = vehicle.thrust_n_s2 * speed * speed
    return vehicle.torque_n_m_s2 * speed * speed + vehicle.torque_of_thrust_m * (thrust_n - hover_n)


STILL_SQ = 1e-9  # [m2/s2] keeps a rotor at rest in dead air from dividing by zero


class PropellerLoad(NamedTuple):
    """Thrust [N]; drag per in-plane airspeed, the disc's tilt in it [N s/m]; hub moment per airspeed [N s]; torque."""

    thrust_n: float
    drag_n_s_m: float
    hub_n_s: float
    torque_n_m: float


@equation
def lifting(speed: float, inplane_sq: float, vehicle: MultirotorParameters) -> tuple[float, float]:
    """Translational lift [N] is the first over the second.

    It grows with V² and levels out at V = 2·v_i, as momentum theory does (3 % of v_i to V = 3·v_i).
    """
    twice_inflow_sq = 4.0 * (vehicle.hover_inflow_m * vehicle.hover_inflow_m) * speed * speed + STILL_SQ
    return vehicle.inplane_n_s2_m2 * (inplane_sq * twice_inflow_sq), twice_inflow_sq + inplane_sq


@equation
def level_thrust(speed: float, axial: float, vehicle: MultirotorParameters) -> float:
    """Thrust [N] without translational lift and ground; axial: velocity against the thrust, up is negative [m/s]."""
    return vehicle.thrust_n_s2 * speed * speed + vehicle.axial_n_s2_m * speed * axial


@equation
def propeller_load(
    speed: float, inplane_sq: float, axial: float, horizontal_sq: float, hub_height_m: float,
    vehicle: MultirotorParameters,
) -> PropellerLoad:  # fmt: skip
    """One propeller at a height of its hub above the ground [m], horizontal airspeed squared [m2/s2].

    Its torque is that of its speed in hover, and what climb and translational lift change; Cheeseman and Bennett's
    thrust in the ground's effect is that of a rotor of the same power.
    Divisions are most of what a rotor costs on lanes: one serves lift, ground and flapping.
    """
    lift, by_lift = lifting(speed, inplane_sq, vehicle)
    free, image = source_and_image(hub_height_m, horizontal_sq, vehicle.hover_inflow_m * speed, vehicle.radius_m)
    by_ground, by_tilt = free - image, vehicle.radius_m * vehicle.radius_m * larger(speed, 1.0)
    per_all = 1.0 / (by_lift * by_ground * by_tilt)
    lifted = lift * (by_ground * by_tilt * per_all)
    above_ground = level_thrust(speed, axial, vehicle) + lifted
    thrust = free * (by_lift * by_tilt * per_all) * above_ground
    tilt = vehicle.flap_back_m * (by_lift * by_ground * per_all)  # [rad/(m/s)]
    return PropellerLoad(
        thrust,
        vehicle.inplane_drag_n_s2_m_rad * speed + thrust * tilt,
        vehicle.hub_stiffness_n_m_rad * tilt,
        torque_of(speed, above_ground, vehicle),
    )
