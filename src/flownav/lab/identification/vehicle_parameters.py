"""The parameters of a vehicle that a flight's commands show, each with a 95 % interval, or why the flight shows none.

A helicopter's: the stiffness of pitch and roll, how fast a cyclic turns the body, the lag of rotor and servos. A
multirotor's: angular acceleration by command, the motors' lag, thrust by command. Of both: drag by speed, and the
commands that held it (trim). A parameter whose interval is wider than LEAST_SURE has no number.
"""

import math
from collections.abc import Iterator
from functools import partial
from typing import NamedTuple

import numpy as np
from scipy import stats

from flownav.control.design import control_powers, nominal_model
from flownav.core.errors import InputError
from flownav.core.measurement import Array
from flownav.lab.identification.axis_fit import UNKNOWN, Axis, Solution, solved
from flownav.lab.identification.axis_laws import BODY_DAMPING_1_S, body_left, rotor_left, servo_answer
from flownav.lab.identification.commanded import HELICOPTER, Commanded
from flownav.lab.identification.excited import Spectra, spectra, strength
from flownav.lab.identification.quantities import Interval
from flownav.vehicle.kinds import AnyVehicle, hover_of
from flownav.vehicle.parameters import MultirotorParameters, VehicleParameters
from flownav.vehicle.trim import MultirotorTrim, Trim

LEAST_SURE = 0.25  # standard deviation of a logarithm, or half an interval over the value's double: beyond it no number
DAMPING_UNSURE = 0.07  # standard deviation of ln ζ of the servos: half of what the shipped file states
GEOMETRY_UNSURE = 0.3  # of the logarithm of a blade's angle by the angle that a log states: linkages are set by hand
LEAST_STRENGTH = 10.0  # of the response to the set-point, see `strength`
DAMPING_1_S = 2.0  # standard deviation of a multirotor's damping about none
STAMPS_UNSURE = 0.04  # of a row, by which the commands' stamps may be off the rates': chosen on simulated flights
BLOCK_S = 2.0  # in which readings of drag and trim are taken for one
LEAST_BLOCKS = 6
SLOW_M_S = 1.0  # hover; beyond it the trim is another
TOO_WIDE = "too little excitation: its interval would be wider than a factor of 1.6"
AXES = ("roll", "pitch")


class Found(NamedTuple):
    """A parameter: its name in words, its unit, its interval or None, and why there is none."""

    key: str
    name: str
    unit: str
    interval: Interval | None
    why: str


class Identified(NamedTuple):
    """The parameters that a flight shows of a vehicle."""

    flight: Commanded
    found: tuple[Found, ...]
    notes: tuple[str, ...]

    def interval(self, key: str) -> Interval | None:
        """A parameter's, by its key."""
        return next((one.interval for one in self.found if one.key == key), None)


def identify_vehicle(flight: Commanded, base: AnyVehicle) -> Identified:
    """The parameters; base: what the file states of what no log shows. InputError where the base is of another kind."""
    helicopter = isinstance(base, VehicleParameters)
    if helicopter != (flight.kind == HELICOPTER):
        raise InputError(f"{flight.path}: a {flight.kind}'s log, and the vehicle file is of another kind; give its own")
    notes = []
    if flight.setpoint is None:
        notes.append("no set-point in the log: gusts that the loops answer bias what commands show; none is given")
    powers = _rotor(flight, base) if isinstance(base, VehicleParameters) else _body(flight, base)
    return Identified(flight, (*powers, *_by_force(flight), *_trims(flight)), tuple(notes))


# -- what turns it ------------------------------------------------------------------------------------------------
def _axis_spectra(flight: Commanded, axis: int) -> Spectra | None:
    """Spectra of roll (0) or pitch (1); None without a set-point at work for two windows."""
    if flight.setpoint is None:
        return None
    other = flight.rates[:, 1 - axis] * (-1.0 if axis == 0 else 1.0)
    signals = {"own": flight.rates[:, axis], "other": other, "command": flight.command[:, axis]}
    found = spectra(flight.step_s, flight.setpoint[:, axis], signals, flight.highest_hz, periodic=flight.periodic)
    enough = len(found.setpoint) > 1 and len(found.w_rad_s) > 2 and np.ptp(flight.command[:, axis]) > 0.0
    moved = enough and np.ptp(flight.setpoint[:, axis]) > 0.0 and strength(found, "own") > LEAST_STRENGTH
    return _in_step(found, flight) if moved else None


