"""identify: rig and flight logs into a flow sensor with intervals, and what the logs could show at all.

The logs are looked for before anything is loaded that takes time.
"""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path
from typing import TYPE_CHECKING, Any

from flownav.api.arguments import checked
from flownav.core.errors import InputError
from flownav.core.guard import inputs_there

if TYPE_CHECKING:
    from flownav.api.sensor import Sensor
    from flownav.lab.identification.vehicle_parameters import Identified


@checked
def identify(
    logs: str | Path | Sequence[str | Path],
    *,
    order: str = "auto",
    heights_m: float | Sequence[float] = (),
    reference: str = "auto",
    flow_instance: int | None = None,
    base: str | Path | None = None,
) -> Sensor:
    """Identify a flow sensor: gain, latency, dynamics and noise, each with its 95 % interval.

    logs: rig logs (folders or CSV files), taken together, or one flight log. order: auto, delay (gain and latency), 1
    to 6, or such as "2+delay". heights_m: the sensor's height over the rig, one for all logs or one each. reference:
    auto; velocity or encoder of a rig, truth or gps of a flight. flow_instance: which of a flight's several flow
    sensors. base: the sensor file for numbers that no log shows (optics, limits); the paper's where it is None.
    InputError, one line, where a log is missing, mixed with another kind or cannot serve.

    Example:
        >>> import flownav
        >>> sensor = flownav.identify(rig_log, heights_m=0.6)
        >>> 0.5 < sensor.gain.low < sensor.gain.value < sensor.gain.high < 1.5
        True
    """
    paths = [Path(logs)] if isinstance(logs, str | Path) else [Path(log) for log in logs]
    require_logs(paths)

    from flownav.api.calls import call_of, changed
    from flownav.core.provenance import called_as

    heights = [float(heights_m)] if isinstance(heights_m, int | float) else [float(height) for height in heights_m]
    options = {
        "order": order, "heights_m": heights, "reference": reference, "flow_instance": flow_instance, "base": base
    }  # fmt: skip
    call = call_of("identify", [str(path) for path in paths], **changed(identify, options))
    with called_as(call):
        return identify_logs(paths, order, heights, reference, flow_instance=flow_instance, base=base)


def require_logs(logs: Sequence[Path]) -> None:
    """InputError where a log is missing."""
    if not logs:
        raise InputError("no log given; identify takes rig folders, rig CSV files or one flight log")
    inputs_there(logs, "identify takes rig logs and flight logs")


def identify_logs(
    logs: Sequence[Path], order: str, heights_m: Sequence[float], reference: str, *, flow_instance: int | None,
    base: str | Path | None,
) -> Sensor:  # fmt: skip
    """The sensor that these logs show. InputError as `identify`."""
    from dataclasses import replace

    from flownav.api.sensor import Sensor
    from flownav.core.compile import announce_compilation
    from flownav.core.provenance import command_line
    from flownav.lab.identification.job import identify as findings_of
    from flownav.lab.identification.job import name_of
    from flownav.lab.identification.quantities import parse_order
    from flownav.lab.identification.sensor_file import sensor_entries
    from flownav.sensors.datasheet import load_sensor

    structures, base_sensor = parse_order(order), load_sensor(base)
    with announce_compilation("identification", "the identification, once, about 10 s"):
        findings = findings_of(logs, structures, heights_m, reference, flow_instance)
    if base is not None:
        findings = replace(findings, datasheet=base_sensor)
    entries = sensor_entries(findings, base_sensor, f"identified from {name_of(logs)}", command_line())
    return Sensor(entries, None, findings)


def identify_vehicle_log(log: Path, base: Path | None) -> tuple[Identified, dict[str, Any]]:
    """Parameters that a log shows of its vehicle, and the vehicle file's content. InputError where it shows nothing."""
    from flownav.lab.identification.commanded import HELICOPTER, read_commanded
    from flownav.lab.identification.vehicle_file import vehicle_entries
    from flownav.lab.identification.vehicle_parameters import identify_vehicle
    from flownav.vehicle.kinds import load_vehicle

    flight = read_commanded(log)
    file = base or Path("maxi-joker-3" if flight.kind == HELICOPTER else "quad-450")
    found = identify_vehicle(flight, load_vehicle(file))
    return found, vehicle_entries(found, file, f"identified from {log.name}")
