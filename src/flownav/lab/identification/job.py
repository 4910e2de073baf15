"""The job: logs in, findings out; rig logs together, or one flight."""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path

from flownav.core.errors import InputError
from flownav.core.guard import inputs_there
from flownav.lab.identification.descent import Structure
from flownav.lab.identification.findings import Findings
from flownav.lab.identification.flight_identification import identify_flight
from flownav.lab.identification.orders import CANDIDATES
from flownav.lab.identification.rig_identification import identify_rig
from flownav.lab.identification.rig_log import assign_heights, is_rig, read_runs
from flownav.logs.open_log import log_kind

TAKEN = "identify takes rig logs and flight logs"


def identify(
    logs: Sequence[Path],
    structures: Sequence[Structure] = CANDIDATES,
    heights_m: Sequence[float] = (),
    reference: str = "auto",
    flow_instance: int | None = None,
) -> Findings:
    """Findings of rig logs (all together, by height) or of one flight log.

    structures: models to choose from. flow_instance: which of a flight's several flow sensors.
    InputError, one line, where a log is missing, mixed or cannot serve.
    """
    if not logs:
        raise InputError("no log given; identify takes rig folders, rig CSV files or one flight log")
    inputs_there(logs, TAKEN)
    flights = [path for path in logs if is_flight(path)]
    if flights and len(logs) > 1:
        raise InputError(f"{flights[0]}: a flight is identified alone; give rig logs together, flights one by one")
    if flights:
        if heights_m:
            raise InputError("--heights: a flight's heights come from its range readings; leave the option out")
        return identify_flight(flights[0], structures, reference, flow_instance)
    if flow_instance is not None:
        raise InputError("--flow-instance: a rig log holds one flow sensor; leave the option out")
    for path in logs:
        if not is_rig(path):
            raise InputError(
                f"{path}: neither a rig log (rig.csv, run-001/rig.csv, a CSV file) nor a flight log (a folder with "
                "attitude.csv or imu.csv, .ulg, .bin, .tlog)"
            )
    runs = [
        run
        for path, height_m in zip(logs, assign_heights(logs, heights_m), strict=True)
        for run in read_runs(path, height_m, reference)
    ]
    return identify_rig(runs, structures)


def is_flight(path: Path) -> bool:
    """Whether a path holds a flight: a log file, or a folder of CSV files with an attitude or an IMU."""
    return any((path / name).exists() for name in ("attitude.csv", "imu.csv")) or bool(log_kind(path))


def name_of(logs: Sequence[Path]) -> str:
    """A name for what comes of the logs: the first one's."""
    first = logs[0].resolve()
    return first.stem if first.is_file() else first.name
