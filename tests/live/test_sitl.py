"""`flownav sitl` without a simulator: what it refuses, how it scores, what its flow sensor sees, its campaign."""

from __future__ import annotations

import json
import math
import os
from math import cos, pi, sin
from pathlib import Path

import numpy as np
import pytest

from command import run
from flownav.core.errors import InputError
from flownav.live.sitl import campaign
from flownav.live.sitl.campaign import Cell, a_slot, flown, opened, program_of, row_of, tasks_of
from flownav.live.sitl.eyes import LENS_M, Receiver, seen
from flownav.live.sitl.flight import PILOTS, SCENARIOS, Flown, Mark, Order, struck_of
from flownav.live.sitl.pad import sighted
from flownav.live.sitl.pilot import SOURCE_SET, Case
from flownav.live.sitl.score import figures
from flownav.live.sitl.tables import Eyes, faults_of, parameters_of
from flownav.live.sitl.wire import History, Line, SentEstimate, Truth
from flownav.logs.mavlink.framing import ARDUPILOT, coder, name_of
from flownav.logs.mavlink.messages import TrueState
from flownav.logs.mavlink.position_messages import local_position_m

HOME_DEG_M = (47.0, 8.0, 400.0)
DEG_A_METRE_NORTH = 1.0 / 111_170.0  # of latitude at 47 degrees, to 1e-3


@pytest.fixture(autouse=True)
def nothing_installed(monkeypatch, tmp_path):
    """No simulator of whoever runs the tests is found."""
    for name in ("FLOWNAV_ARDUPILOT", "FLOWNAV_PX4"):
        monkeypatch.delenv(name, raising=False)
    monkeypatch.setenv("PATH", str(tmp_path / "no-programs"))


@pytest.fixture
def program(tmp_path):
    """Something that can be run, where a simulator would be."""
    made = tmp_path / "bin" / "arducopter-heli"
    made.parent.mkdir()
    made.write_text("#!/bin/sh\n")
    made.chmod(0o755)
    return made


# -- what is refused ---------------------------------------------------------------------------------------------
@pytest.mark.parametrize(
    ("typed", "says"),
    [
        (("px4", "--vehicle", "heli"), "--vehicle heli: the simulator of px4 flies quad"),
        (("ardupilot", "--vehicle", "quad"), "--vehicle quad: the simulator of ardupilot flies heli and copter"),
        (("px4", "--wind", "8"), "--wind: PX4's SIH has no wind"),
        (("px4", "--scenario", "pad"), "--scenario pad: is flown by ardupilot alone"),
        (("ardupilot",), "arducopter-heli is not found: build it in ArduPilot's source"),
        (("px4",), "px4 is not found: build it in PX4's source: `make px4_sitl_default`"),
        (("ardupilot", "--binary", "nothing"), "--binary nothing: no program is there; build it"),
    ],
)
def test_what_cannot_be_flown_is_said_in_one_line(typed, says, tmp_path):
    done = run("sitl", *typed, cwd=tmp_path, columns="400")
    assert done.returncode == 2
    assert says in done.stderr
    assert len(done.stderr.strip().splitlines()) == 1


@pytest.mark.parametrize(
    ("faults", "says"),
    [
        (("thunder@3",), "--fault thunder: this simulator has gps-glitch, "),
        (("flow-loss@x",), "--fault flow-loss@x: NAME@T or NAME@T+S is needed"),
        (("flow-loss@-1",), "--fault flow-loss@-1: NAME@T"),
        (("flow-loss@1+nan",), "--fault flow-loss@1+nan: NAME@T"),
        (("all@5", "flow-loss@5"), "--fault all: is every fault"),
    ],
)
def test_a_fault_that_is_none_is_refused(faults, says, program, tmp_path):
    typed = [word for fault in faults for word in ("--fault", fault)]
    done = run("sitl", "ardupilot", "--binary", program, "--out", tmp_path / "out", *typed, columns="900")
    assert done.returncode == 2
    assert says in done.stderr
    assert not (tmp_path / "out").exists()


