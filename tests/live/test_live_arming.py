"""`live --setup` says what keeps a vehicle from arming that no parameter of the table shows."""

from __future__ import annotations

import json

import pytest
from test_live_setup import OURS, ardupilot, px4
from typer.testing import CliRunner

from command import printed
from fake_autopilot import ARDUPILOT, PX4, FakeAutopilot, FakeLink
from flownav.cli import app
from flownav.core.errors import InputError
from flownav.live import byte_links
from flownav.live.link import parse_url
from flownav.live.setup import talk
from flownav.live.setup.arming import NEEDS_ORIGIN, has_no_gps, origin_of
from flownav.live.setup.check import check
from flownav.live.setup.talk import Talk
from flownav.logs.mavlink.framing import Value

PLACE = (47.3977, 8.5456, 489.0)
TOLD = (473977000, 85456000, 489000)
REFUSED = "PreArm: VisOdom: out of memory"
INDOORS = {"GPS1_TYPE": 0} | {f"EK3_SRC1_{what}": number for what, number in OURS.items()}


def checked(make, parameters, set_to=None, send="odometry", **how):
    """The report, and the autopilot afterwards. set_to: an origin that is given."""
    autopilot = FakeAutopilot(make, parameters, **how)
    link = FakeLink(autopilot)
    found = check(Talk(link, clock=link.clock, wait=link.wait), parse_url("udp:14550"), send, origin=set_to)
    return found, autopilot


@pytest.fixture
def answered(monkeypatch):
    """The command line, and an autopilot that answers it on a clock of its own."""

    def run(make, parameters, *options, **how):
        link = FakeLink(FakeAutopilot(make, parameters, **how))
        monkeypatch.setattr(byte_links, "open_link", lambda url: link)
        real = talk.Talk.__init__
        monkeypatch.setattr(
            talk.Talk, "__init__", lambda self, to, **named: real(self, to, clock=link.clock, wait=link.wait, **named)
        )
        return CliRunner().invoke(app, ["live", "udp:0", "--setup", *options])

    return run


def test_without_gps_and_origin_an_ardupilot_does_not_fit():
    """The verdict was "fits", and the vehicle could not be armed."""
    found, _ = checked(ARDUPILOT, ardupilot(**INDOORS))
    assert found.ready.without_gps
    assert found.ready.missing == (NEEDS_ORIGIN,)
    assert not found.fits
    assert found.verdict.endswith("it cannot arm yet")
    assert found.source_set == 1
    assert not found.in_flight  # there is no GPS to switch to


def test_an_origin_that_somebody_set_is_told_and_not_touched():
    found, autopilot = checked(ARDUPILOT, ardupilot(**INDOORS), origin=TOLD)
    assert found.fits
    assert found.ready.origin_deg_m == pytest.approx(PLACE)
    assert autopilot.counts["SET_GPS_GLOBAL_ORIGIN"] == 0


@pytest.mark.parametrize("loss", [0.0, 0.3])
def test_an_origin_that_is_given_is_set_and_read_back(loss):
    found, autopilot = checked(ARDUPILOT, ardupilot(**INDOORS), PLACE, loss=loss)
    assert autopilot.origin == TOLD
    assert found.ready.origin_deg_m == pytest.approx(PLACE)
    assert not found.ready.missing


@pytest.mark.parametrize("how", [{"armed": True}, {"takes_origin": False}])
def test_an_origin_that_is_not_taken_is_said(how):
    found, autopilot = checked(ARDUPILOT, ardupilot(**INDOORS), PLACE, **how)
    assert autopilot.origin is None
    [line] = found.ready.missing
    assert "the origin was not set" in line
    assert not found.fits


def test_with_gps_no_origin_is_asked_of_anybody():
    found, _ = checked(ARDUPILOT, ardupilot())
    assert found.fits
    assert not found.ready.without_gps
    assert not found.ready.missing


def test_px4_needs_none():
    found, _ = checked(PX4, px4(SYS_HAS_GPS=0))
    assert found.ready.without_gps
    assert not found.ready.missing


def test_what_it_says_of_arming_is_passed_on_but_what_flownav_cures():
    says = (REFUSED, "PreArm: VisOdom: not healthy", "Frame: QUAD/PLUS", REFUSED)
    found, _ = checked(ARDUPILOT, ardupilot(), says=says)
    assert found.ready.says == (REFUSED,)
    assert found.as_dict()["autopilot_says"] == (REFUSED,)
    assert not found.fits
    assert found.verdict == "ArduPilot's parameters fit `--send odometry`; it cannot arm yet"


def test_one_that_flies_is_not_told_to_run_its_checks():
    _, autopilot = checked(ARDUPILOT, ardupilot(), armed=True, says=(REFUSED,))
    assert autopilot.counts["COMMAND_LONG"] == 0


