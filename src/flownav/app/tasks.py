"""The buttons of the page as commands: what a person would type in the folder to get the same files.

A name that is taken is numbered by the command, which says in its facts where the file lies.
"""

import itertools
import re
from collections.abc import Callable, Mapping, Sequence
from pathlib import Path
from typing import Any, NamedTuple

from flownav.app.shelf import Shelf
from flownav.core.errors import InputError

NUMBER = re.compile(r"-?\d+(\.\d+)?")
WORD = re.compile(r"[A-Za-z0-9_.+-]+")
LINK = re.compile(r"(udp|udpin|udpout|tcp|tcpin|serial):[^\s'\"]{1,200}")
SENDINGS = ("none", "odometry", "vision", "landing-target")
STATUS = ".live.json"  # of the files that hold the state of a live session
AUTOPILOTS = ("px4", "ardupilot", "inav")
SEED = (0, 2**63 - 1)


class Task(NamedTuple):
    """A command: its words behind `flownav`, the names of the files that it reads, and what of its folder it writes."""

    words: tuple[str, ...]
    about: tuple[str, ...]
    writes: str


Asked = Mapping[str, Any]


def task_of(kind: str, asked: Asked, shelf: Shelf) -> Task:
    """The command of a button. InputError where there is no such button, or something asked for cannot be."""
    if kind not in TASKS:
        raise InputError(f"{kind}: no such job")
    return TASKS[kind](asked, shelf)


def _replay(asked: Asked, shelf: Shelf) -> Task:
    """A log through the navigator: its record and its report; with GPS cut, flow withheld or scaled."""
    (name,) = _names(asked, shelf, 1)
    cuts = [f"{number(t0)}:{number(t1)}" for t0, t1 in asked.get("cuts", [])]
    scale = [number(each) for each in asked.get("flow_scale") or (1, 1)]
    words = [*(["--gps-outage", ",".join(cuts)] if cuts else [])]
    words += ["--no-flow"] if asked.get("flow") is False else []
    words += ["--flow-scale", ",".join(scale)] if scale != ["1", "1"] else []
    words += ["--gps-delay", number(asked["gps_delay_s"])] if "gps_delay_s" in asked else []
    out = f"{_stem(name)}-replayed.fnr"
    return Task(("replay", name, *words, "--out", out), (name,), out)


def _report(asked: Asked, shelf: Shelf) -> Task:
    """The report of a record."""
    (name,) = _names(asked, shelf, 1)
    out = f"{_stem(name)}.html"
    return Task(("report", name, "--out", out), (name,), out)


def _explain(asked: Asked, shelf: Shelf) -> Task:
    """Why a log drifted, as a page, and the parameters that cure it."""
    (name,) = _names(asked, shelf, 1)
    out = f"{_stem(name)}-explained.html"
    return Task(("explain", name, *_autopilot(asked), "--out", out), (name,), out)


def _identify(asked: Asked, shelf: Shelf) -> Task:
    """A flow sensor's file from a log, and an autopilot's parameters: the log's own where none is chosen."""
    (name,) = _names(asked, shelf, 1)
    own = (shelf.look_of(shelf.path_of(name)) or {}).get("autopilot")
    whose = _autopilot({"autopilot": asked.get("autopilot") or own})
    out = f"{_stem(name)}-sensor.toml"
    return Task(("identify", name, *whose, "--out", out), (name,), out)


def _compare(asked: Asked, shelf: Shelf) -> Task:
    """Logs or records beside each other."""
    names = _names(asked, shelf, 2, 20)
    out = "compared.html"
    return Task(("compare", *names, "--out", out), names, out)


def _fly(asked: Asked, shelf: Shelf) -> Task:
    """One flight as a record with its report."""
    scenario = word(asked.get("scenario", "landing"))
    out = f"{scenario}.fnr"
    return Task(("fly", scenario, *flight_words(asked), "--out", out), (), out)


def _campaign(asked: Asked, shelf: Shelf) -> Task:
    """Many flights into the campaign's own store; a folder that is named goes on where it stopped."""
    scenario = word(asked.get("scenario", "landing"))
    words = ["campaign", scenario, "--flights", number(asked.get("flights", 200), 1, 1_000_000, whole=True)]
    words += ["--seed", number(asked.get("seed", 1), *SEED, whole=True)]
    words += [] if not asked.get("vehicle") else ["--vehicle", word(asked["vehicle"])]
    speed_m_s, _, from_deg = str(asked.get("wind") or "").partition(":")
    if speed_m_s:
        words += ["--set", f"wind.speed_20ft_m_s={number(speed_m_s, 0, 30)}"]
    if from_deg:
        words += ["--set", f"wind.from_direction_deg={number(from_deg, 0, 360)}"]
    words += ["--set", f"gps.model={word(asked['gps'])}"] if asked.get("gps") else []
    words += ["--set", f"flow_sensor={word(asked['sensor'])}"] if asked.get("sensor") else []
    folder = asked.get("folder")
    out = shelf.path_of(folder).name if folder else shelf.free(f"{scenario}_campaign").name
    return Task((*words, "--out", out), (), out)


