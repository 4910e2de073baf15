"""The types of options' values, and the options that mean the same in every command, each written once
(docs/reference/cli-grammar.md).

The words to choose from stand here because a shell's completion may load nothing heavy; tests hold them against
their rooms.
"""

import re
from collections.abc import Callable, Sequence
from pathlib import Path
from typing import Annotated, Any

import typer

from flownav.cli.output import require_between
from flownav.core.errors import InputError
from flownav.core.text import number

Range = tuple[float, float]
SCENARIOS = ("sortie", "takeoff", "landing", "gusty", "pad_return", "approach")
REQUIREMENTS = ("takeoff", "landing", "pad_return", "approach", "approach_8_m_s")
VEHICLES = ("maxi-joker-3", "quad-450", "hexa-550")
FILTERS = ("landing", "paper")
GPS_MODELS = ("white", "midg")
FEEDBACKS = ("estimate", "truth")
PLANTS = ("nonlinear", "linear")
OPTICS = ("model", "pixels")
ENGINES = ("local", "ray", "cuda")
SAMPLINGS = ("plain", "latin", "sobol")
TRUTH_MODELS = ("ensemble", "matched", "both")
ORDERS = ("auto", "delay", *(f"{n}{with_delay}" for with_delay in ("", "+delay") for n in range(1, 7)))
REFERENCES = ("auto", "velocity", "encoder", "truth", "gps")
AUTOPILOTS = ("px4", "ardupilot")
SCALED_FLOW = (*AUTOPILOTS, "inav")  # whose parameters `identify` writes
SENDINGS = ("odometry", "vision", "landing-target", "none")
LINKS = ("udp:", "udpout:", "tcp:", "tcpin:", "serial:")
EXCITATIONS = ("swing", "lengths", "chirp", "steps")
RIG_PADS = ("stripes", "stripes-MM", "texture", "checker")
LIGHTS = ("low", "normal", "intense")
FAULTS = (
    "gps_loss", "gps_jump", "gps_drift", "gps_clock", "flow_loss", "flow_garbage", "flow_sign", "flow_swapped",
    "flow_scale", "flow_late", "flow_clock", "low_texture", "low_texture_unsaid", "range_stuck", "range_stuck_descent",
    "range_floor", "range_spikes", "imu_bias", "accel_vibration", "nan_bursts", "duplicates", "out_of_order", "silence",
)  # fmt: skip
AXES = ("x", "y")
PATTERNS = ("tag", "nested", "checker", "stripes")
CAMERAS = ("wide120", "wide60", "px4flow")
FORMATS = ("mcap", "foxglove", "tum", "euroc", "parquet", "csv", "ulog", "kml", "gpx")
TARGETS = ("linux-x86_64", "linux-aarch64", "cortex-m7", "wasm32", "c-header")
PARTS = ("protection", "pad", "course")
TABLES = ("1", "2", "3", "5", "6")
SAMPLES = ("csv", "ulog", "tlog", "dataflash", "rig", "record")
FIRMWARES = (
    "2013-06", "2013-09", "2014-01", "2014-07", "2014-08", "2014-10", "2014-11", "2014-12", "2015-12", "2016", "2017",
    "2020",
)  # fmt: skip


def one_of(
    *names: str,
    beside: str = "",
    also: Callable[[], Sequence[str]] = tuple,
) -> dict[str, Any]:
    """Keywords of an option or argument that takes one of these words, or of an option that takes several.

    beside: what else it may be, for the help ("FILE.toml"): then any text passes, and files are completed too. also:
    words that are found when they are asked for, such as those of installed packages.
    """

    def checked(context: typer.Context, parameter: typer.CallbackParam, given: Any) -> Any:
        if not context.resilient_parsing and not beside:
            for word in given if isinstance(given, list) else [given]:
                for each in str(word).split(",") if isinstance(given, list) else [word]:
                    part = each.strip() if isinstance(each, str) else each
                    if part is not None and part not in names and part not in also():
                        raise InputError(f"{_name_of(parameter)} {part}: choose from {', '.join((*names, *also()))}")
        return given

    def complete(incomplete: str) -> list[str]:
        begun, _, last = incomplete.rpartition(",")
        known = [name for name in (*names, *also()) if name.startswith(last)]
        found = [f"{begun},{name}" if begun else name for name in known]
        suffix = re.search(r"FILE(\.\w+)", beside)
        return found + (files_like(incomplete, suffix[1]) if suffix else [])

    metavar = "|".join((*names, *([beside] if beside else [])))
    return {"metavar": metavar, "callback": checked, "autocompletion": complete}