def _in_step(found: Spectra, flight: Commanded) -> Spectra:
    """With the commands on the rates' stamps, and the rates without the mean over which they are given."""
    late = np.exp(1j * found.w_rad_s * flight.commands_late_s)
    mean = np.sinc(found.w_rad_s * flight.rates_mean_s / (2.0 * np.pi))
    turned = {name: signal * late if name == "command" else signal / mean for name, signal in found.signals.items()}
    return found._replace(signals=turned)


def _rotor(flight: Commanded, base: VehicleParameters) -> Iterator[Found]:
    hover = hover_of(base)
    assert isinstance(hover, Trim)
    nominal = nominal_model(base, hover, -1)
    by = "" if flight.angles else " (command 1: full cyclic)"
    names = (
        ("pitch_stiffness_1_s2", "pitch stiffness", "1/s2"), ("roll_stiffness_1_s2", "roll stiffness", "1/s2"),
        ("pitch_rate_by_cyclic_1_s", f"pitch rate by cyclic{by}", "1/s"),
        ("roll_rate_by_cyclic_1_s", f"roll rate by cyclic{by}", "1/s"), ("lag_s", "lag of rotor and servos", "s"),
    )  # fmt: skip
    both = [_axis_spectra(flight, axis) for axis in (0, 1)]
    axes, answers = [], []
    for axis, found in enumerate(both):
        if found is None:
            continue
        command = (
            flight.command[:, axis] if flight.setpoint is None else flight.command[flight.setpoint[:, axis] != 0, axis]
        )
        slop = [nominal.slop_rad, nominal.slop_rad + nominal.slop_std_rad] if flight.angles else [0.0, 0.0]
        share, less = (servo_answer(command, flight.step_s, nominal, each) for each in slop)
        answers.append(1.0 - less / share + 1e-6)
        axes.append(Axis(found, partial(rotor_left, pitch=axis == 1, answers=share, nominal=nominal)))
    if not axes:
        yield from (Found(*name, None, _too_little(flight)) for name in names)
        return
    geometry = 0.0 if flight.exact else (GEOMETRY_UNSURE if flight.angles else UNKNOWN)
    before = (UNKNOWN,) * 4 + (
        DAMPING_UNSURE,
        float(np.mean(answers)),
        geometry,
        geometry,
        STAMPS_UNSURE * flight.step_s,
    )
    fit = solved(axes, before)
    x = fit.x
    by_flap = math.exp(-x[2]) / nominal.flap_rate_1_s
    by_servo = 2.0 * nominal.servo_damping * math.exp(x[4] - x[3]) / nominal.servo_rad_s
    share = by_flap / (by_flap + by_servo)
    lag = np.array([0.0, 0.0, -share, share - 1.0, 1.0 - share, 0.0, 0.0, 0.0, 0.0])
    values = (
        (nominal.pitch_stiffness_1_s2 * math.exp(x[0]), _unit(0)),
        (nominal.roll_stiffness_1_s2 * math.exp(x[1]), _unit(1)),
        (nominal.flap_rate_1_s * math.exp(x[2] + x[6]), _unit(2, 6)),
        (nominal.flap_rate_1_s * math.exp(x[2] + x[7]), _unit(2, 7)), (by_flap + by_servo, lag),
    )  # fmt: skip
    seen = (both[1], both[0], both[1], both[0], both[0] or both[1])
    for name, (value, slopes), shown in zip(names, values, seen, strict=True):
        yield Found(*name, None, _too_little(flight)) if shown is None else _of_logarithm(name, value, slopes, fit)


def _unit(*places: int) -> Array:
    slopes = np.zeros(9)
    slopes[list(places)] = 1.0
    return slopes


def _body(flight: Commanded, base: MultirotorParameters) -> Iterator[Found]:
    hover = hover_of(base)
    assert isinstance(hover, MultirotorTrim)
    powers, lag = control_powers(base, hover), 1.0 / base.motor_rate_1_s
    for axis, label in enumerate(AXES):
        names = (
            (f"{label}_power_rad_s2", f"{label} acceleration by command", "rad/s2"),
            (f"{label}_lag_s", f"motors' lag, in {label}", "s"),
        )
        found = _axis_spectra(flight, axis)
        if found is None:
            yield from (Found(*name, None, _too_little(flight)) for name in names)
            continue
        stated = (powers[axis], lag)
        law = partial(body_left, stated=stated)
        fit = solved([Axis(found, law)], (UNKNOWN, UNKNOWN, DAMPING_1_S / BODY_DAMPING_1_S))
        for k, name in enumerate(names):
            yield _of_logarithm(name, stated[k] * math.exp(fit.x[k]), np.eye(3)[k], fit)


