"""Every format by name: where its file or folder goes, and who writes it."""

from importlib import import_module
from pathlib import Path
from typing import Any, NamedTuple

from flownav.core.errors import InputError, arg
from flownav.core.record import Record
from flownav.export.trajectory import FRAMES

SUFFIXES = {
    "mcap": ".mcap", "foxglove": ".mcap", "tum": ".tum", "euroc": ".csv", "ulog": ".ulg", "kml": ".kml", "gpx": ".gpx",
}  # fmt: skip
FOLDERS = {"parquet": "_parquet", "csv": "_csv"}
WRITERS = {  # by format: module and function
    "mcap": ("mcap_file", "write_mcap"), "foxglove": ("mcap_file", "write_foxglove"), "tum": ("paths", "write_poses"),
    "euroc": ("paths", "write_poses"), "parquet": ("trajectory", "write_parquet"), "csv": ("trajectory", "write_csv"),
    "ulog": ("ulog_file", "write_ulog"), "kml": ("paths", "write_earth"), "gpx": ("paths", "write_earth"),
}  # fmt: skip
FORMATS = tuple(WRITERS)
FRAMED = ("tum", "euroc")
ON_EARTH = ("kml", "gpx")


class Written(NamedTuple):
    """Result of an export: its files, and notes on them for the user, one line each."""

    files: list[Path]
    notes: list[str]


def destination(record: Path, to: str, out: Path | None) -> Path:
    """The file or folder that an export goes to: `out`, or next to the record where `out` is None.

    For TUM and EuRoC, NAME.tum stands for NAME_estimate.tum and so on. An `out` that is a folder takes a file
    under the record's name. InputError where `to` is no format.
    """
    if to not in FORMATS:
        raise InputError(f"{arg('to')} {to}: one of {', '.join(FORMATS)} is needed")
    if to in FOLDERS:
        return out or record.with_name(record.stem + FOLDERS[to])
    suffix = SUFFIXES[to]
    if out is None:
        return record.with_suffix(suffix)
    if out.is_dir():
        return out / f"{record.stem}{suffix}"
    return out if out.suffix == suffix else out.with_name(out.name + suffix)


def written_files(to: str, path: Path) -> list[Path]:
    """The files that an export to `path` surely writes, to ask beforehand whether they may be."""
    if to in FRAMED:
        return [path.with_name(f"{path.stem}_estimate{path.suffix}")]
    if to == "foxglove":
        from flownav.export.mcap_file import layout_path

        return [path, layout_path(path)]
    return [path]


def export(
    record: Record, to: str, path: Path, frame: str | None = None, original: Path | None = None,
    origin: tuple[float, float, float] | None = None,
) -> Written:  # fmt: skip
    """Write a record to `path` in a format of FORMATS, whole or not at all.

    frame: "ned" (and FRD; where None) or "enu" (and FLU), of TUM and EuRoC. original: the ULog to merge into.
    origin: latitude, longitude [deg] and altitude [m] of the record's origin, of KML and GPX; None takes its own.
    InputError where an option does not belong to the format or the record lacks what it needs; OSError where
    nothing can be written there.
    """
    if frame is not None and frame not in FRAMES:
        raise InputError(f"{arg('frame')} {frame}: ned or enu is needed")
    if frame is not None and to not in FRAMED:
        raise InputError(f"{arg('frame')} is for {' and '.join(FRAMED)}; mcap carries both frames, the others are NED")
    if original is not None and to != "ulog":
        raise InputError(f"{arg('original')} is for {arg('to')} ulog")
    if origin is not None and to not in ON_EARTH:
        raise InputError(f"{arg('origin')} is for {' and '.join(ON_EARTH)}")
    takes: dict[str, tuple[Any, ...]] = dict.fromkeys(ON_EARTH, (to, origin)) | dict.fromkeys(FRAMED, (frame or "ned",))
    module, name = WRITERS[to]
    write = getattr(import_module(f"flownav.export.{module}"), name)
    return Written(*write(record, path, *(takes | {"ulog": (original,)}).get(to, ())))
