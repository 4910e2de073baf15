"""One grammar on all commands: what `docs/reference/cli-grammar.md` says, read from the commands themselves."""

from __future__ import annotations

import os
import re
import signal
import subprocess
import sys
import time

import pytest
import typer
import typer.main

import flownav
from command import run
from flownav import cli
from flownav.cli import app
from flownav.cli import options as choices
from forking import interruptible
from places import DOCS

APP = typer.main.get_command(app)
COMMANDS = APP.commands  # type: ignore[attr-defined]
GRAMMAR = (DOCS / "reference" / "cli-grammar.md").read_text(encoding="utf-8")
KEEP_FLIGHTS = {"campaign", "certify", "sitl"}
# of the autopilot's simulator, which is not one of ours; what is identified, as the issue names it
OWN = {("sitl", "--vehicle"), ("identify", "--vehicle")}
PRINTS_JSON = {"schema"}
SAME = ("--json", "--force", "--seed", "--sensor", "--settings", "--vehicle", "--engine", "--flow-instance",
        "--gps-delay", "--signing-key")  # fmt: skip
BAD_ENGLISH = ("where unsaid", "what is told", "if left out", "unless given", "if not given", "all of it")


def options(name: str) -> dict[str, object]:
    """A command's options by each of their names."""
    return {text: p for p in COMMANDS[name].params for text in (*p.opts, *p.secondary_opts) if text.startswith("--")}


def help_of(name: str) -> str:
    done = run(name, "--help", columns="80")
    assert done.returncode == 0, done.stderr
    return done.stdout


@pytest.mark.parametrize("name", COMMANDS)
def test_every_command_prints_json_if_asked(name):
    assert name in PRINTS_JSON or "--json" in options(name)


@pytest.mark.parametrize("name", COMMANDS)
def test_who_writes_has_out_with_its_default_and_force(name):
    known = options(name)
    if "--out" in known:
        assert isinstance(known["--out"].show_default, str), "says where it is written if it is not given"  # type: ignore[attr-defined]
        assert known["--out"].metavar == "PATH"  # type: ignore[attr-defined]
        assert ("--force" in known) == (name not in KEEP_FLIGHTS)
    else:
        assert "--force" not in known


def test_an_option_says_the_same_everywhere():
    for option in SAME:
        said = {(options(name)[option].help, options(name)[option].metavar)  # type: ignore[attr-defined]
                for name in COMMANDS if option in options(name) and (name, option) not in OWN}  # fmt: skip
        assert len(said) == 1, f"{option}: {said}"
        assert f"`{option}" in GRAMMAR or option == "--engine"


@pytest.mark.parametrize("name", COMMANDS)
def test_help_is_plain_and_says_what_each_option_takes(name):
    for option in COMMANDS[name].params:
        if option.name != "help":
            assert option.help, f"{name} {option.name}"
            assert option.help.rstrip().endswith("."), f"{name} {option.name}: {option.help}"
            assert not any(words in option.help for words in BAD_ENGLISH), f"{name} {option.name}: {option.help}"
            takes_value = option.param_type_name == "option" and not getattr(option, "is_flag", False)
            assert not takes_value or option.metavar, f"{name} {option.name}: has no name for its value"


def test_the_choices_of_the_command_line_are_those_of_the_rooms():
    from flownav.campaigns.faults.catalogue import FAULTS
    from flownav.campaigns.plan import SAMPLINGS
    from flownav.export.samples.kinds import KINDS
    from flownav.lab.identification.parameter_file import AUTOPILOTS
    from flownav.lab.identification.quantities import parse_order
    from flownav.lab.optics.camera import LIGHTS
    from flownav.lab.optics.firmware import firmware_named
    from flownav.lab.optics.pad import PATTERNS
    from flownav.lab.optics.pad_trial import CAMERAS
    from flownav.lab.rig.pendulum import EXCITATIONS
    from flownav.live.options import SENDINGS
    from flownav.paper.reproduction import TABLES
    from flownav.simulation.scenario import SHIPPED
    from flownav.vehicle.kinds import SHIPPED_NAMES

    assert choices.SCENARIOS == SHIPPED
    assert tuple(SHIPPED_NAMES) == choices.VEHICLES
    assert tuple(SAMPLINGS) == choices.SAMPLINGS
    assert tuple(FAULTS) == choices.FAULTS
    assert tuple(AUTOPILOTS) == choices.SCALED_FLOW
    assert tuple(SENDINGS) == choices.SENDINGS
    assert set(choices.LIGHTS) == set(LIGHTS)
    assert choices.PATTERNS == PATTERNS
    assert tuple(CAMERAS) == choices.CAMERAS
    assert tuple(map(str, TABLES)) == choices.TABLES
    assert set(choices.EXCITATIONS) == set(EXCITATIONS)
    assert choices.SAMPLES == KINDS
    for order in choices.ORDERS:
        assert parse_order(order)
    for version in choices.FIRMWARES:
        assert firmware_named(version).name == version