def _of_logarithm(name: tuple[str, str, str], value: float, slopes: Array, fit: Solution) -> Found:
    """A positive value whose logarithm has these derivatives by the unknown."""
    sigma = math.sqrt(max(float(slopes @ fit.covariance @ slopes), 0.0))
    if not sigma <= LEAST_SURE:
        return Found(*name, None, TOO_WIDE)
    spread = math.exp(fit.factor * sigma)
    return Found(*name, Interval(value, value / spread, value * spread), "")


def _too_little(flight: Commanded) -> str:
    if flight.setpoint is None:
        return "no set-point in the log, and no stir in its commands"
    return "too little excitation: set-points moved it little beside gusts"


# -- what carries and brakes it -----------------------------------------------------------------------------------
def _by_force(flight: Commanded) -> Iterator[Found]:
    """Thrust by command of a multirotor, and drag by speed, from specific force."""
    if flight.kind != HELICOPTER:
        name = ("thrust_by_command_m_s2", "thrust by command, over mass", "m/s2")
        collective = flight.command[:, 2]
        if flight.force is None or not np.isfinite(collective).all() or not np.mean(collective) > 0.0:
            yield Found(*name, None, "no specific force beside a thrust command")
        else:
            yield _line(name, -flight.force[:, 2], collective[:, None], flight.step_s)
    for axis, label in enumerate(("forward", "to the right")):
        name = (f"drag_{'xy'[axis]}_1_s", f"drag by speed {label}", "1/s")
        if flight.force is None or flight.velocity is None:
            yield Found(*name, None, "no specific force beside a velocity")
            continue
        columns = np.column_stack([flight.velocity[:, axis], np.ones(len(flight.velocity))])
        yield _line(name, -flight.force[:, axis], columns, flight.step_s)


def _line(name: tuple[str, str, str], y: Array, columns: Array, step_s: float) -> Found:
    """The slope by the first column, with an interval from blocks: what is left within BLOCK_S counts once."""
    labels = np.arange(len(y)) // max(1, round(BLOCK_S / step_s))
    if labels[-1] + 1 < LEAST_BLOCKS or np.linalg.matrix_rank(columns) < columns.shape[1]:
        return Found(*name, None, "too little excitation: its cause does not change")
    slope, *_ = np.linalg.lstsq(columns, y, rcond=None)
    inverse = np.linalg.inv(columns.T @ columns)
    rest = columns * (y - columns @ slope)[:, None]
    blocks = np.column_stack([np.bincount(labels, weights=column) for column in rest.T])
    pairs = blocks[1:].T @ blocks[:-1]  # Newey and West, one block on either side
    meat = blocks.T @ blocks + 0.5 * (pairs + pairs.T)
    few = len(blocks) / max(len(blocks) - columns.shape[1], 1)
    variance = few * float((inverse @ meat @ inverse)[0, 0])
    half = float(stats.t.ppf(0.975, len(blocks) - columns.shape[1])) * math.sqrt(max(variance, 0.0))
    value = float(slope[0])
    if not half < 2.0 * LEAST_SURE * abs(value):
        return Found(*name, None, "too little excitation: its interval is wider than half of it")
    return Found(*name, Interval(value, value - half, value + half), "")


def _trims(flight: Commanded) -> Iterator[Found]:
    """The commands that held it in hover, in the wind of the flight."""
    slow = (
        np.full(len(flight.command), True)
        if flight.velocity is None
        else np.abs(flight.velocity).max(axis=1) < SLOW_M_S
    )
    unit, factor = ("deg", math.degrees(1.0)) if flight.angles else ("share", 1.0)
    for column, label in enumerate(("roll", "pitch", "collective" if flight.kind == HELICOPTER else "thrust")):
        name = (f"trim_{label}_{unit}", f"{label} command in hover", unit)
        y = factor * flight.command[slow, column]
        if not np.isfinite(y).all() or len(y) * flight.step_s < LEAST_BLOCKS * BLOCK_S:
            yield Found(*name, None, "no 12 s of hover")
            continue
        labels = np.arange(len(y)) // round(BLOCK_S / flight.step_s)
        means = np.bincount(labels, weights=y) / np.bincount(labels)
        half = float(stats.t.ppf(0.975, len(means) - 1)) * float(np.std(means, ddof=1)) / math.sqrt(len(means))
        correlation = float(np.clip(np.corrcoef(means[1:], means[:-1])[0, 1], 0.0, 0.9)) if np.ptp(means) > 0.0 else 0.0
        half *= math.sqrt((1.0 + correlation) / (1.0 - correlation))
        yield Found(*name, Interval(float(y.mean()), float(y.mean()) - half, float(y.mean()) + half), "")
