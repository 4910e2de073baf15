"""build and verify: the navigator as a library for other processors, and its output there compared with replay."""

from collections.abc import Sequence
from pathlib import Path
from tempfile import TemporaryDirectory
from typing import TYPE_CHECKING, Any

from flownav.api.arguments import checked
from flownav.core.compiling.declared import needing_compilers
from flownav.core.errors import InputError, arg

if TYPE_CHECKING:
    from flownav.export.onboard.interface import Rates
    from flownav.export.onboard.package import Flight
    from flownav.export.onboard.verify import Found

SHIPPED_FLIGHT = "pad_return"


@checked
def build(
    target: str,
    out: str | Path,
    *,
    record: str | Path | None = None,
    sensor: str | Path | None = None,
    settings: str | Path | None = None,
    without: Sequence[str] = (),
    horizon_s: float = 0.27,
    imu_hz: float | None = None,
    others_hz: float | None = None,
    cpu: str = "",
    features: str = "",
    force: bool = False,
) -> dict[str, Any]:
    """Write the navigator for a processor into a new folder `out`; return its facts.

    target: linux-x86_64, linux-aarch64, cortex-m7, wasm32, or a triple that LLVM knows, with its cpu and features.
    record: a record or log of a flight whose settings and sensors it is built for, and whose first readings become
    test vectors; the shipped scenario pad_return is flown where none is given. sensor, settings: files in place of the
    record's own. without: parts that are left out: protection, pad, course. horizon_s: how far behind the newest
    reading an instant is when it is fused; imu_hz, others_hz: readings a second that there must be room for, those of
    the flight where none are given. force: a folder that `build` wrote before is replaced.
    InputError, one line, for what cannot be.

    Example:
        >>> import flownav
        >>> built = flownav.build("linux-x86_64", folder / "library", record=log)
        >>> built["target"], built["abi"], "flownav.h" in built["files"]
        ('linux-x86_64', 1, True)
    """
    with needing_compilers():
        from flownav.export.onboard.package import Asked, check
        from flownav.export.onboard.package import build as written

    _check(horizon_s, imu_hz, others_hz)
    asked = Asked(target, cpu, features, without=tuple(without))
    check(asked)
    flight = flight_of(record, sensor, settings)
    rates = _rates(flight, horizon_s, imu_hz, others_hz)
    return written(asked._replace(rates=rates), flight, Path(out), force=force)


def interface(*, horizon_s: float = 0.27, imu_hz: float | None = None, others_hz: float | None = None) -> str:
    """The text of `flownav.h`."""
    from flownav.export.onboard.interface import Rates, header

    _check(horizon_s, imu_hz, others_hz)
    usual = Rates(horizon_s)
    return header(usual._replace(imu_hz=imu_hz or usual.imu_hz, others_hz=others_hz or usual.others_hz).sizes)


def _check(horizon_s: float, imu_hz: float | None, others_hz: float | None) -> None:
    for name, value, low, high in (
        ("horizon_s", horizon_s, 0.0, 1.0), ("imu_hz", imu_hz, 20.0, 1000.0), ("others_hz", others_hz, 10.0, 2000.0)
    ):  # fmt: skip
        if value is not None and not low <= value <= high:
            raise InputError(f"{arg(name)} {value:g}: must be from {low:g} to {high:g}")


def _rates(flight: "Flight", horizon_s: float, imu_hz: float | None = None, others_hz: float | None = None) -> "Rates":
    """Capacity of the rings: the rates that are asked for, else those of the flight."""
    from flownav.export.onboard.package import rates_of

    found = rates_of(flight.segment, horizon_s)
    return found._replace(imu_hz=imu_hz or found.imu_hz, others_hz=others_hz or found.others_hz)


