"""Parts of somebody else's fly on the compiled loop as ours do: axioms, and every mistake reported in one line."""

from __future__ import annotations

import itertools

import numpy as np
import pytest

import flownav.parts.protocols as own
from flownav.api.flying import fly
from flownav.api.replaying import replay
from flownav.core.errors import InputError
from flownav.core.measurement import Sensor
from flownav.core.record import QUATERNION
from flownav.parts.examples.complementary import ComplementaryFilter
from flownav.parts.examples.pd_controller import PdController
from flownav.simulation.assemble import assemble
from flownav.simulation.scenario import load_scenario
from flownav.vehicle.helicopter import derivative, outputs
from flownav.vehicle.kinds import read_vehicle
from flownav.vehicle.parameters import flatten
from flownav.vehicle.state import HelicopterState

SHORT = {"duration_s": 6.0}
RIGID = 13


class Perfect:
    """A range that reads what is so, over level ground."""

    sensor = Sensor.RANGE

    def start(self, seed, flight):
        self.began = seed, flight

    def read(self, truth):
        down = 1.0 - 2.0 * (truth.quaternion[1] ** 2 + truth.quaternion[2] ** 2)
        return own.Values([-truth.pos_ned_m[2] / down])


class Shipped:
    """The shipped helicopter, its equations called from Python."""

    def start(self, rigid):
        self.vehicle = flatten(read_vehicle(None))
        rest = assemble(load_scenario("landing")).flight.plan.start[RIGID:]  # servos and inflow of trimmed hover
        return np.concatenate([rigid, rest])

    def derivative(self, t_s, state, controls, around):
        return np.array(derivative(HelicopterState(*state), controls, around, self.vehicle))

    def outputs(self, t_s, state, controls, around):
        seen = outputs(HelicopterState(*state), around, self.vehicle)
        return own.Outputs(seen.thrust_n, seen.contact_force_n, seen.power_w)


def test_a_filter_flies_in_closed_loop_and_the_same_flight_twice_is_the_same_bytes():
    first, second = (fly("landing", filter=ComplementaryFilter, flight=SHORT) for _ in range(2))
    assert first.manifest["filter"] == "complementary"
    for name, column in first.tables["estimate"].items():
        np.testing.assert_array_equal(column, second.tables["estimate"][name])
    ours = fly("landing", flight=SHORT)
    assert np.abs(ours.tables["truth"]["pos_n_m"] - first.tables["truth"]["pos_n_m"]).max() > 1e-6, "it did not fly"


def test_the_record_of_a_flight_replays_through_the_same_filter_to_the_same_bits(tmp_path):
    flown = fly("pad_return", filter=ComplementaryFilter(), flight=SHORT)
    flown.save(tmp_path / "own.fnr")
    again = replay(tmp_path / "own.fnr", filter=ComplementaryFilter)
    for name in ("pos_n_m", "pos_e_m", "pos_d_m", "vel_u_m_s", *QUATERNION):
        np.testing.assert_array_equal(again.tables["estimate"][name], flown.tables["estimate"][name])


def test_a_sensor_reads_the_truth_of_the_instant_that_it_describes_and_the_record_keeps_what_it_read():
    flown = fly("pad_return", sensors=[Perfect], flight=SHORT)
    fed = flown.tables["fed"]
    pings = fed["sensor"] == Sensor.RANGE
    assert np.count_nonzero(pings) > 20
    truth = flown.tables["truth"]
    height_m = -np.interp(fed["t_s"][pings], truth["t_s"], truth["pos_d_m"])
    read_m = fed["value_0"][pings]
    tilt = 1.0 - 2.0 * (np.interp(fed["t_s"][pings], truth["t_s"], truth["qx"]) ** 2
                        + np.interp(fed["t_s"][pings], truth["t_s"], truth["qy"]) ** 2)  # fmt: skip
    np.testing.assert_allclose(read_m, height_m / tilt, atol=2e-3)


def test_a_sensor_that_stays_silent_has_not_arrived():
    class Silent(Perfect):
        def read(self, truth):
            return None

    flown = fly("pad_return", sensors=[Silent], flight=SHORT)
    fed = flown.tables["fed"]
    assert not fed["arrived"][fed["sensor"] == Sensor.RANGE].any()


def test_the_shipped_helicopter_as_a_part_flies_as_the_compiled_one_does():
    """The compiled one refines its inflow where this one solves it anew: 1e-9 a step (simulation/plant.py)."""
    flight = {"duration_s": 2.0}
    ours = fly("landing", flight=flight).tables["truth"]
    theirs = fly("landing", vehicle=Shipped, flight=flight).tables["truth"]
    for name in ("pos_n_m", "pos_e_m", "pos_d_m", "vel_u_m_s", "vel_v_m_s", "vel_w_m_s", *QUATERNION):
        np.testing.assert_allclose(theirs[name], ours[name], atol=2e-5, err_msg=name)
    np.testing.assert_allclose(theirs["thrust_n"], ours["thrust_n"], rtol=1e-4)


