"""An unknown argument of a call is one line that names it and the valid ones, and never Python's own complaint."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest

import flownav
from flownav.api.arguments import checked
from flownav.core.errors import MOST_LETTERS, FlownavError, InputError
from replay_logs import log_of_flight
from rig_logs import swing

BEYOND = 10**400
NUMBER, WHOLE, PATH, LIST = "a number", "a whole number", "a path", "a list"


@pytest.fixture(scope="module")
def log(tmp_path_factory):
    return log_of_flight(12.0).write(tmp_path_factory.mktemp("log") / "garden")


@pytest.fixture(scope="module")
def rig(tmp_path_factory):
    return swing(tmp_path_factory.mktemp("rig") / "swing.csv", gain=0.9, delay_s=0.08)


def said(call, *arguments, **options):
    with pytest.raises(InputError) as raised:
        call(*arguments, **options)
    assert "\n" not in str(raised.value)
    return str(raised.value)


@pytest.mark.parametrize("wrong", [None, 5, b"x", (), {}, object(), np.zeros(3), type])
def test_a_path_is_a_path(wrong, log):
    record_less = (flownav.load, flownav.Scenario.load, flownav.Sensor.load, flownav.Vehicle.load, flownav.replay)
    for call in record_less:
        assert said(call, wrong).endswith("is given; a path is needed")
    for thing in (flownav.Scenario.load("landing"), flownav.Sensor.load(), flownav.Vehicle.load()):
        assert said(thing.save, wrong).endswith("is given; a path is needed")


@pytest.mark.parametrize(
    ("option", "wrong", "needed"),
    [
        ("gps_outages", 5, LIST),
        ("gps_outages", {"a": 1}, LIST),
        ("flow", np.zeros(3), "True or False"),
        ("flow_scale", 5, "2 numbers"),
        ("flow_scale", (1.0,), "2 numbers"),
        ("flow_scale", "x", "2 numbers"),
        ("flow_scale", (1.0, None), "2 numbers"),
        ("gps_delay_s", None, NUMBER),
        ("gps_delay_s", True, NUMBER),
        ("gps_delay_s", BEYOND, NUMBER),
        ("sensor", 5, "a path or a Sensor"),
        ("settings", 5, "a path or a mapping by names"),
        ("settings", {1: 2}, "a path or a mapping by names"),
        ("smooth", 1, "True or False"),
        ("outage_table", 5, "3 numbers"),
        ("outage_table", (1.0, 2.0), "3 numbers"),
        ("flow_instance", 1.5, WHOLE),
        ("topics", 5, "a mapping by names"),
        ("progress", 5, "a function"),
    ],
)
def test_replay(log, option, wrong, needed):
    assert said(flownav.replay, log, **{option: wrong}).startswith(f"{option}: ")
    assert said(flownav.replay, log, **{option: wrong}).endswith(f"is given; {needed} is needed")


@pytest.mark.parametrize(
    ("option", "wrong", "needed"),
    [
        ("order", None, "text"),
        ("order", b"x", "text"),
        ("heights_m", None, "a number or a list"),
        ("heights_m", "x", "a number or a list"),
        ("heights_m", [None], "a number or a list"),
        ("heights_m", BEYOND, "a number or a list"),
        ("reference", np.zeros(3), "text"),
        ("base", 5, PATH),
        ("logs", 5, "a path or a list"),
        ("logs", [5], "a path or a list"),
    ],
)
def test_identify(rig, option, wrong, needed):
    options = {"logs": [rig], "heights_m": 0.6} | {option: wrong}
    assert said(flownav.identify, **options).endswith(f"is given; {needed} is needed")


@pytest.mark.parametrize(
    ("option", "wrong", "words"),
    [
        ("scenario", None, "a path, a Scenario or a list is needed"),
        ("scenario", [], "an empty list is given; name at least one"),
        ("sensors", 5, "a list is needed"),
        ("sweep", 5, "a mapping by names is needed"),
        ("sweep", {1: [2.0]}, "a mapping by names is needed"),
        ("until", 5, "text is needed"),
        ("sampling", np.zeros(3), "text is needed"),
        ("engine", None, "text is needed"),
        ("folder", 5, "a path is needed"),
        ("progress", 5, "a function is needed"),
        ("flights", 1.5, "a whole number is needed"),
    ],
)
def test_campaign(option, wrong, words):
    said_of_it = said(flownav.campaign, **({"flights": 1} | {option: wrong}))
    assert said_of_it.startswith(f"{option}: ")
    assert said_of_it.endswith(words)


@pytest.mark.parametrize(
    ("options", "words"),
    [
        ({"dispersed": np.zeros(3)}, "dispersed: ndarray is given; True or False is needed"),
        ({"seed": "1"}, "seed: '1' is given; a whole number is needed"),
        ({"seed": BEYOND}, "seed: a number beyond all bounds is given; a whole number is needed"),
        ({"flight": {1: 2}}, "flight: dict is given; a whole number or a mapping by names is needed"),
        ({"wind": {1: 2}}, "landing: 1 is no name of a value; give text"),
        ({"progress": "x" * 99}, f"progress: '{'x' * 39}... is given; a function is needed"),
    ],
)
def test_fly(options, words):
    assert said(flownav.fly, "landing", **options) == words


def test_names_that_no_file_can_have():
    for wrong in ("a" * 5000, "\0"):
        for call in (flownav.fly, flownav.Scenario.load, flownav.replay, flownav.load):
            assert "cannot be the name of a file" in said(call, wrong)


def test_a_sensors_noise_is_of_a_height():
    for wrong in (None, "x", np.zeros(3)):
        assert said(flownav.Sensor.load().sigma_m_s, wrong).endswith("a number is needed")


def test_a_record_is_drawn_and_written_by_words():
    record = flownav.fly("landing", flight={"duration_s": 3.0}, filter="paper")
    for call in (record.plot, record.export):
        for wrong in (None, [], np.zeros(3)):
            assert said(call, wrong).endswith("text is needed")
    assert said(record.report, 5).endswith("a path is needed")
    assert said(record.save, None).endswith("a path is needed")


def test_what_numpy_makes_is_a_number(rig):
    one = flownav.identify([rig], heights_m=np.array([0.6]))
    assert one.gain == flownav.identify(rig, heights_m=np.float64(0.6)).gain
    with pytest.raises(InputError, match="there are flights 0 to 0"):
        flownav.campaign(flights=np.int64(1)).record(np.int64(5))


def test_a_misspelt_argument_is_asked_back():
    with pytest.raises(InputError, match=r"^gps_outage: no argument of replay; did you mean gps_outages\?$"):
        flownav.replay("x", gps_outage=[(3.0, 4.0)])


def test_python_itself_says_what_is_no_argument_at_all():
    with pytest.raises(TypeError, match="nonsense"):
        flownav.replay("x", nonsense=1)
    with pytest.raises(TypeError, match="missing"):
        flownav.replay()


def test_what_a_protocol_is_the_function_judges():
    @checked
    def taken(part: Path | flownav.FlownavError | None = None, *more: int, **others: int) -> object:
        return part, more, others

    assert taken(None, 1, b=2) == (None, (1,), {"b": 2})
    assert said(taken, "x") == "part: 'x' is given; a path or a FlownavError is needed"


def test_no_message_is_endless():
    error = FlownavError("a" * 5000 + "z")
    assert len(str(error)) == MOST_LETTERS + len(" ... ")
    assert str(error).endswith("z")


@pytest.mark.parametrize(("call", "said"), [
    (lambda: flownav.fly(sed=3), "sed: neither an argument nor a key of a scenario; did you mean seed?"),
    (lambda: flownav.campaign(flightz=3), "neither an argument nor a key of a scenario; did you mean flights?"),
    (lambda: flownav.fly(vehicle="quad450"),
     "no such vehicle; shipped: maxi-joker-3, quad-450, hexa-550, or give a TOML file; did you mean quad-450?"),
    (lambda: flownav.fly("sorti"), "or give a TOML file; did you mean sortie?"),
    (lambda: flownav.Scenario.load("landing").changed(win=3), "did you mean wind?"),
])  # fmt: skip
def test_a_misspelt_name_is_asked_back(call, said):
    with pytest.raises(flownav.InputError) as error:
        call()
    assert said in str(error.value)
    with pytest.raises(flownav.InputError) as far:
        flownav.fly(zzz=3)
    assert "did you mean" not in str(far.value)


@pytest.mark.parametrize("wrong", [3, "x", None, [1.0], object()])
def test_an_object_is_made_of_what_it_holds(wrong):
    for call in (flownav.Scenario, flownav.Sensor, flownav.Vehicle, flownav.Record):
        if wrong is not None or call is not flownav.Record:
            assert " is given; a" in said(call, wrong)
            assert " is needed" in said(call, wrong)
    assert said(flownav.Record, {"kind": "fly"}, {"estimate": wrong}).endswith("is given; a mapping by names is needed")
    if not isinstance(wrong, str):
        assert said(flownav.Table, wrong).endswith("is given; a mapping by names is needed")


@pytest.mark.parametrize(
    ("t_s", "told"),
    [
        ([0.0, np.nan], "row 2 has the time nan s, which no clock shows"),
        ([0.0, 1e12], "row 2 has the time 1e+12 s, which no clock shows"),
        ([0.0, 1e6], "more than two days"),
        ([1.0, 0.0], "row 2 is earlier than the row before it"),
        ([0.0, "x"], "could not convert"),
    ],
)
def test_times_that_no_flight_has_are_in_no_file(t_s, told, tmp_path):
    """A grid that is laid over them would fill the memory."""
    zeros = dict.fromkeys(("pos_n_m", "pos_e_m", "pos_d_m"), np.zeros(2))
    record = flownav.Record({"kind": "replay", "log": "x"}, {"estimate": {"t_s": np.array(t_s), **zeros}})
    assert told in said(record.save, tmp_path / "x.fnr")
    assert told in said(record.report, tmp_path / "x.html")
    for to in ("mcap", "tum", "csv", "kml"):
        assert told in said(record.export, to, tmp_path / "x")
    without = flownav.Record({"kind": "replay"}, {"estimate": zeros})
    assert "no t_s" in said(without.save, tmp_path / "x.fnr")
    assert list(tmp_path.iterdir()) == []


@pytest.mark.parametrize(
    ("manifest", "told"),
    [
        ({"scores": 3}, "scores: Input should be a valid dictionary"),
        ({"kind": ["fly"]}, "kind: Input should be a valid string"),
        ({"parameters": "x"}, "parameters: Input should be a valid dictionary"),
        ({"duration_s": float("nan")}, "duration_s: Input should be a finite number"),
        ({"scores": {("a", "b"): 1}}, "keys must be str"),
    ],
)
def test_a_manifest_that_no_record_has_is_refused_in_one_line(manifest, told):
    text = said(flownav.Record, manifest)
    assert told in text
    assert text.startswith("no record has this manifest: ")
    assert "\n" not in text


@pytest.mark.parametrize(
    ("manifest", "looks"),
    [
        ({"scores": {"touchdown": 3}}, "repr verdict html"),
        ({"scores": {"touchdown": {"rest": {"distance_m": "far"}}}}, "repr html"),
        ({"scores": {"outages": [3]}}, "repr html"),
        ({"scores": {"truth": [1]}}, "repr html"),
        ({"covered_fraction": "most"}, "repr html"),
        ({"findings": 3}, "verdict html"),
        ({"findings": [{"bad": True}]}, "verdict html"),
        ({"scores": {"touchdown": {"reason": "wind"}}}, "verdict html repr"),
    ],
)
def test_what_makes_no_sense_inside_a_manifest_is_one_line_wherever_it_is_looked_at(manifest, looks):
    record = flownav.Record(manifest)
    calls = {"repr": record.__repr__, "verdict": lambda: record.verdict, "html": record._repr_html_}
    for look in looks.split():
        text = said(calls[look])
        assert text.startswith("manifest: flownav writes other scores or facts (")
        assert "\n" not in text
