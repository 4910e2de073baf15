"""Many flights of a simulator: a folder that goes on where it stopped, side by side, and the rows of its table."""

import fcntl
import json
import os
import shutil
from collections.abc import Callable, Iterator, Sequence
from concurrent.futures import ProcessPoolExecutor, as_completed
from contextlib import contextmanager, suppress
from multiprocessing import get_context
from pathlib import Path
from tempfile import gettempdir
from typing import Any, NamedTuple

import numpy as np

from flownav.core.errors import InputError, arg
from flownav.core.files import written_whole
from flownav.core.guard import object_in
from flownav.core.text import finite
from flownav.live.sitl.flight import Order, fly
from flownav.live.sitl.score import figures

PLAN = "sitl.json"
FIRST_SLOT, MOST_SLOT = 1, 9  # PX4's instances beyond share a port
ENVIRONMENT = {"ardupilot": "FLOWNAV_ARDUPILOT", "px4": "FLOWNAV_PX4"}
PROGRAMS = {"heli": "arducopter-heli", "copter": "arducopter", "quad": "px4"}
GET = {
    "ardupilot": "build it in ArduPilot's source: `./waf configure --board sitl && ./waf {target}`",
    "px4": "build it in PX4's source: `make px4_sitl_default`",
}
TARGETS = {"heli": "heli", "copter": "copter", "quad": ""}


def program_of(autopilot: str, vehicle: str, given: Path | None) -> Path:
    """The user's own simulator: given, of the environment, or on the PATH. InputError that explains how to get it."""
    variable, name = ENVIRONMENT[autopilot], PROGRAMS[vehicle]
    get = GET[autopilot].format(target=TARGETS[vehicle])
    if given is not None:
        if not given.is_file() or not os.access(given, os.X_OK):
            raise InputError(f"{arg('binary')} {given}: no program is there; {get}, and give its {name}")
        return given
    if root := os.environ.get(variable):
        for each in (Path(root), Path(root) / name, Path(root).parent / name):
            if each.is_file() and each.name == name and os.access(each, os.X_OK):
                return each.absolute()
        raise InputError(f"{variable} {root}: no {name} is there; {get}, and name its program or folder")
    if found := shutil.which(name):
        return Path(found)
    raise InputError(f"{name} is not found: {get}, then give {arg('binary')}, {variable} or the PATH")


class Cell(NamedTuple):
    """Flights of one kind: a row of the table."""

    name: str
    orders: tuple[Order, ...]


def given(cell: Cell, live: tuple[str, ...], *, link: bool) -> Cell:
    """A cell whose flights have these options of `flownav live`, and keep what goes over the line."""
    return cell._replace(orders=tuple(order._replace(live=live, link=link) for order in cell.orders))


class Task(NamedTuple):
    """A flight to be flown, and where its figures go."""

    cell: str
    number: int
    order: Order
    binary: Path
    folder: Path

    @property
    def path(self) -> Path:
        """Its figures."""
        return self.folder / f"{self.cell}-{self.number:03d}" / "flight.json"


def tasks_of(cells: Sequence[Cell], binary: Path, folder: Path) -> list[Task]:
    """Every flight of a campaign."""
    return [
        Task(cell.name, number, order, binary, folder) for cell in cells for number, order in enumerate(cell.orders)
    ]


def opened(folder: Path, plan: dict[str, Any]) -> None:
    """The folder holds this plan from now on. InputError where it holds another, or something else."""
    if folder.exists() and any(folder.iterdir()):
        known = folder / PLAN
        if not known.is_file():
            raise InputError(
                f"{arg('out')} {folder}: is there and holds no flights of `flownav sitl`; give another name"
            )
        found, asked = object_in(known, "give another name, or move it away"), json.loads(json.dumps(plan))
        if found | {"flights": 0} != asked | {"flights": 0}:
            raise InputError(f"{arg('out')} {folder}: holds other flights; give another name, or move it away")
    with written_whole(folder / PLAN) as temporary:
        temporary.write_text(json.dumps(plan, indent=1) + "\n")


def flown(tasks: Sequence[Task], beside: int, done: Callable[[int], None]) -> Iterator[tuple[Task, dict[str, Any]]]:
    """Fly the tasks that have no result yet, `beside` at a time; yields figures as they come."""
    left = []
    for task in tasks:
        if task.path.is_file():
            done(1)
            yield task, _figures_in(task.path)
        else:
            left.append(task)
    if beside == 1 or len(left) < 2:
        for task in left:
            yield task, _one(task)
            done(1)
        return
    with ProcessPoolExecutor(beside, mp_context=get_context("spawn")) as pool:
        waiting = {pool.submit(_one, task): task for task in left}
        for ended in as_completed(waiting):
            done(1)
            yield waiting[ended], ended.result()