def test_a_controller_gives_the_controls_and_holds_the_vehicle_on_its_path():
    flown = fly("landing", controller=PdController, flight={"duration_s": 12.0}, autopilot="truth",
                wind={"speed_20ft_m_s": 0.0})  # fmt: skip
    truth, command = flown.tables["truth"], flown.tables["command"]
    off_m = np.hypot(truth["pos_n_m"] - command["pos_n_ref_m"], truth["pos_e_m"] - command["pos_e_ref_m"])
    assert off_m.max() < 2.0
    assert flown.manifest["parts"] == {"controller": "pd"}


class Raises(ComplementaryFilter):
    """After a second."""

    def update(self, reading):
        if reading.t_s > 1.0:
            raise ValueError("no such gain")
        super().update(reading)


class NoRotation(ComplementaryFilter):
    def estimate(self):
        said = super().estimate()
        return said and said._replace(quaternion=[1.0, 1.0, 0.0, 0.0])


class TooShort(ComplementaryFilter):
    def estimate(self):
        said = super().estimate()
        return said and said._replace(pos_ned_m=[0.0, 0.0])


class NotFinite(ComplementaryFilter):
    def estimate(self):
        said = super().estimate()
        return said and said._replace(vel_ned_m_s=[0.0, np.nan, 0.0])


class SaysNothing(ComplementaryFilter):
    name = "silent"

    def estimate(self):
        return None


class SpeaksLate(ComplementaryFilter):
    name = "late"

    def estimate(self):
        return super().estimate() if self.t_s > 5.5 else None


class NoNumber(ComplementaryFilter):
    def update(self, reading):
        super().update(reading)
        return [own.Innovation(np.nan, 1.0)]


class NoGround(ComplementaryFilter):
    def estimate(self):
        said = super().estimate()
        return said and said._replace(ground_d_m=np.nan)


class NeedsMore(ComplementaryFilter):
    name = "needy"

    def __init__(self, gain):
        self.gain = gain


class StartsBadly(ComplementaryFilter):
    def start(self, told):
        raise ValueError("no such gain")


class TooFar(ComplementaryFilter):
    def estimate(self):
        said = super().estimate()
        return said and said._replace(std_pos_ned_m=[1e300, 0.0, 0.0])


class Endless(ComplementaryFilter):
    def estimate(self):
        said = super().estimate()
        return said and said._replace(pos_ned_m=itertools.count())


class TooMuch(ComplementaryFilter):
    def update(self, reading):
        raise MemoryError


class Deep(ComplementaryFilter):
    def update(self, reading):
        return self.update(reading)


class Unspeakable(Exception):
    def __str__(self):
        raise RuntimeError("not even this")


class CannotSay(ComplementaryFilter):
    def update(self, reading):
        raise Unspeakable


class Talks(ComplementaryFilter):
    name = "two\nlines \x1b[31m" + "x" * 200

    def update(self, reading):
        raise ValueError("begins" + "\n" * 500 + "x" * 5000 + " ends")


class SensorStartsBadly(Perfect):
    def start(self, seed, flight):
        raise ValueError("no such gain")


class ControllerStartsBadly(PdController):
    def start(self, gains):
        raise ValueError("no such gain")


class Leaves(ComplementaryFilter):
    def update(self, reading):
        raise SystemExit(0)


class ReadsNaN(Perfect):
    def read(self, truth):
        return own.Values([np.nan])


class OneVariance(Perfect):
    def read(self, truth):
        return own.Values([1.0], variance=[1.0])


class TooGood(Perfect):
    def read(self, truth):
        return own.Values([1.0], quality=1e9)


class OfNothing(Perfect):
    sensor = "LIDAR"


class NoThrust(Shipped):
    def outputs(self, t_s, state, controls, around):
        return own.Outputs(np.nan, 0.0, 0.0)


class TwoValues(Perfect):
    def read(self, truth):
        return own.Values([1.0, 2.0])


class OfPad(Perfect):
    sensor = Sensor.PAD


class OfImu(Perfect):
    sensor = Sensor.IMU


class Shrinks(Shipped):
    def derivative(self, t_s, state, controls, around):
        return np.zeros(13)


class ThreeAngles(PdController):
    def command(self, t_s, flown, reference, *, flying):
        return (0.0, 0.0, 0.0)


