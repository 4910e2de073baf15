"""The folder of the page: what lies in it that can be opened, its looks, and where what is removed goes.

What is known of a log is kept in `.flownav-app/looks`, by its name, size and time: a page that is opened again has it
at once.
"""

import json
import os
from pathlib import Path, PurePosixPath
from typing import Any

from flownav.core.errors import InputError
from flownav.core.free_names import free_name

KEPT = ".flownav-app"
LOG_SUFFIXES = (".ulg", ".bin", ".log", ".tlog", ".mcap", ".bag", ".db3", ".bbl", ".bfl", ".crazyflie")
RECORD = ".fnr"
LOOKED_AT = ("log", "record")
FOLDER_HOLDS = (".csv", ".db3", ".mcap")  # of a folder that is one log
SENSOR = "-sensor.toml"  # as the page has `flownav identify` write them
CAMPAIGN = "campaign.json"
LONGEST_NAME = 120
FORBIDDEN = set('/\\:*?"<>|')


class Shelf:
    """A folder. Names in it are relative, and lead nowhere else."""

    def __init__(self, folder: Path) -> None:
        self.folder = folder.resolve()
        self.dropped: set[str] = set()  # what was dropped in is shown, whatever its suffix

    @property
    def looks(self) -> Path:
        """Where what is known of logs is kept."""
        return self.folder / KEPT / "looks"

    def path_of(self, name: str) -> Path:
        """The path of a file in the folder, or below it. InputError where a name is none, or leads elsewhere."""
        path = self.folder.joinpath(*PurePosixPath(safe_name(name)).parts)
        if not path.resolve().is_relative_to(self.folder):
            raise InputError(f"{name}: leads out of the folder")
        return path

    def existing(self, name: str) -> Path:
        """The path of a file that is there. InputError where it is not, or as of `path_of`."""
        path = self.path_of(name)
        if not path.exists():
            raise InputError(f"{name}: is not in the folder any more")
        return path

    def entries(self) -> list[dict[str, Any]]:
        """Logs, records and campaigns in the folder, the newest first: name, kind, bytes, when written, look."""
        found = []
        for path in self.folder.iterdir():
            kind = self._kind(path)
            if kind:
                info = path.stat()
                found.append({"name": path.name, "kind": kind, "bytes": _bytes_of(path), "written_s": info.st_mtime,
                              "look": self.look_of(path) if kind in LOOKED_AT else None})  # fmt: skip
        return sorted(found, key=lambda entry: (-entry["written_s"], entry["name"]))

    def _kind(self, path: Path) -> str:
        """log, record, sensor, campaign, or "" for what the page does not show."""
        if path.name.startswith(".") or path.is_symlink():
            return ""
        if path.is_dir():
            if (path / CAMPAIGN).is_file():
                return "campaign"
            holds = any(each.suffix.lower() in FOLDER_HOLDS for each in path.iterdir())
            return "log" if holds else ""
        if path.name.endswith(SENSOR):
            return "sensor"
        if path.suffix.lower() == RECORD:
            return "record"
        return "log" if path.suffix.lower() in LOG_SUFFIXES or path.name in self.dropped else ""

    def look_of(self, path: Path) -> dict[str, Any] | None:
        """The look at a log as it is now; None where it was not looked at since it was written."""
        try:
            kept = json.loads(self._look_path(path).read_text(encoding="utf-8"))
        except (OSError, ValueError):
            return None
        return kept["look"] if isinstance(kept, dict) and kept.get("stamp") == _stamp(path) else None

    def keep_look(self, path: Path, look: dict[str, Any]) -> None:
        """Keep what is known of a log."""
        self.looks.mkdir(parents=True, exist_ok=True)
        temporary = self._look_path(path).with_suffix(".part")
        temporary.write_text(json.dumps({"stamp": _stamp(path), "look": look}), encoding="utf-8")
        os.replace(temporary, self._look_path(path))

    def _look_path(self, path: Path) -> Path:
        return self.looks / f"{path.name}.json"

    def remove(self, name: str) -> Path:
        """Move a file of the folder aside, into `.flownav-app/removed`; where it lies then."""
        path = self.existing(name)
        aside = self.folder / KEPT / "removed"
        aside.mkdir(parents=True, exist_ok=True)
        place = free_name(aside / path.name)
        os.replace(path, place)
        return place

    def free(self, name: str) -> Path:
        """The first of the numbered names that nothing in the folder has."""
        return free_name(self.path_of(name))


def safe_name(name: str) -> str:
    """A name that stays in the folder, of one part or several. InputError where it is none."""
    parts = PurePosixPath(name).parts
    poor = not parts or len(name) > 4 * LONGEST_NAME or name.startswith("/")
    for part in parts:
        poor |= part.startswith((".", "-")) or len(part.encode()) > LONGEST_NAME or part.strip() != part
        poor |= bool(FORBIDDEN & set(part)) or not part.isprintable()
    if poor:
        raise InputError(f"{name[:LONGEST_NAME]!r}: is no name for a file here; rename it, with letters and digits")
    return name


def _bytes_of(path: Path) -> int:
    if path.is_dir():
        return sum(each.stat().st_size for each in path.iterdir() if each.is_file())
    return path.stat().st_size


def _stamp(path: Path) -> list[float]:
    return [float(_bytes_of(path)), path.stat().st_mtime]