def _certify(asked: Asked, shelf: Shelf) -> Task:
    """A requirement flown, or only planned."""
    requirement = word(asked.get("requirement", "landing"))
    words = ["certify", requirement]
    words += ["--vehicle", word(asked["vehicle"])] if asked.get("vehicle") else []
    if asked.get("flights"):
        words += ["--flights", number(asked["flights"], 1, 100_000_000, whole=True)]
    if asked.get("plan"):
        return Task((*words, "--plan"), (), "")
    folder = asked.get("folder")
    out = shelf.path_of(folder).name if folder else shelf.free(f"{Path(requirement).stem}_certificate").name
    return Task((*words, "--out", out), (), out)


def _live(asked: Asked, shelf: Shelf) -> Task:
    """A live session: its record, and the file with its state that the page reads while it runs."""
    url, send = str(asked.get("url", "")), asked.get("send", "none")
    if not LINK.fullmatch(url):
        raise InputError(f"{url[:40]!r}: is no link; give one such as udp:14550 or serial:/dev/ttyACM0:115200")
    if send not in SENDINGS:
        raise InputError(f"{str(send)[:40]!r}: {', '.join(SENDINGS)} are possible")
    words = ["live", url, "--send", send]
    words += ["--sensor", word(asked["sensor"])] if asked.get("sensor") else []
    for name, least, most in (
        ("gps_delay", 0.0, 1.0), ("send_limit", 0.1, 60.0), ("send_sigma", 0.01, 1e3), ("send_protection", 0.01, 1e3),
    ):  # fmt: skip
        words += [f"--{name.replace('_', '-')}", number(asked[name], least, most)] if asked.get(name) else []
    name = _flight_name(shelf)
    return Task((*words, "--record", f"{name}.fnr", "--status", f"{name}{STATUS}"), (), f"{name}.fnr")


def _flight_name(shelf: Shelf) -> str:
    """A name that no record, no journal of a session and no state of one has."""
    for count in itertools.count():
        name = f"flight-{count}" if count else "flight"
        if not any(shelf.path_of(f"{name}{ending}").exists() for ending in (".fnr", ".fnr.journal", STATUS)):
            return name
    raise AssertionError


def _vehicle(asked: Asked, shelf: Shelf) -> Task:
    """A simulated vehicle for a live session that listens at a port of this machine."""
    port = number(asked.get("port", 14550), 1, 65535, whole=True)
    out = "simulated.fnr"
    return Task(("fly", "pad_return", "--mavlink", f"udpout:127.0.0.1:{port}", "--no-report", "--out", out), (), out)


TASKS: dict[str, Callable[[Asked, Shelf], Task]] = {
    "replay": _replay,
    "report": _report,
    "explain": _explain,
    "identify": _identify,
    "compare": _compare,
    "fly": _fly,
    "campaign": _campaign,
    "certify": _certify,
    "live": _live,
    "vehicle": _vehicle,
}


def flight_words(asked: Asked) -> list[str]:
    """The options of `flownav fly` for what is chosen: seed, wind, GPS, sensor, vehicle."""
    words = ["--seed", number(asked.get("seed", 1), *SEED, whole=True)]
    for name in ("gps", "vehicle"):
        words += [f"--{name}", word(asked[name])] if asked.get(name) else []
    if asked.get("wind"):
        words += ["--wind", ":".join(number(each) for each in str(asked["wind"]).split(":"))]
    words += ["--sensor", word(asked["sensor"])] if asked.get("sensor") else []
    return words


def command_line(words: Sequence[str]) -> str:
    """Words as a person types them."""
    import shlex

    return shlex.join(("flownav", *words))


def number(given: Any, low: float = -1e9, high: float = 1e19, *, whole: bool = False) -> str:
    """A number as an option takes it. InputError where it is none, or out of range."""
    text = f"{given:.6g}" if isinstance(given, float) and not given.is_integer() else str(given).removesuffix(".0")
    if not NUMBER.fullmatch(text) or (whole and "." in text) or not low <= float(text) <= high:
        raise InputError(f"{str(given)[:40]}: a {'whole ' * whole}number from {low:g} to {high:g} is needed")
    return text


def word(given: Any) -> str:
    """A word that is no option. InputError where it is none."""
    text = str(given)
    if not WORD.fullmatch(text) or text.startswith("-"):
        raise InputError(f"{text[:40]!r}: is none of the choices")
    return text


def _names(asked: Asked, shelf: Shelf, least: int, most: int = 1) -> tuple[str, ...]:
    """The names of files that are asked for and are there."""
    names = asked.get("files")
    if not isinstance(names, list) or not least <= len(names) <= max(least, most):
        raise InputError(f"choose {least} file{'s' * (least > 1)}")
    for name in names:
        shelf.existing(str(name))
    return tuple(map(str, names))


def _autopilot(asked: Asked) -> list[str]:
    if not asked.get("autopilot"):
        return []
    if asked["autopilot"] not in AUTOPILOTS:
        raise InputError(f"{asked['autopilot']!r}: px4, ardupilot or inav are possible")
    return ["--for", str(asked["autopilot"])]


def _stem(name: str) -> str:
    return Path(name).stem if Path(name).suffix.lower() in (".fnr", ".ulg", ".tlog") else name.replace(".", "-")