def test_requirements_and_gps_models_are_those_that_ship():
    from flownav.campaigns.requirement import load_requirement
    from flownav.simulation.scenario import Scenario

    for name in choices.REQUIREMENTS:
        assert load_requirement(name).name == name
    schema = Scenario.model_json_schema()
    assert schema["$defs"]["GpsInsSettings"]["properties"]["model"]["enum"] == list(choices.GPS_MODELS)
    assert set(schema["properties"]["truth"]["enum"]) == set(choices.PLANTS)
    assert set(schema["properties"]["optics"]["enum"]) == set(choices.OPTICS)
    assert set(schema["$defs"]["FilterSection"]["properties"]["name"]["enum"]) == set(choices.FILTERS)
    assert set(schema["$defs"]["AutopilotSection"]["properties"]["feedback"]["enum"]) == set(choices.FEEDBACKS)


# -- exit statuses and single lines -------------------------------------------------------------------------------
@pytest.mark.parametrize(("arguments", "said"), [
    (("fly", "landing", "--gps", "rtk"), "--gps rtk: choose from white, midg"),
    (("campaign", "landing", "--engine", "abacus"), "--engine abacus: choose from local, ray, cuda"),
    (("identify", "x", "--order", "7"), "--order 7: choose from auto, delay, 1, 2"),
    (("live", "udp:1", "--send", "pigeon"), "--send pigeon: choose from odometry, vision, landing-target, none"),
    (("accuracy", "--cases", "landing,dive"), "--cases dive: choose from takeoff, landing, pad_return"),
    (("paper", "--table", "4"), "--table 4: choose from 1, 2, 3, 5, 6"),
    (("rig", "--light", "dark"), "--light dark: choose from low, normal, intense"),
    (("sample", "flac"), "KIND flac: choose from csv, ulog, tlog, dataflash, rig, record"),
    (("fly", "landing", "--speeed", "1"), "No such option: --speeed"),
    (("replay",), "Missing argument"),
    (("fly", "--wind", "breeze"), "--wind breeze: m/s at 20 ft"),
    (("fly", "--wind", "8:west"), "--wind 8:west: m/s at 20 ft"),
    (("fly", "landing", "--seed", "one"), "--seed"),
    (("faults", "--heights", "1,x"), "--heights x: a number is needed"),
    (("nothing",), "No such command"),
])  # fmt: skip
def test_a_wrong_value_is_one_line_that_lists_what_can_be(tmp_path, arguments, said):
    done = run(*arguments, cwd=tmp_path)
    assert done.returncode == 2
    assert done.stdout == ""
    assert done.stderr.startswith("flownav: ")
    assert done.stderr.count("\n") == 1
    assert said in done.stderr
    assert list(tmp_path.iterdir()) == []


def test_the_version_is_printed(tmp_path):
    done = run("--version", cwd=tmp_path)
    assert (done.returncode, done.stdout) == (0, f"flownav {flownav.__version__}\n")


@pytest.fixture
def interrupted_here():
    """SIGINT is an interrupt, also where who started the tests in the background had it ignored."""
    before = signal.signal(signal.SIGINT, signal.default_int_handler)
    yield
    signal.signal(signal.SIGINT, before)


@pytest.mark.usefixtures("interrupted_here")
def test_a_command_that_is_broken_off_is_exit_status_130(monkeypatch):
    stops = typer.Typer()

    @stops.command()
    def command():
        signal.raise_signal(signal.SIGINT)

    monkeypatch.setattr(sys, "argv", ["flownav"])
    with pytest.raises(SystemExit) as left:
        cli.run(stops)
    assert left.value.code == 130


