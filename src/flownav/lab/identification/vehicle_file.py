"""A vehicle as a flight shows it, as a vehicle file: the base file with the identified numbers in place of its own.

A file holds masses, inertias and rotors, where a flight shows what they make together. Each number that was found moves
the entry that it is most unsure by: a stiffness the inertia about its axis, the rate by cyclic the blades' flapping
inertia, what is left of the lag the servos' frequency; a multirotor's acceleration by command an inertia, its lag the
motors', its thrust the propellers' coefficient, its drag theirs in the plane. The entry keeps an uncertainty that is
half of its 95 % interval, and says where it comes from.
"""

import math
from collections.abc import Iterator
from copy import deepcopy
from pathlib import Path
from typing import Any, NamedTuple

from flownav.control.design import control_powers, nominal_model
from flownav.core.guard import write_text
from flownav.core.parameter_files import read_toml
from flownav.core.text import to_toml
from flownav.lab.identification.quantities import Interval
from flownav.lab.identification.vehicle_parameters import Identified
from flownav.vehicle.kinds import flattened, hover_of, read_kind, require_flyable, vehicle_file
from flownav.vehicle.parameters import flatten, flatten_multirotor, hover_speed
from flownav.vehicle.schema import MultirotorFile, VehicleFile
from flownav.vehicle.trim import MultirotorTrim, Trim

DIGITS = 6


class Entry(NamedTuple):
    """An entry of a vehicle file by its dotted key, its interval, and the parameter that moves it."""

    key: str
    interval: Interval
    by: str


def vehicle_entries(found: Identified, base: Path | None, name: str) -> dict[str, Any]:
    """The file's content. InputError where such a vehicle cannot be or cannot hover."""
    path = vehicle_file(base)
    contents = deepcopy(read_toml(path))
    contents["name"] = name
    for entry in moved_entries(found, base):
        table, key = entry.key.split(".")
        contents[table][key] = _valued(entry, found.flight.path.name)
    file = read_kind(contents, f"{path}, with what {found.flight.path} shows")
    require_flyable(flattened(file), f"{path}, with what {found.flight.path} shows")
    return contents


def write_vehicle(path: Path, contents: dict[str, Any]) -> None:
    """Write the file whole or not at all. InputError where it cannot be written."""
    write_text(to_toml(contents), path)


def moved_entries(found: Identified, base: Path | None) -> tuple[Entry, ...]:
    """The entries that the flight moves, from those of the base file."""
    file = read_kind(read_toml(vehicle_file(base)), str(vehicle_file(base)))
    return tuple(_propellers(found, file) if isinstance(file, MultirotorFile) else _rotors(found, file))


def _rotors(found: Identified, file: VehicleFile) -> Iterator[Entry]:
    vehicle = flatten(file)
    hover = hover_of(vehicle)
    assert isinstance(hover, Trim)
    stated = nominal_model(vehicle, hover, -1)
    roll, pitch = found.interval("roll_stiffness_1_s2"), found.interval("pitch_stiffness_1_s2")
    stiffer, lever = 1.0, vehicle.hub_above_cg_m * hover.thrust_n
    if roll is not None and pitch is not None:  # both together are the spring's, one against the other an inertia's
        both = math.sqrt(roll.value / stated.roll_stiffness_1_s2 * pitch.value / stated.pitch_stiffness_1_s2)
        spring = both * (vehicle.hub_stiffness_n_m_rad + lever)
        if spring > lever:
            stiffer, half = both, 0.25 * spring * math.hypot(_width(roll), _width(pitch))
            hub = spring - lever
            yield Entry("main_rotor.hub_stiffness_n_m_rad", Interval(hub, hub - half, hub + half), "stiffness")
    for shown, key, own, axis in (
        (roll, "inertia_xx_kg_m2", stated.roll_stiffness_1_s2 * vehicle.inertia_xx_kg_m2, "roll"),
        (pitch, "inertia_yy_kg_m2", stated.pitch_stiffness_1_s2 * vehicle.inertia_yy_kg_m2, "pitch"),
    ):
        if shown is not None:
            yield Entry(f"body.{key}", _over(stiffer * own, shown), f"{axis} stiffness")
    rate, lag = found.interval("pitch_rate_by_cyclic_1_s"), found.interval("lag_s")
    if rate is None or not found.flight.exact:  # where the angles are not sure, a rate by cyclic shows no flapping
        return
    blade = file.main_rotor.blade_flap_inertia_kg_m2 * stated.flap_rate_1_s
    yield Entry("main_rotor.blade_flap_inertia_kg_m2", _over(blade, rate), "pitch rate by cyclic")
    late = 0.0 if lag is None else lag.value - 1.0 / rate.value
    if lag is not None and late > 0.0:
        servo = 2.0 * stated.servo_damping / late
        share = (lag.high - lag.low) / (2.0 * late)
        yield Entry("cyclic.frequency_rad_s", Interval(servo, servo * (1.0 - share), servo * (1.0 + share)), "lag")


def _propellers(found: Identified, file: MultirotorFile) -> Iterator[Entry]:
    vehicle = flatten_multirotor(file)
    hover = hover_of(vehicle)
    assert isinstance(hover, MultirotorTrim)
    roll, pitch, _, heave = control_powers(vehicle, hover)
    thrust = found.interval("thrust_by_command_m_s2")
    stronger = 1.0 if thrust is None else thrust.value / heave
    for power, key, own, inertia in (
        ("roll_power_rad_s2", "inertia_xx_kg_m2", roll, vehicle.inertia_xx_kg_m2),
        ("pitch_power_rad_s2", "inertia_yy_kg_m2", pitch, vehicle.inertia_yy_kg_m2),
    ):
        shown = found.interval(power)
        if shown is not None:
            yield Entry(f"body.{key}", _over(own * inertia * stronger, shown), power.split("_")[0] + " acceleration")
    lags = [each for each in (found.interval("roll_lag_s"), found.interval("pitch_lag_s")) if each is not None]
    if lags:
        yield Entry("motor.time_constant_s", min(lags, key=lambda one: one.high / one.low), "motors' lag")
    speed = hover_speed(vehicle)
    if thrust is not None:
        coefficient = file.propeller.thrust_coefficient / heave
        yield Entry("propeller.thrust_coefficient", _times(thrust, coefficient), "thrust by command")
        speed /= stronger**0.5
    drags = [each for each in (found.interval("drag_x_1_s"), found.interval("drag_y_1_s")) if each is not None]
    if drags:
        sure = min(drags, key=lambda one: one.high - one.low)
        yield Entry(
            "propeller.inplane_drag_n_s2_m_rad", _times(sure, vehicle.mass_kg / vehicle.rotor_count / speed), "drag"
        )


def _width(interval: Interval) -> float:
    """Of the interval over its value."""
    return (interval.high - interval.low) / interval.value


def _times(interval: Interval, factor: float) -> Interval:
    return Interval(*(factor * each for each in interval))


def _over(numerator: float, interval: Interval) -> Interval:
    """A number by an interval: its ends change places."""
    return Interval(numerator / interval.value, numerator / interval.high, numerator / interval.low)


def _valued(entry: Entry, log: str) -> dict[str, Any]:
    value, half = entry.interval.value, 0.5 * (entry.interval.high - entry.interval.low)
    source = f"identified: {entry.by} in {log}, +- 95 %"
    return {"value": float(f"{value:.{DIGITS}g}"), "uncertainty": float(f"{half:.3g}"), "source": source}
