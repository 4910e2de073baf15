"""Flight laws that are tried beside the shipped one (`tools/other_laws.py` has their words), each linear.

A law is written twice: as frequency responses of one axis, and as filters inside the plant for the exact sampled loop.
"""

from __future__ import annotations

from collections.abc import Callable
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from flownav.control.learnt_model import NominalModel
from flownav.control.loops import FLOWN
from flownav.core.frames import GRAVITY_M_S2
from flownav.vehicle.linearize import INPUTS, OUTPUTS, Complex, LinearPlant
from shape_gains import AXES, OMEGA_RAD_S, Axis, Paths, Shape, paths_of

Array = NDArray[np.float64]

FILTER_DAMPING = 0.7
SAMPLED_S = 0.5 * FLOWN.inner_s  # as a lag: half a hold of the attitude loop, on what a law feeds back by itself


class Searched(NamedTuple):
    """Numbers of a law: `Shape`'s in the same order, then the law's own two."""

    attitude: float  # INDI: K [1/s]
    attitude_integral: float  # INDI: k [1/s]
    damping_s: float  # INDI: 1/G, as a share of what the model has
    velocity_1_s: float
    position_1_s: float
    velocity_integral_1_s2: float
    gust_s: float
    own: float  # INDI: H [rad/s]; wind state: cyclic per felt acceleration, as a share of 1/g
    own_s: float  # wind state: its low-pass


class Law(NamedTuple):
    """Name, bounds of its numbers, its paths, the plant with what it feeds back inside the attitude loop, its numbers
    as a shape, and of a shape and a stiffness [1/s2] the numbers from which it is searched.
    """

    name: str
    least: Searched
    most: Searched
    paths: Callable[[Searched, Axis, NominalModel], Paths]
    inside: Callable[[Searched, str, LinearPlant, NominalModel], LinearPlant]
    shape: Callable[[Searched, str, NominalModel], Shape]
    start: Callable[[Shape, float], Searched]


OUTER_LEAST, OUTER_MOST = (0.3, 0.3, 0.05, 0.03), (6.0, 2.0, 3.0, 1.0)
PID_LEAST, PID_MOST, UNUSED = (0.05, 0.001, 0.004), (0.6, 0.4, 0.08), (1.0, 1.0)
SLOW_1_S = 1e-3  # INDI needs no integral of the tilt's error; one that is not moved would be an eigenvalue of 1
OFF_S = 1e6  # a low-pass so slow that nothing comes through


# -- the laws as frequency responses ------------------------------------------------------------------------------
def rotor_model(stated: NominalModel, s: Complex) -> tuple[Complex, Complex]:
    """Tilt of the disc per cyclic, and against the body's rate, as stated."""
    rotor, w = stated.flap_rate_1_s / (s + stated.flap_rate_1_s), stated.servo_rad_s
    return rotor * w * w / (s * s + 2.0 * stated.servo_damping * w * s + w * w), rotor / stated.flap_rate_1_s


def stiffness_of(stated: NominalModel, name: str) -> float:
    """Angular acceleration per tilt of the disc [1/s2]."""
    return stated.pitch_stiffness_1_s2 if name == "forward" else stated.roll_stiffness_1_s2


def pid_shape(numbers: Searched, name: str, stated: NominalModel) -> Shape:
    """The numbers as the shipped law's."""
    return Shape(*numbers[: len(Shape._fields)])


def without_shape(numbers: Searched, name: str, stated: NominalModel) -> Shape:
    """The shipped law's with its observer off."""
    return pid_shape(numbers, name, stated)._replace(gust_s=OFF_S)


def pid_start(shape: Shape, stiffness_1_s2: float) -> Searched:
    """The designed shape, and little of what is the law's own."""
    return Searched(*shape, 0.05, 0.05)