def test_a_program_is_found_by_option_environment_and_path(program, monkeypatch):
    assert program_of("ardupilot", "heli", program) == program
    for told in (program, program.parent):
        monkeypatch.setenv("FLOWNAV_ARDUPILOT", str(told))
        assert program_of("ardupilot", "heli", None) == program
    with pytest.raises(InputError, match="no arducopter is there"):
        program_of("ardupilot", "copter", None)
    monkeypatch.delenv("FLOWNAV_ARDUPILOT")
    monkeypatch.setenv("PATH", str(program.parent))
    assert program_of("ardupilot", "heli", None) == program


def test_a_folder_of_other_flights_is_left_alone(tmp_path):
    opened(tmp_path / "out", {"vehicle": "heli", "flights": 1})
    opened(tmp_path / "out", {"vehicle": "heli", "flights": 3})  # more of the same
    with pytest.raises(InputError, match="holds other flights"):
        opened(tmp_path / "out", {"vehicle": "copter", "flights": 3})
    (tmp_path / "mine").mkdir()
    (tmp_path / "mine" / "thesis.tex").write_text("years")
    with pytest.raises(InputError, match="holds no flights"):
        opened(tmp_path / "mine", {"vehicle": "heli", "flights": 1})
    assert (tmp_path / "mine" / "thesis.tex").read_text() == "years"


def test_flights_beside_each_other_have_slots_of_their_own(tmp_path, monkeypatch):
    monkeypatch.setattr(campaign, "gettempdir", lambda: str(tmp_path))
    with a_slot() as first, a_slot() as second:
        assert (first, second) == (campaign.FIRST_SLOT, campaign.FIRST_SLOT + 1)
    with a_slot() as again:
        assert again == first
    monkeypatch.setattr(campaign, "MOST_SLOT", campaign.FIRST_SLOT)
    with a_slot(), pytest.raises(InputError, match="already fly on this machine"), a_slot():
        pass


def test_a_lock_of_another_user_is_locked_by_reading_and_nothing_is_led_elsewhere(tmp_path, monkeypatch):
    """In a folder that all share (/tmp) Linux lets nobody make another's file again, nor write to it."""
    monkeypatch.setattr(campaign, "gettempdir", lambda: str(tmp_path))
    lock = tmp_path / f"flownav-sitl-{campaign.FIRST_SLOT}.lock"
    lock.touch(0o444)
    asked = []
    opens = os.open

    def opened_so(path, flags, mode=0o777):
        asked.append(flags)
        return opens(path, flags, mode)

    monkeypatch.setattr(campaign.os, "open", opened_so)
    with a_slot() as first, a_slot() as second:
        assert (first, second) == (campaign.FIRST_SLOT, campaign.FIRST_SLOT + 1)
    assert not any(flags & (os.O_WRONLY | os.O_RDWR) for flags in asked)
    assert not asked[0] & os.O_CREAT
    lock.unlink()
    lock.symlink_to(tmp_path / "somewhere")
    with pytest.raises(InputError, match=r"flownav-sitl-1.lock: cannot be locked .*; remove it, or"):
        a_slot().__enter__()
    assert not (tmp_path / "somewhere").exists()


# -- its tables --------------------------------------------------------------------------------------------------
@pytest.mark.parametrize("make", PILOTS)
def test_every_fault_does_something_and_ends(make):
    for name, fault in faults_of(make).items():
        assert fault.says
        assert name == name.lower()
        assert fault.on or fault.loss or fault.freeze_s or fault.restart or fault.eyes, name
        assert fault.parameters(on=False).keys() == fault.on.keys()
        assert all(fault.parameters(on=False)[key] != value for key, value in fault.on.items()), name
        assert struck_of(name, faults_of(make)) == (name, 10.0, fault.lasts_s)
    assert struck_of("flow-loss@3+2.5", faults_of(make)) == ("flow-loss", 3.0, 2.5)