def flight_of(
    record: str | Path | None, sensor: str | Path | None = None, settings: str | Path | None = None
) -> "Flight":
    """A flight for settings and readings: of a record, of a log as it is replayed, or flown here."""
    from flownav.core.parameter_files import load
    from flownav.export.onboard.package import Flight
    from flownav.logs.open_log import open_flight
    from flownav.navigation.settings import NavigatorSettingsFile
    from flownav.navigation.settings_of import settings_of
    from flownav.replays.fed import as_fed, segments_of
    from flownav.replays.prepare import ReplayOptions
    from flownav.sensors.datasheet import load_sensor

    if record is None:
        from flownav.api.flying import fly

        with TemporaryDirectory() as folder:
            place = Path(folder) / f"{SHIPPED_FLIGHT}.fnr"
            fly(SHIPPED_FLIGHT).save(place)
            return flight_of(place, sensor, settings)
    name, log = Path(record).name, open_flight(Path(record))
    options, stated = as_fed(log, ReplayOptions(), None)
    noise = options.flow_noise
    if sensor is not None or settings is not None:
        own = load(Path(settings), NavigatorSettingsFile) if settings is not None else None
        given = settings_of(load_sensor(Path(sensor)) if sensor is not None else None, stated=own)
        stated, noise = given.settings, given.noise
    longest = max(segments_of(log, options, stated), key=lambda segment: len(segment.queue.t_s))
    return Flight(name, longest, stated, noise, options.gps_delay_s)


@checked
def verify(what: str | Path, record: str | Path | None = None, *, horizon_s: float | None = None) -> dict[str, Any]:
    """Compare the output of a board or a browser with the same flight computed here.

    what: a digest, a file of lines (readings, digest), or a folder of `build`, whose files are looked at and whose own
    code runs its test vectors wherever this machine can: `ran` names each place, its digests, and why nothing ran in
    it. record: the record or log of the flight; where none is given, the shipped one, or a folder's own vectors.
    horizon_s: that of the board, of a digest. InputError where these do not belong together. `equal` says whether all
    is the same.

    Example:
        >>> import flownav
        >>> built = flownav.build("linux-x86_64", folder / "verified", record=log)
        >>> flownav.verify(folder / "verified", log)["equal"]
        True
        >>> flownav.verify("0123456789abcdef", log)["equal"]
        False
    """
    with needing_compilers():
        from flownav.export.onboard.verify import logged_digests, verified

    if Path(what).is_dir():
        return _folder_verified(Path(what), record)
    logged, flight = logged_digests(str(what)), flight_of(record)
    found = verified(logged, flight, _rates(flight, 0.27 if horizon_s is None else horizon_s))
    return _facts_of(str(what), found, [], [])


def _folder_verified(folder: Path, record: str | Path | None) -> dict[str, Any]:
    """A folder of `build`: its files, its vectors (or a record's readings) in Python, and its own code where it runs.

    Code that was changed since is not run.
    """
    from flownav.export.onboard.constants import VECTORS_A_DIGEST
    from flownav.export.onboard.manifest import changed_files, manifest_of
    from flownav.export.onboard.runs import runs_of
    from flownav.export.onboard.verify import LoggedDigest, compare, passed_to

    manifest = manifest_of(folder)
    digests = [int(digest, 16) for digest in manifest["digests"]]
    logged = [LoggedDigest(i * VECTORS_A_DIGEST, digest) for i, digest in enumerate(digests, 1)]
    changed = list(changed_files(folder, manifest))
    readings, board = passed_to(folder, manifest, None if record is None else flight_of(record))
    found = compare(logged, readings[: len(logged) * VECTORS_A_DIGEST], board)
    ran = [] if changed else [each._asdict() for each in runs_of(folder, manifest)]
    return _facts_of(str(folder), found, changed, ran)


def _facts_of(what: str, found: "Found", changed: list[str], ran: list[dict[str, Any]]) -> dict[str, Any]:
    """Facts of a comparison, as a dictionary."""
    facts = found._asdict()
    equal_digests = facts.pop("equal")
    equal = found.differs is None and not changed and all(each["differs"] is None for each in ran)
    return {"what": what, "changed": changed, "equal": equal, "equal_digests": equal_digests, **facts, "ran": ran}