def indi_start(shape: Shape, stiffness_1_s2: float) -> Searched:
    """INDI with the designed shape's gains, its model's G and a filter of 25 rad/s."""
    rate = shape.damping_s * stiffness_1_s2
    return Searched(rate, shape.attitude / shape.damping_s, 1.0, *shape[3:], 25.0, 1.0)


def pid_paths(numbers: Searched, axis: Axis, stated: NominalModel) -> Paths:
    """The shipped law."""
    return paths_of(pid_shape(numbers, axis.name, stated), axis)


def without_paths(numbers: Searched, axis: Axis, stated: NominalModel) -> Paths:
    """The shipped law with its observer off."""
    return paths_of(without_shape(numbers, axis.name, stated), axis)


def wind_paths(numbers: Searched, axis: Axis, stated: NominalModel) -> Paths:
    """The shipped law and the wind's state fed to the cyclic."""
    s, sign = 1j * OMEGA_RAD_S, AXES[axis.name][2]
    disc, against = rotor_model(stated, s)
    seen = numbers.own / GRAVITY_M_S2 / ((1.0 + numbers.own_s * s) * (1.0 + SAMPLED_S * s))
    paths = pid_paths(numbers, axis, stated)
    past = paths.past_command.copy()
    past[0] += seen * GRAVITY_M_S2
    past[1] -= seen * GRAVITY_M_S2 * against
    past[2] -= seen * sign * s
    remembered = 1.0 - seen * GRAVITY_M_S2 * disc
    return Paths(past / remembered, paths.by_command / remembered)


def indi_shape(numbers: Searched, name: str, stated: NominalModel) -> Shape:
    """The gains of INDI: by the tilt's error and the rate; outer loop and observer as they are."""
    per = numbers.damping_s / stiffness_of(stated, name)
    attitude = per * numbers.attitude * numbers.attitude_integral
    return pid_shape(numbers, name, stated)._replace(
        attitude=attitude,
        attitude_integral_1_s=SLOW_1_S * attitude,
        damping_s=per * numbers.attitude,
    )


def indi_filter(numbers: Searched, s: Complex) -> Complex:
    """H, and the sampling of what is fed back."""
    w = numbers.own
    return np.asarray(w * w / (s * s + 2.0 * FILTER_DAMPING * w * s + w * w) / (1.0 + SAMPLED_S * s))


def indi_paths(numbers: Searched, axis: Axis, stated: NominalModel) -> Paths:
    """INDI inside, the shipped outer loop outside."""
    s = 1j * OMEGA_RAD_S
    low_pass, (disc, _) = indi_filter(numbers, s), rotor_model(stated, s)
    paths = paths_of(indi_shape(numbers, axis.name, stated), axis)
    past = paths.past_command.copy()
    past[1] -= numbers.damping_s / stiffness_of(stated, axis.name) * low_pass * s
    remembered = 1.0 - disc * low_pass
    return Paths(past / remembered, paths.by_command / remembered)


# -- the laws inside the plant, for the exact sampled loop ---------------------------------------------------------
class Grown:
    """A plant to which a law's low-passes are appended, and what the law feeds back by itself."""

    def __init__(self, plant: LinearPlant, name: str) -> None:
        self.plant, self.a, self.b, self.cyclic = plant, plant.a, plant.b, INPUTS.index(AXES[name][1])

    def output(self, name: str) -> Array:
        """An output of the plant as a row."""
        return np.append(self.plant.c[OUTPUTS.index(name)], np.zeros(len(self.a) - len(self.plant.a)))

    def low_passed(self, source: Array | None, *sections: tuple[float, float | None]) -> None:
        """Append low-passes one behind another: (rate, None), or (frequency, damping); source None: the cyclic.

        The last state is the output; of a second order the one before is its rate over the frequency.
        """
        for w, damping in sections:
            n, order = len(self.a), 1 if damping is None else 2
            self.a, self.b = np.pad(self.a, ((0, order), (0, order))), np.pad(self.b, ((0, order), (0, 0)))
            if source is None:
                self.b[n, self.cyclic] = w
            else:
                self.a[n, : len(source)] += w * source
            if damping is None:
                self.a[n, n] -= w
            else:
                self.a[n, n], self.a[n, n + 1], self.a[n + 1, n] = -2.0 * damping * w, -w, w
            source = self.state(-1)

    def state(self, index: int) -> Array:
        """One state as a row."""
        return np.eye(len(self.a))[index]

    def closed(self, *fed_back: Array) -> LinearPlant:
        """The plant whose cyclic is the commanded one and the sum of these rows."""
        count = len(self.a)
        row = sum(np.pad(one, (0, count - len(one))) for one in fed_back)
        c = np.pad(self.plant.c, ((0, 0), (0, count - len(self.plant.a))))
        return LinearPlant(self.a + np.outer(self.b[:, self.cyclic], row), self.b, c)