@pytest.mark.parametrize(
    ("parts", "words"),
    [
        ({"filter": Raises}, r"filter complementary: ValueError: no such gain; mend it"),
        ({"filter": NoRotation}, r"complementary: estimate\(\).quaternion has length 1.414, not 1"),
        ({"filter": TooShort}, r"complementary: estimate\(\).pos_ned_m has shape \(2,\); \(3,\) is needed"),
        ({"filter": NotFinite}, r"complementary: estimate\(\).vel_ned_m_s is not finite"),
        ({"sensors": [TwoValues]}, r"sensor TwoValues: read\(\) gave 2 values; RANGE has range_m"),
        ({"sensors": [OfPad]}, r"sensors: the scenario's vehicle carries no PAD to be replaced"),
        ({"sensors": [OfImu]}, r"sensors: one of a kind can be replaced, and the IMU cannot"),
        ({"sensors": [Perfect, Perfect]}, r"sensors: one of a kind can be replaced"),
        ({"vehicle": Shrinks}, r"vehicle Shrinks: derivative\(\) gave shape \(13,\)"),
        ({"controller": ThreeAngles}, r"controller pd: command\(\) gave \(0.0, 0.0, 0.0\); four finite angles"),
        ({"filter": SaysNothing}, r"filter silent: never gave an estimate, and the autopilot uses it from 5 s on"),
        (
            {"filter": SpeaksLate},
            r"filter late: gave its first estimate at 5\.\d+ s, and the autopilot uses it from 5 s on",
        ),
        ({"filter": NoNumber}, r"complementary: update\(\) gave an innovation of nan with variance 1.0"),
        ({"filter": NoGround}, r"complementary: estimate\(\).ground_d_m is \[nan\]"),
        ({"filter": NeedsMore}, r"needy: cannot be made: TypeError: .*gain"),
        ({"filter": StartsBadly}, r"filter complementary: ValueError: no such gain; mend it"),
        ({"sensors": [SensorStartsBadly]}, r"sensor SensorStartsBadly: ValueError: no such gain; mend it"),
        ({"controller": ControllerStartsBadly}, r"controller pd: ValueError: no such gain; mend it"),
        ({"filter": TooFar}, r"complementary: estimate\(\).std_pos_ned_m is beyond 1e\+09: \[1e\+300, 0.0, 0.0\]"),
        ({"filter": Endless}, r"complementary: estimate\(\).pos_ned_m has shape \(4,\); \(3,\) is needed"),
        ({"filter": TooMuch}, r"filter complementary: MemoryError; mend it"),
        ({"filter": Deep}, r"filter complementary: RecursionError: maximum recursion depth exceeded"),
        ({"filter": CannotSay}, r"filter complementary: Unspeakable; mend it"),
        ({"filter": Talks}, r"^filter two lines \[31mx+: ValueError: begins x+ \.\.\. x+ ends; mend it"),
        ({"filter": Leaves}, r"filter complementary: SystemExit: 0; mend it"),
        ({"sensors": [ReadsNaN]}, r"sensor ReadsNaN: read\(\) gave \(nan,\); finite values, or None"),
        ({"sensors": [OneVariance]}, r"sensor OneVariance: variance \(1.0,\): three"),
        ({"sensors": [TooGood]}, r"sensor TooGood: quality 1000000000.0: 0 \(no data\) to 255"),
        ({"sensors": [OfNothing]}, r"sensor OfNothing: sensor = 'LIDAR'; one of GPS_POSITION, "),
        ({"vehicle": NoThrust}, r"vehicle NoThrust: outputs\(\) gave \(nan, 0.0, 0.0\)"),
        ({"filter": object()}, r"filter object: has no start, predict, update, estimate"),
        ({"filter": "nobody"}, r"--filter nobody: no such filter"),
        ({"filter": "nowhere.py:Mine"}, r"nowhere.py: no such file"),
    ],
)
def test_mistakes_are_told_in_one_line(parts, words):
    with pytest.raises(InputError, match=words) as told:
        fly("landing", flight=SHORT, **parts)
    assert "\n" not in str(told.value)


class Grows(ComplementaryFilter):
    """Innovations without end."""

    def update(self, reading):
        super().update(reading)
        return (own.Innovation(0.1, 1.0) for _ in itertools.count())


def test_innovations_without_end_end_where_the_record_has_room_for_no_more():
    flown = fly("landing", filter=Grows, flight=SHORT)
    assert flown.manifest["scores"]["max_position_error_m"] < 10.0


def test_the_papers_filter_takes_no_parts():
    with pytest.raises(InputError, match='filter = "paper" takes no parts'):
        fly("landing", sensors=[Perfect], **{"filter": "paper", "flight": SHORT})