@pytest.mark.parametrize("gps", ["on", "cut", "never"])
def test_without_gps_there_is_none(gps):
    assert (parameters_of("ardupilot", "heli", gps).get("SIM_GPS_DISABLE", 0) == 1) == (gps == "never")
    assert (parameters_of("px4", "quad", gps).get("SYS_HAS_GPS", 1) == 0) == (gps == "never")
    assert "COMPASS_OFS_X" in parameters_of("ardupilot", "heli", gps)
    assert "COMPASS_OFS_X" not in parameters_of("ardupilot", "copter", gps)


class Autopilot:
    """As much of ArduPilot as sets parameters and switches sources: a wire to it. switched: its parameters then."""

    def __init__(self, parameters):
        self.parameters, self.switched, self.received = dict(parameters), [], []
        self.mav, self.history = coder(), History()
        self.latest = {"HEARTBEAT": self.mav.heartbeat_encode(2, ARDUPILOT, 0, 0, 4, 3)}

    def say(self, message):
        kind = message.msgname
        if kind in ("PARAM_REQUEST_READ", "PARAM_SET"):
            if kind == "PARAM_SET":
                self.parameters[name_of(message)] = message.param_value
            name = name_of(message)
            answer = self.mav.param_value_encode(name.encode(), self.parameters[name], 2, 1, 0)
        else:
            assert (kind, message.command) == ("COMMAND_LONG", SOURCE_SET)
            self.switched.append((message.param1, dict(self.parameters)))
            answer = self.mav.command_ack_encode(SOURCE_SET, 0)
        for hear in self.received:
            hear(answer)

    def until(self, true, _limit_s):
        return true()


@pytest.mark.parametrize("gps", ["on", "cut"])
def test_the_source_set_is_flownavs_when_it_is_switched_to(gps):
    """At its first start an ArduPilot with a flow sensor writes optical flow (5) into its second set of sources."""
    wanted = parameters_of("ardupilot", "copter", gps)
    sources = {name for name in wanted if name.startswith("EK3_SRC2_")}
    assert wanted["EK3_SRC2_VELXY"] == 6.0  # external navigation
    pilot = object.__new__(PILOTS["ardupilot"])
    pilot.case, pilot.slot, pilot._acks, pilot._values = Case("copter", gps), 1, {}, {}
    pilot.wire = Autopilot({name: 5.0 for name in sources})
    pilot.wire.received.append(pilot._received)
    pilot.fly_on_flownav()
    ((number, then),) = pilot.wire.switched
    assert number == 2.0
    assert then == {name: wanted[name] for name in sources}