def as_it_is(numbers: Searched, name: str, plant: LinearPlant, stated: NominalModel) -> LinearPlant:
    """A law that is a shape feeds nothing back by itself."""
    return plant


def wind_inside(numbers: Searched, name: str, plant: LinearPlant, stated: NominalModel) -> LinearPlant:
    """The plant with the state of the wind that holds the disc."""
    tilt, rate, velocity, _ = AXES[name][0]
    sign, grown, share = AXES[name][2], Grown(plant, name), numbers.own / GRAVITY_M_S2
    grown.low_passed(None, (stated.servo_rad_s, stated.servo_damping), (stated.flap_rate_1_s, None))
    disc = grown.state(-1)
    grown.low_passed(grown.output(rate), (stated.flap_rate_1_s, None))
    against = grown.state(-1) / stated.flap_rate_1_s
    wide = len(grown.a)
    felt = grown.output(velocity) @ grown.a - sign * GRAVITY_M_S2 * (
        grown.output(tilt) + np.pad(disc, (0, wide - len(disc))) - against
    )
    grown.low_passed(felt, (1.0 / numbers.own_s, None), (1.0 / SAMPLED_S, None))
    return grown.closed(-sign * share * grown.state(-1))


def indi_inside(numbers: Searched, name: str, plant: LinearPlant, stated: NominalModel) -> LinearPlant:
    """The plant with INDI's increment of the cyclic."""
    grown, h = Grown(plant, name), ((1.0 / SAMPLED_S, None), (numbers.own, FILTER_DAMPING))
    grown.low_passed(grown.output(AXES[name][0][1]), *h)
    turning = numbers.own * grown.state(-2)
    grown.low_passed(None, (stated.servo_rad_s, stated.servo_damping), (stated.flap_rate_1_s, None), *h)
    return grown.closed(grown.state(-1), -numbers.damping_s / stiffness_of(stated, name) * turning)


LAWS = (
    Law("observer (shipped)", Searched(*PID_LEAST, *OUTER_LEAST, *UNUSED), Searched(*PID_MOST, *OUTER_MOST, *UNUSED),
        pid_paths, as_it_is, pid_shape, pid_start),
    Law("without the observer", Searched(*PID_LEAST, *OUTER_LEAST[:3], *(1.0, 1.0, 1.0)),
        Searched(*PID_MOST, *OUTER_MOST[:3], *(1.0, 1.0, 1.0)), without_paths, as_it_is, without_shape, pid_start),
    Law("observer, wind state", Searched(*PID_LEAST, *OUTER_LEAST, 0.01, 0.004),
        Searched(*PID_MOST, *OUTER_MOST, 0.95, 0.5), wind_paths, wind_inside, pid_shape, pid_start),
    Law("observer, INDI", Searched(1.0, 0.3, 0.1, *OUTER_LEAST, 4.0, 1.0),
        Searched(25.0, 15.0, 4.0, *OUTER_MOST, 150.0, 1.0), indi_paths, indi_inside, indi_shape, indi_start),
)  # fmt: skip