def option(takes: str, what: str, *names: str, unset: str | bool = True, within: Range | None = None) -> Any:
    """An option that takes a value: what its help calls the value, what it is, and its names (else the parameter's).

    unset: what holds where it has no default and is not given, for the help. within: the numbers that it may be.
    """

    def checked(context: typer.Context, parameter: typer.CallbackParam, given: Any) -> Any:
        if within is not None and given is not None and not context.resilient_parsing:
            require_between(_name_of(parameter), given, *within)
        return given

    callback = None if within is None else checked
    return typer.Option(*names, metavar=takes, help=what, show_default=unset, callback=callback)


def chosen(what: str, *names: str, flag: str = "", unset: str | bool = True, **more: Any) -> Any:
    """An option that takes one of these words, or several. flag: its name; unset: as `option`; more: as `one_of`."""
    return typer.Option(*([flag] if flag else []), help=what, show_default=unset, **one_of(*names, **more))


def switch(what: str, *names: str, **more: Any) -> Any:
    """An option that is given or not."""
    return typer.Option(*names, help=what, **more)


def named(metavar: str, what: str, **more: Any) -> Any:
    """An argument that takes a value, or several."""
    return typer.Argument(metavar=metavar, help=what, **{"show_default": False, **more})


def argument(name: str, what: str, *names: str, beside: str = "", default: bool | str = False) -> Any:
    """An argument that takes one of these words, or several of them; its help lists them. As `one_of`."""
    listed = ", ".join(names) + (f", or {beside}" if beside else "")
    keywords = one_of(*names, beside=beside) | {"metavar": name}
    return typer.Argument(help=f"{what}: {listed}.", show_default=default, **keywords)


def files_like(incomplete: str, suffix: str) -> list[str]:
    """Files of a suffix, and folders, whose names begin so."""
    folder, _, begun = incomplete.rpartition("/")
    place = Path(folder or ("/" if incomplete.startswith("/") else "."))
    try:
        found = sorted(path for path in place.iterdir() if path.name.startswith(begun) and path.name[:1] != ".")
    except OSError:
        return []
    head = f"{folder}/" if "/" in incomplete else ""
    names = [f"{head}{path.name}/" for path in found if path.is_dir()]
    return [f"{head}{path.name}" for path in found if path.is_file() and path.suffix == suffix] + names


def installed_filters() -> Sequence[str]:
    """Filters of installed packages (entry points `flownav.filters`)."""
    from importlib.metadata import entry_points

    return tuple(point.name for point in entry_points(group="flownav.filters"))


def _name_of(parameter: typer.CallbackParam) -> str:
    """A parameter's name as it is typed: an option's first name, or an argument's."""
    return str(parameter.opts[0] if parameter.param_type_name == "option" else parameter.metavar)