def _figures_in(path: Path) -> dict[str, Any]:
    """Figures of a flight that was flown before. InputError where they are none."""
    advice = "remove it, and the flight is flown again"
    found = object_in(path, advice)
    if not isinstance(found.get("landed"), bool):
        raise InputError(f"{path}: holds no figures of a flight; {advice}")
    return found


@contextmanager
def a_slot() -> Iterator[int]:
    """A number that no other flight on this machine has now: simulators take their ports by it."""
    for number in range(FIRST_SLOT, MOST_SLOT + 1):
        held = _lock(Path(gettempdir()) / f"flownav-sitl-{number}.lock")
        try:
            fcntl.flock(held, fcntl.LOCK_EX | fcntl.LOCK_NB)
        except OSError:
            os.close(held)
            continue
        try:
            yield number
        finally:
            os.close(held)
        return
    raise InputError(f"{MOST_SLOT} simulators already fly on this machine; wait for one")


def _lock(path: Path) -> int:
    """A file to lock, opened to read: another user's cannot be written, nor made again in a folder that all share.

    InputError where it cannot be opened.
    """
    flags = os.O_RDONLY | os.O_NOFOLLOW | os.O_NONBLOCK | os.O_CLOEXEC
    try:
        with suppress(FileNotFoundError):
            return os.open(path, flags)
        return os.open(path, flags | os.O_CREAT, 0o644)
    except OSError as error:
        raise InputError(f"{path}: cannot be locked ({error.strerror}); remove it, or name another TMPDIR") from error


def _one(task: Task) -> dict[str, Any]:
    """Fly one, and keep its figures and words; the simulator's own files go."""
    place = task.path.parent
    shutil.rmtree(place, ignore_errors=True)
    with a_slot() as slot:
        result = fly(task.order, task.binary, place, slot)
    found: dict[str, Any] = finite(figures(result))
    shutil.rmtree(place / "simulator", ignore_errors=True)
    began_s = result.marks[0].now_s if result.marks else 0.0
    words = [f"{now_s - began_s:8.2f} {who}: {what}\n" for now_s, who, what in result.history.words]
    (place / "words.txt").write_text("".join(words))
    np.savez_compressed(
        place / "flight.npz",
        told=np.array([(t.now_s, t.boot_s, *t.pos_ned_m, t.quality, t.resets) for t in result.history.estimates]),
        truth=np.array(
            [
                (t.now_s, *t.state.position_deg_m, *t.state.vel_ned_m_s, *t.state.quaternion)
                for t in result.history.truth
            ]
        ),
        local=np.array([(now_s, *state.pos_ned_m, *state.vel_ned_m_s) for now_s, state in result.history.local]),
        marks=np.array([(mark.name, mark.now_s) for mark in result.marks]),
    )
    with written_whole(task.path) as temporary:
        temporary.write_text(json.dumps(found, indent=1) + "\n")
    return found


# -- the table --------------------------------------------------------------------------------------------------
OF_ALL = (
    "height_m",
    "floor_m",
    "hover_rms_m",
    "error_rms_m",
    "error_m",
    "error_down_m",
    "unsaid_s",
    "silent_s",
    "strayed_m",
)


def row_of(cell: str, flights: Sequence[dict[str, Any]]) -> dict[str, Any]:
    """A row: how many landed, R95 of the touchdown, and median and worst of the rest."""
    touched = sorted(flight["touchdown_m"] for flight in flights if flight.get("touchdown_m") is not None)
    row: dict[str, Any] = {
        "cell": cell,
        "flights": len(flights),
        "landed": sum(bool(flight["landed"]) for flight in flights),
        "not_flown": [flight["why"] for flight in flights if flight.get("why")],
        "touchdown_r95_m": float(np.quantile(touched, 0.95, method="higher")) if touched else None,
        "touchdown_m": _median_and_worst(touched),
        "cpu_share": _median_and_worst([flight["cpu_share"] for flight in flights if flight.get("cpu_share")]),
    }
    for name in OF_ALL:
        row[name] = _median_and_worst([flight[name] for flight in flights if flight.get(name) is not None])
    return row


def _median_and_worst(values: Sequence[float]) -> dict[str, float] | None:
    return {"median": float(np.median(values)), "worst": float(max(values))} if values else None