@pytest.mark.real_time
def test_ctrl_c_is_exit_status_130(tmp_path):
    done = subprocess.Popen(
        [sys.executable, "-m", "flownav", "rig", "--runs", "200", "--out", "rig"],
        cwd=tmp_path, stdout=subprocess.DEVNULL, stderr=subprocess.DEVNULL,
        preexec_fn=interruptible,
    )  # fmt: skip
    try:
        until_s = time.monotonic() + 120.0
        while not (tmp_path / "rig").exists() and time.monotonic() < until_s:
            time.sleep(0.05)
        done.send_signal(signal.SIGINT)
        assert done.wait(120.0) == 130
    finally:
        done.kill()


# -- 80 columns ---------------------------------------------------------------------------------------------------
@pytest.mark.parametrize("name", ["csv", "ulog"])
def test_info_fits_80_columns(tmp_path, name):
    where = run("sample", name, "--json", cwd=tmp_path)
    assert where.returncode == 0, where.stderr
    path = re.search(r'"path": "([^"]+)"', where.stdout)
    assert path
    done = run("info", path[1], cwd=tmp_path)
    assert done.returncode == 0, done.stderr
    lines = done.stdout.splitlines()
    assert max(map(len, lines)) <= 80
    assert "…" not in done.stdout
    assert any(re.search(r"sensor +readings +rate \[Hz\] +from \[s\] +to \[s\] +gap \[s\] +no data \[%\]", line)
               for line in lines)  # fmt: skip


WARNED = """
import warnings
import flownav.cli
from multiprocessing.util import _args_from_interpreter_flags
from flownav.__main__ import main

def run(app):
    warnings.warn("overflow encountered in exp", RuntimeWarning)
    warnings.warn("something else")
    print("-Wignore" in _args_from_interpreter_flags())

flownav.cli.asked, flownav.cli.run = lambda: None, run
main()
"""


def test_pythons_warnings_reach_nobody_who_did_not_ask_for_them():
    """Nor those of the processes that a command starts; -W shows them."""
    clean = {name: value for name, value in os.environ.items() if name != "PYTHONWARNINGS"}
    done = subprocess.run([sys.executable, "-c", WARNED], capture_output=True, text=True, env=clean)
    assert (done.returncode, done.stdout, done.stderr) == (0, "True\n", "")
    done = subprocess.run([sys.executable, "-W", "default", "-c", WARNED], capture_output=True, text=True, env=clean)
    assert done.stdout == "False\n"
    assert "RuntimeWarning: overflow encountered in exp" in done.stderr


INTERRUPTED = """
import signal, sys

module = sys.argv.pop(1)

class Interrupts:
    def find_spec(self, name, path=None, target=None):
        if name == module:
            signal.raise_signal(signal.SIGINT)

signal.signal(signal.SIGINT, signal.default_int_handler)
sys.meta_path.insert(0, Interrupts())
from flownav.__main__ import main
main()
"""


@pytest.mark.parametrize("module", ["flownav.cli", "typer", "flownav.cli.fly", "flownav.api.calls", "numpy"])
def test_an_interrupt_while_modules_are_loaded_ends_without_a_word(module, tmp_path):
    asked = [sys.executable, "-c", INTERRUPTED, module, "fly", "landing", "--out", str(tmp_path / "x.fnr")]
    done = subprocess.run(asked, capture_output=True, text=True)
    assert (done.returncode, done.stdout, done.stderr) == (130, "", "")
    assert not list(tmp_path.iterdir())


def test_an_interrupt_that_is_ignored_stays_ignored():
    ignored = INTERRUPTED.replace("default_int_handler", "SIG_IGN")
    done = subprocess.run([sys.executable, "-c", ignored, "typer", "--version"], capture_output=True, text=True)
    assert done.returncode == 0
    assert done.stdout.startswith("flownav ")


def test_too_little_memory_is_one_line(monkeypatch):
    def none_left(*given, **more):
        raise MemoryError

    monkeypatch.setattr("flownav.export.samples.kinds.write_samples", none_left)
    done = run("sample", "tlog")
    assert (done.returncode, done.stderr) == (2, "flownav: there is not enough memory for this; give less at once\n")