Json = Annotated[bool, switch("Print one JSON object and nothing else.", "--json")]
REPLACE = "Replace what flownav wrote there before; without, the name is numbered."
Force = Annotated[bool, switch(REPLACE, "--force")]
KEPT = "flights that are there are kept"
ENSEMBLE = "Draw each flight's vehicle, wind and sensors about their datasheets, or fly them as the datasheets say."
Ensemble = Annotated[bool, switch(ENSEMBLE, "--ensemble/--matched")]
Report = Annotated[bool, switch("Write the HTML report beside the record.", "--report/--no-report")]
SEED = ("N", "Seed of the noise; the same seed, same result.", "--seed")
Seed = Annotated[int, option(*SEED, within=(0, 2**63 - 1))]
RigSeed = Annotated[int, option(*SEED, within=(0, 2**31 - 1))]  # the rig draws from 32 bits
IDENTIFIED = "A flow sensor file, as `flownav identify` writes it."
Sensor = Annotated[Path | None, option("FILE.toml", IDENTIFIED, "--sensor")]
TUNED = "Settings of the navigator, as `flownav tune` writes them."
Settings = Annotated[Path | None, option("FILE.toml", TUNED, "--settings")]
FlowInstance = Annotated[int | None, option("N", "Which of a log's several flow sensors.", "--flow-instance")]
TOPIC = "Of a ROS bag: which topic serves as what. May be given several times."
Topic = Annotated[list[str] | None, option("ROLE=TOPIC", TOPIC, "--topic")]
GpsDelay = Annotated[float, option("S", "How old a GPS reading is when it arrives [s].", "--gps-delay")]
SIGNING = "MAVLink 2 signing key: 32 bytes or 64 digits."
SigningKey = Annotated[Path | None, option("FILE", SIGNING, "--signing-key")]
Records = Annotated[int, option("N", "Write records and reports of this number of the worst flights.", "--records")]
Vehicle = Annotated[str | None, chosen("The vehicle that flies.", *VEHICLES, flag="--vehicle", beside="FILE.toml")]
SCENARIOS_OWN = "as the scenario says"
OWN_FILTERS: dict[str, Any] = {"flag": "--filter", "beside": "FILE.py:CLASS", "also": installed_filters}
FILTER = "The navigator's filter, the paper's, an installed one's name, or your own class."
Filter = Annotated[str | None, chosen(FILTER, *FILTERS, unset=SCENARIOS_OWN, **OWN_FILTERS)]
Engine = Annotated[str, chosen("This machine's cores, a cluster (Ray), a GPU.", *ENGINES, flag="--engine")]
FIRMWARE = "A version of the PX4FLOW's firmware, with switches where wanted: 2013-09,-gyro-scale."
Firmware = Annotated[str, chosen(FIRMWARE, *FIRMWARES, flag="--firmware", beside="VERSION,SWITCH")]
LOG_KINDS = "a CSV folder, .ulg, .bin, .tlog, or a record (.fnr)"
Log = Annotated[Path, named("LOG", f"A log: {LOG_KINDS}.")]
Logs = Annotated[list[Path], named("LOG", f"Logs, each {LOG_KINDS}.")]
Record = Annotated[Path, named("RECORD.fnr", "A record, as fly, replay and live write it.")]
Scenario = Annotated[str, argument("SCENARIO", "The scenario", *SCENARIOS, beside="a scenario's FILE.toml")]


def out_option(what: str, default: str = "") -> Any:
    """The option `--out`: what it writes, and where it writes that if it is not given ("": nowhere)."""
    return typer.Option("--out", metavar="PATH", help=f"{what}.", show_default=default or "none is written")


def words(option: str, given: Sequence[str]) -> list[str]:
    """Every word of an option that is repeated or has commas, once, in order. InputError where there is none."""
    return list(dict.fromkeys(_parts(option, given)))


def _parts(option: str, given: Sequence[str]) -> list[str]:
    found = [word.strip() for text in given for word in text.split(",") if word.strip()]
    if not found:
        raise InputError(f"{option}: give one at least")
    return found


def numbers(option: str, given: Sequence[str], low: float, high: float) -> list[float]:
    """Every number of such an option, in order. InputError where one is none, or out of range."""

    found = []
    for word in _parts(option, given):
        try:
            found.append(number(word))
        except ValueError:
            raise InputError(f"{option} {word}: a number is needed") from None
        require_between(option, found[-1], low, high)
    return found