@pytest.mark.parametrize("make", PILOTS)
def test_a_simulator_in_its_own_folder_finds_what_was_told_relative(make, tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    monkeypatch.setattr(PILOTS[make], "connected", lambda _: History())
    monkeypatch.setattr(History, "received", [], raising=False)
    monkeypatch.setattr(History, "beats", [], raising=False)
    case = Case(PILOTS[make].vehicles[0], "cut")
    pilot = PILOTS[make](Path("bin/program"), Path("out/flight"), 1, case)
    assert (pilot.binary, pilot.folder) == (tmp_path / "bin" / "program", tmp_path / "out" / "flight")


# -- scoring -----------------------------------------------------------------------------------------------------
def state(north_m=0.0, down_m=-5.0, quaternion=(1.0, 0.0, 0.0, 0.0), vel=(0.0, 0.0, 0.0), rate=(0.0, 0.0, 0.0)):
    lat_deg, lon_deg, alt_m = HOME_DEG_M
    return TrueState((lat_deg + north_m * DEG_A_METRE_NORTH, lon_deg, alt_m - down_m), vel, quaternion, rate)


def a_flight(told_north_m, resets=lambda t_s: 0, true_north_m=lambda t_s: 0.0, gps="cut", end_down_m=0.0):
    """A hover of 30 s at 5 m, in which flownav says where it is as `told_north_m` has it (None: nothing)."""
    history = History()
    history.truth = [Truth(0.0, state(down_m=0.0))]
    history.truth += [Truth(t_s, state(true_north_m(t_s))) for t_s in np.arange(5.0, 40.0, 0.05)]
    history.truth.append(Truth(41.0, state(true_north_m(40.0), end_down_m)))
    history.estimates = [
        SentEstimate(t_s, t_s, (told_north_m(t_s), 0.0, -5.0), 80, resets(t_s))
        for t_s in np.arange(8.0, 40.0, 0.1)
        if told_north_m(t_s) is not None
    ]
    marks = tuple(Mark(*each) for each in (("start", 0.0), ("hover", 10.0), ("land", 40.0), ("end", 41.0)))
    order = Order("ardupilot", "hover", Case("heli", gps))
    return figures(Flown(order, history, marks, ((0.0, 0.0),), HOME_DEG_M, True, "", ()))


def test_a_flight_on_the_truth_has_no_error():
    found = a_flight(lambda t_s: 0.0)
    assert found["landed"]
    assert found["touchdown_m"] == found["hover_rms_m"] == 0.0
    assert found["error_m"] < 1e-9
    assert found["unsaid_s"] == 0.0
    assert found["resets"] == 0
    assert found["silent_s"] == pytest.approx(1.1, abs=0.11)  # from the last estimate to the end


def test_a_vehicle_that_follows_a_wrong_estimate_is_where_it_is():
    found = a_flight(lambda t_s: 0.0, true_north_m=lambda t_s: max(0.0, 0.1 * (t_s - 10.0)))
    assert found["touchdown_m"] == pytest.approx(3.0, rel=2e-3)
    assert found["hover_rms_m"] == pytest.approx(3.0 / 3.0**0.5, rel=1e-2)
    assert found["error_m"] == pytest.approx(3.0, rel=1e-2)
    assert found["unsaid_s"] == pytest.approx(20.0, abs=0.3)  # beyond 1 m from 20 s on


def test_what_gps_was_off_by_is_not_the_estimates_unless_there_is_none():
    assert a_flight(lambda t_s: 2.0)["error_m"] < 1e-9
    assert a_flight(lambda t_s: 2.0, gps="never")["error_m"] == pytest.approx(2.0)


def test_a_jump_that_is_counted_is_said_and_one_that_is_not_is_wrong():
    def jumps(t_s):
        return 0.0 if t_s < 20.0 else 4.0

    assert a_flight(jumps, resets=lambda t_s: int(t_s >= 20.0))["error_m"] < 1e-9
    unsaid = a_flight(jumps)
    assert unsaid["error_m"] == pytest.approx(4.0)
    assert unsaid["unsaid_s"] == pytest.approx(20.0, abs=0.3)


def test_silence_is_no_wrong_estimate():
    found = a_flight(lambda t_s: None if 15.0 < t_s < 25.0 else 0.0)
    assert found["silent_s"] == pytest.approx(10.0, abs=0.2)
    assert found["unsaid_s"] == 0.0


def test_the_floor_is_what_the_noise_of_the_flow_integrates_to():
    """Readings of the stated noise, added up: the rms of many hovers of 30 s at 5 m is what the figure says."""
    found = a_flight(lambda t_s: 0.0)
    assert found["height_m"] == pytest.approx(5.0, abs=1e-3)
    chance = np.random.default_rng(4)
    speeds = 5.0 * chance.uniform(-0.05, 0.05, (2000, 300, 2))
    drifts = np.cumsum(0.1 * speeds, axis=1)
    assert found["floor_m"] == pytest.approx(math.sqrt((drifts**2).sum(axis=2).mean()), rel=0.05)


def test_landed_is_on_the_ground_and_upright():
    assert not a_flight(lambda t_s: 0.0, end_down_m=-2.0)["landed"]
    assert a_flight(lambda t_s: 0.0, end_down_m=-0.2)["landed"]


def test_a_row_says_median_and_worst():
    flights = [
        {"landed": n != 2, "why": "", "touchdown_m": None if n == 2 else float(n), "error_m": n} for n in range(4)
    ]
    row = row_of("cell", flights)
    assert (row["landed"], row["flights"], row["touchdown_r95_m"]) == (3, 4, 3.0)
    assert row["error_m"] == {"median": 1.5, "worst": 3.0}
    assert row["hover_rms_m"] is None


# -- the campaign ------------------------------------------------------------------------------------------------
def test_what_was_flown_is_not_flown_again(tmp_path, monkeypatch):
    flew = []

    def fly_one(task):
        flew.append(task.number)
        task.path.parent.mkdir(parents=True)
        task.path.write_text(json.dumps({"landed": True}))
        return {"landed": True}

    monkeypatch.setattr(campaign, "_one", fly_one)
    orders = tuple(Order("ardupilot", "hover", Case("heli", "cut", seed=n)) for n in range(3))
    steps: list[int] = []
    for count in (2, 3):
        tasks = tasks_of([Cell("heli", orders[:count])], tmp_path / "program", tmp_path)
        assert len(list(flown(tasks, 1, steps.append))) == count
    assert flew == [0, 1, 2]
    assert len(steps) == 5


@pytest.mark.parametrize("content", ["", "{", "[]", "[" * 100_000, "{}", '{"why": ""}'])
def test_damaged_figures_and_a_damaged_plan_are_one_line(tmp_path, content):
    orders = (Order("ardupilot", "hover", Case("heli", "cut", seed=1)),)
    (task,) = tasks_of([Cell("heli", orders)], tmp_path / "program", tmp_path)
    task.path.parent.mkdir(parents=True)
    task.path.write_text(content)
    with pytest.raises(InputError, match=r"flight.json: .*; remove it, and the flight is flown again"):
        list(flown([task], 1, lambda done: None))
    (tmp_path / "out").mkdir()
    (tmp_path / "out" / campaign.PLAN).write_text(content)
    with pytest.raises(InputError, match="give another name, or move it away"):
        opened(tmp_path / "out", {"vehicle": "heli", "flights": 1})


def test_the_line_loses_what_it_is_told_to_lose():
    line = Line(seed=3)
    assert all(line.passes() for _ in range(100))
    line.loss = 0.3
    assert sum(line.passes() for _ in range(10_000)) == pytest.approx(7000, abs=5 * (10_000 * 0.21) ** 0.5)
    line.loss = 1.0
    assert not any(line.passes() for _ in range(100))


# -- the flow sensor that SIH lacks ------------------------------------------------------------------------------
def test_flow_of_level_flight_is_speed_over_height():
    """Forward looks like a nose that comes up, rightward like a roll to the left."""
    x, y, *_ = seen(state(down_m=-4.9, vel=(2.0, 0.5, 0.0)), HOME_DEG_M[2])
    height_m = 4.9 + LENS_M
    assert (x, y) == pytest.approx((-0.5 / height_m, 2.0 / height_m))


def test_flow_of_turning_alone_is_the_turning():
    """MAVLink's convention: the flow of a pure rotation is the gyro's own."""
    found = seen(state(rate=(0.3, -0.2, 0.5)), HOME_DEG_M[2])
    assert found == pytest.approx((0.3, -0.2, 0.3, -0.2, 0.5))


def test_a_tilted_sensor_looks_farther():
    half = 0.5 * 20.0 * pi / 180.0
    level = seen(state(vel=(1.0, 0.0, 0.0)), HOME_DEG_M[2])
    rolled = seen(state(vel=(1.0, 0.0, 0.0), quaternion=(cos(half), sin(half), 0.0, 0.0)), HOME_DEG_M[2])
    assert rolled[1] / level[1] == pytest.approx(cos(2.0 * half))


# -- the second receiver of GPS ------------------------------------------------------------------------------------
class Listener:
    """A wire on which the truth is known, and messages are kept."""

    def __init__(self, true: TrueState):
        self.history, self.turns, self.said = History(), [], []
        self.history.truth = [Truth(3.0, true)]

    def say(self, message, _mav):
        self.said.append(message)


def test_a_second_receiver_speaks_only_while_it_is_off_and_is_off_by_so_much():
    wire = Listener(state(vel=(1.5, -2.0, 0.25)))
    receiver = Receiver(wire, 2)
    receiver.turn(0.0)
    assert wire.said == []
    receiver.state = Eyes(gps_north_m=20.0)
    for now_s in (0.0, 0.1, 0.25):
        receiver.turn(now_s)
    told, _ = wire.said  # five times a second
    north, east, down = local_position_m((told.lat * 1e-7, told.lon * 1e-7, told.alt * 1e-3), state().position_deg_m)
    assert (north, east, down) == pytest.approx((20.0, 0.0, 0.0), abs=0.02)
    assert (told.vn, told.ve, told.vd, told.vel, told.fix_type) == (150, -200, 25, 250, 3)
    assert told.cog == pytest.approx(30687, abs=1)


# -- the pad's camera ----------------------------------------------------------------------------------------------
def test_a_pad_ahead_is_ahead_and_one_beside_the_picture_is_not_seen():
    pad = HOME_DEG_M
    forward, right, distance_m = sighted(state(north_m=-1.0, down_m=-4.0), pad)
    assert (forward, right) == pytest.approx((0.25, 0.0), abs=1e-3)
    assert distance_m == pytest.approx(17.0**0.5, rel=1e-3)
    half = 0.25 * pi  # facing east, so that what is north is to the left
    turned = sighted(state(north_m=-1.0, down_m=-4.0, quaternion=(cos(half), 0.0, 0.0, sin(half))), pad)
    assert turned[:2] == pytest.approx((0.0, -0.25), abs=1e-3)
    assert sighted(state(north_m=-3.0, down_m=-4.0), pad) is None
    assert sighted(state(down_m=-0.1), pad) is None


def test_only_a_flight_onto_a_pad_asks_for_precision_landing():
    assert "PLND_ENABLED" in parameters_of("ardupilot", "copter", "cut", pad=True)
    assert "PLND_ENABLED" not in parameters_of("ardupilot", "copter", "cut")


# -- in the loop, where a simulator is named ---------------------------------------------------------------------
def test_scenarios_say_what_they_are():
    assert {name for name, each in SCENARIOS.items() if each.gps == "never"} == {"indoor"}
    assert all(each.says for each in SCENARIOS.values())


NAMED = {name: os.environ.get(name) for name in ("FLOWNAV_ARDUPILOT", "FLOWNAV_PX4")}


@pytest.mark.real_time
@pytest.mark.parametrize(("make", "variable"), [("ardupilot", "FLOWNAV_ARDUPILOT"), ("px4", "FLOWNAV_PX4")])
def test_a_real_autopilot_lands_without_gps(make, variable, tmp_path, monkeypatch):
    if not NAMED[variable]:
        pytest.skip(f"{variable} names no simulator")
    monkeypatch.setenv(variable, NAMED[variable])
    monkeypatch.setenv("PATH", os.defpath)
    done = run("sitl", make, "--scenario", "land", "--out", tmp_path / "out", "--json")
    assert done.returncode == 0, done.stderr
    (row,) = json.loads(done.stdout)["rows"]
    assert row["landed"] == 1
    assert row["touchdown_r95_m"] < 1.5


# -- the autopilot's own log ---------------------------------------------------------------------------------------
@pytest.mark.parametrize(("make", "where"), [("ardupilot", "logs/{}.BIN"), ("px4", "log/2026-01-01/{}.ulg")])
def test_the_longest_log_of_the_autopilot_is_kept(make, where, tmp_path):
    simulator, kept = tmp_path / "simulator", tmp_path / "kept"
    kept.mkdir()
    for name, size in (("00000001", 10), ("00000002", 500)):
        path = simulator / where.format(name)
        path.parent.mkdir(parents=True, exist_ok=True)
        path.write_bytes(bytes(size))
    pilot = object.__new__(PILOTS[make])
    pilot.folder = simulator
    pilot.keep_log(kept)
    (found,) = kept.iterdir()
    assert found.name == "autopilot" + path.suffix.lower()
    assert found.stat().st_size == 500
