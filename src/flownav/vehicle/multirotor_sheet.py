"""What there is to know of a multirotor before it flies: hover, battery, loads by airspeed, ground effect."""

from __future__ import annotations

import math
from typing import Any, NamedTuple

from flownav.vehicle.multirotor_parameters import MultirotorParameters, full_thrust
from flownav.vehicle.multirotor_trim import MultirotorTrim, trim_multirotor

SPEEDS_M_S = (0.0, 2.0, 4.0, 8.0)
HEIGHTS_OVER_R = (1.5, 2.0, 3.0, 4.0, 8.0)


class MultirotorSheet(NamedTuple):
    """Hover out of ground effect; (airspeed, trim) pairs; (height of the rotors over R, share of full thrust) pairs.

    The last has no height at which the feet would carry weight.
    """

    name: str
    vehicle: MultirotorParameters
    trim: MultirotorTrim
    forward: tuple[tuple[float, MultirotorTrim], ...]
    near_ground: tuple[tuple[float, float], ...]


def multirotor_sheet(name: str, vehicle: MultirotorParameters) -> MultirotorSheet:
    """The sheet of a multirotor. InputError as `trim_multirotor`."""
    hover = trim_multirotor(vehicle)
    above = vehicle.rotors_above_cg_m
    return MultirotorSheet(
        name=name,
        vehicle=vehicle,
        trim=hover,
        forward=tuple((speed, trim_multirotor(vehicle, (speed, 0.0, 0.0))) for speed in SPEEDS_M_S),
        near_ground=tuple(
            (ratio, trim_multirotor(vehicle, height_m=ratio * vehicle.radius_m - above).controls.col)
            for ratio in HEIGHTS_OVER_R
            if ratio * vehicle.radius_m - above > vehicle.cg_above_skid_m
        ),
    )


def facts_of(sheet: MultirotorSheet) -> dict[str, Any]:
    """The sheet as numbers and lists; SI and radians, thrust as shares of full thrust."""
    hover = sheet.trim
    return {
        "vehicle": sheet.name,
        "trim": {
            "thrust_share": hover.controls.col,
            "thrust_n": hover.thrust_n,
            "speed_rad_s": hover.speed_rad_s,
            "induced_velocity_m_s": hover.induced_velocity_m_s,
            "power_w": hover.power_w,
            "current_a": hover.current_a,
            "voltage_v": hover.voltage_v,
        },
        "full_thrust_n": sheet.vehicle.rotor_count * full_thrust(sheet.vehicle),
        "forward": [
            {
                "speed_m_s": speed,
                "pitch_rad": trim.pitch_rad,
                "thrust_share": trim.controls.col,
                "power_w": trim.power_w,
            }
            for speed, trim in sheet.forward
        ],
        "near_ground": [{"z_over_R": ratio, "thrust_share": share} for ratio, share in sheet.near_ground],
    }


def rows_of(sheet: MultirotorSheet) -> list[tuple[str, str]]:
    """Name and figure of everything, for people."""
    hover = sheet.trim
    rows = [
        ("share of full thrust in hover", f"{hover.controls.col:.3f}"),
        ("thrust, N", f"{hover.thrust_n:.2f}"),
        ("full thrust, N", f"{sheet.vehicle.rotor_count * full_thrust(sheet.vehicle):.1f}"),
        ("rotors' speed, rad/s", f"{hover.speed_rad_s:.0f}"),
        ("induced velocity, m/s", f"{hover.induced_velocity_m_s:.2f}"),
        ("shaft power, W", f"{hover.power_w:.0f}"),
        ("current, A", f"{hover.current_a:.2f}"),
        ("voltage, V", f"{hover.voltage_v:.2f}"),
    ]
    for speed, trim in sheet.forward[1:]:
        rows.append((f"pitch at {speed:g} m/s, deg", f"{math.degrees(trim.pitch_rad):.2f}"))
        rows.append((f"share of full thrust at {speed:g} m/s", f"{trim.controls.col:.3f}"))
    rows += [(f"share of full thrust, rotors at {ratio:g} R", f"{share:.3f}") for ratio, share in sheet.near_ground]
    return rows
