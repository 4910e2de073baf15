"""Block 1 of a multirotor, actuators: mixer, motors with lag, battery that sags.

Controls are shares of a rotor's full thrust: `col` of each, `lon`, `lat` and `ped` of the difference between rotors.
"""

from __future__ import annotations

import numpy as np

from flownav.core.compile import clamp, equation, larger, smaller
from flownav.vehicle.multirotor_parameters import MultirotorParameters
from flownav.vehicle.multirotor_state import Six
from flownav.vehicle.state import Controls

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
    """Of one rotor [W]."""
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
    """What a share of the full thrust is as a share of the full speed."""
    root: float = np.sqrt(larger(share, LEAST_SHARE))
    return root


@equation
def roots_of_shares(x: Six, hexa: bool) -> Six:
    """Of each rotor: the mixer's shares hold for a step, and so do their roots."""
    return Six(
        root_of_share(x.one),
        root_of_share(x.two),
        root_of_share(x.three),
        root_of_share(x.four),
        root_of_share(x.five) if hexa else 0.0,
        root_of_share(x.six) if hexa else 0.0,
    )


@equation
def told_speed(root: float, voltage_v: float, vehicle: MultirotorParameters) -> float:
    """The speed that the root of a share asks for [rad/s]; it falls with the battery's voltage."""
    full: float = vehicle.full_speed_rad_s * voltage_v * (1.0 / vehicle.full_v)
    return full * root


@equation
def speed_rate(speed: float, told: float, vehicle: MultirotorParameters) -> float:
    """First-order lag of a motor [rad/s2]."""
    return vehicle.motor_rate_1_s * (told - speed)