COMPASSES_OFF = {"COMPASS_USE": 0, "COMPASS_USE2": 0, "COMPASS_USE3": 0}


@pytest.mark.parametrize(
    ("compass", "needs"),
    [
        ({"COMPASS_ENABLE": 1, "COMPASS_USE": 1}, None),
        ({"COMPASS_ENABLE": 0, "COMPASS_USE": 1}, "COMPASS_ENABLE"),
        ({"COMPASS_ENABLE": 1} | COMPASSES_OFF, "COMPASS_USE"),
        ({"COMPASS_ENABLE": 1} | COMPASSES_OFF | {"COMPASS_USE2": 1}, None),
        ({}, None),
    ],
)
def test_a_heading_by_a_compass_that_is_off_blocks_arming(compass, needs):
    """EK3_SRC1_YAW 1 was "ok", and the vehicle was reported to fit."""
    found, _ = checked(ARDUPILOT, ardupilot(**compass))
    assert found.fits == (needs is None)
    said = [block.says for block in found.blocks]
    assert said == ([f"AHRS: EK3 sources require Compass; {needs} is 0"] * 3 if needs else [])
    assert ("cannot arm" in found.verdict or "arming is blocked" in found.verdict) == (needs is not None)


def test_where_no_set_of_sources_is_on_gps_nobody_is_sent_to_one():
    """It read: Take off on source set 1 (GPS)."""
    sets = {f"EK3_SRC1_{what}": number for what, number in OURS.items()}
    found, _ = checked(ARDUPILOT, ardupilot(**sets, EK3_SRC2_POSXY=0, EK3_SRC2_VELXY=0, EK3_SRC2_VELZ=0))
    [line] = found.in_flight
    assert line.startswith("No source set is on GPS")
    assert "take off on set 1" in line


def test_gps_in_another_set_of_sources_is_named_by_its_own_number():
    """It read: param1 = 1 for flownav, 1 for GPS."""
    sets = {f"EK3_SRC1_{what}": number for what, number in OURS.items()}
    found, _ = checked(ARDUPILOT, ardupilot(**sets, EK3_SRC2_POSXY=3, EK3_SRC2_VELXY=3, EK3_SRC2_VELZ=3))
    [line] = [line for line in found.in_flight if "42007" in line]
    assert f"param1 = {found.source_set} for flownav, {2 if found.source_set == 1 else 1} for GPS" in line


@pytest.mark.parametrize(
    ("make", "values", "without"),
    [
        ("ardupilot", {"GPS1_TYPE": 0.0}, True),
        ("ardupilot", {"GPS_TYPE": 0.0}, True),
        ("ardupilot", {"GPS1_TYPE": 1.0}, False),
        ("px4", {"SYS_HAS_GPS": 0.0, "EKF2_GPS_CTRL": 7.0}, True),
        ("px4", {"SYS_HAS_GPS": 1.0, "EKF2_GPS_CTRL": 7.0}, False),
        ("another", {"GPS1_TYPE": 0.0}, False),
        ("px4", {}, False),
    ],
)
def test_a_vehicle_says_by_its_parameters_that_it_has_no_receiver(make, values, without):
    assert has_no_gps(make, {name: Value(number, 2) for name, number in values.items()}) is without


@pytest.mark.parametrize(
    "text", ["47.4,8.5", "north,8.5,489", "91,8.5,489", "47.4,181,489", "47.4,8.5,9001", "", "1,2,3,4"]
)
def test_a_place_that_is_none_is_refused_in_one_line(text):
    with pytest.raises(InputError) as caught:
        origin_of(text)
    assert f"{text}: LAT,LON,ALT is needed" in printed(caught.value)


def test_the_command_says_what_is_missing_and_ends_with_1(answered):
    result = answered(ARDUPILOT, ardupilot(**INDOORS), says=(REFUSED,))
    words = " ".join(result.output.split())
    assert result.exit_code == 1
    assert "Missing: the EKF has no origin" in words
    assert f"The autopilot says: '{REFUSED}'" in words


def test_the_command_sets_the_origin(answered):
    result = answered(ARDUPILOT, ardupilot(**INDOORS), "--origin", "47.3977,8.5456,489", "--json")
    facts = json.loads(result.output)
    assert result.exit_code == 0
    assert facts["origin_lat_lon_deg_alt_m"] == pytest.approx(PLACE)
    assert facts["without_gps"] is True
    assert facts["missing"] == []


def test_an_origin_goes_with_setup_only():
    result = CliRunner().invoke(app, ["live", "udp:0", "--origin", "47,8,400"])
    assert "--write, --source-set and --origin go with --setup only" in printed(result.exception)
