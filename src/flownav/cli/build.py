"""`flownav build` and `verify`: the navigator as a library for other processors, and its output there compared with
replay.
"""

from pathlib import Path
from typing import Annotated, Any

import typer

from flownav.cli import options
from flownav.cli.options import chosen, named, option, out_option
from flownav.cli.output import answer, folder_place
from flownav.core.errors import InputError, VerdictError

TARGET = "The processor."
VERIFIED = "Build nothing; verify a folder that was built, as `flownav verify DIR` does."
RECORD = "A flight whose settings it is built for, and whose readings prove it."
WITHOUT = "Leave parts out: less code."
HORIZON = "How far behind the newest reading an instant is when it is fused [s]."
IMU, OTHERS = "Inertial readings a second that there is room for.", "Readings of other sensors a second."
CPU, FEATURES = "With a triple: the CPU, as LLVM calls it.", "With a triple: its features, as LLVM has them."
WHAT = "A board's answer: 16 digits, a file of lines (readings, digits), or a folder of `flownav build`."
FLIGHTS = "those of the flight"
FLOWN = "the scenario pad_return, flown here"
FLIGHT = f"The flight, by default the folder's own vectors, or {FLOWN}."


def command(
    target: Annotated[str, chosen(TARGET, *options.TARGETS, flag="--target", unset=False, beside="TRIPLE")] = "",
    out: Annotated[Path | None, out_option("The folder", "flownav-TARGET")] = None,
    record: Annotated[Path | None, option("RECORD", RECORD, unset=FLOWN)] = None,
    sensor: options.Sensor = None,
    settings: options.Settings = None,
    without: Annotated[
        list[str] | None, chosen(WITHOUT, *options.PARTS, flag="--without", unset="all is there")
    ] = None,
    horizon: Annotated[float, option("S", HORIZON, within=(0.0, 1.0))] = 0.27,
    imu_hz: Annotated[float | None, option("HZ", IMU, unset=FLIGHTS, within=(20.0, 1000.0))] = None,
    others_hz: Annotated[float | None, option("HZ", OTHERS, unset=FLIGHTS, within=(10.0, 2000.0))] = None,
    cpu: Annotated[str, option("CPU", CPU, unset="LLVM's own choice")] = "",
    features: Annotated[str, option("LIST", FEATURES, unset="those of the CPU")] = "",
    built: Annotated[Path | None, option("DIR", VERIFIED, "--verify", unset=False)] = None,
    force: options.Force = False,
    as_json: options.Json = False,
) -> None:
    """Write the navigator as a library for a flight controller, a companion computer or the browser."""
    from flownav.api.building import build, interface

    if built is not None:
        if target or out is not None:
            raise InputError("--verify: it builds nothing; leave --target and --out away")
        verify(str(built), record, None, as_json)
        return
    if not target:
        raise InputError(f"--target: choose from {', '.join(options.TARGETS)}, or an LLVM triple")
    if target == options.TARGETS[-1]:
        if out is not None or as_json:
            raise InputError(f"--target {target}: it prints the header and nothing else; leave --out and --json away")
        typer.echo(interface(horizon_s=horizon, imu_hz=imu_hz, others_hz=others_hz), nl=False)
        return
    place = folder_place(out or Path(f"flownav-{target}"), record, sensor, settings, force=force)
    parts = tuple(part.strip() for words in without or () for part in words.split(","))
    facts = build(
        target, place, record=record, sensor=sensor, settings=settings, without=parts, horizon_s=horizon,
        imu_hz=imu_hz, others_hz=others_hz, cpu=cpu, features=features, force=force,
    )  # fmt: skip
    answer({"folder": str(place), **facts}, as_json, lambda: _show(place, facts))


def _show(place: Path, facts: dict[str, Any]) -> None:
    """Print the build's place and sizes."""
    typer.echo(f"Written: {place}, build {facts['build']}")
    typer.echo(
        f"Code {facts['code_bytes'] / 1000:.1f} kB, constants {facts['constant_bytes'] / 1000:.1f} kB, settings "
        f"{facts['settings_bytes'] / 1000:.1f} kB; RAM of a navigator {facts['navigator_bytes'] / 1000:.1f} kB"
    )
    typer.echo(f"README.md explains its use; `flownav verify {place}` looks at it again, and runs it")


def verify(
    what: Annotated[str, named("DIR|DIGEST|LINES", WHAT)],
    record: Annotated[Path | None, named("RECORD", FLIGHT)] = None,
    horizon: Annotated[float | None, option("S", HORIZON, unset="0.27, or the folder's", within=(0.0, 1.0))] = None,
    as_json: options.Json = False,
) -> None:
    """Replay a flight here, and compare it with the output of a board or a browser, to the first difference.

    The code in a folder of `flownav build` is run as well, by each emulator and browser that is installed.
    """
    from flownav.api.building import verify as compared

    facts = compared(what, record, horizon_s=horizon)
    answer(facts, as_json, lambda: _say_found(facts))
    if facts["changed"]:
        raise VerdictError(f"{what}: not as it was written: {', '.join(facts['changed'])}")
    if not facts["equal"]:
        raise VerdictError(
            f"{what}: the first difference is after {facts['differs']} readings ({facts['sensor']} at "
            f"{facts['t_s']:.6f} s): here {facts['expected']}, there {facts['said']}; "
            f"after {facts['same']} all was equal"
        )
    if wrong := [_difference(each) for each in facts["ran"] if each["differs"]]:
        raise VerdictError(f"{what}: the folder's own code differs: {', '.join(wrong)}")


def _say_found(facts: dict[str, Any]) -> None:
    typer.echo(
        f"{facts['equal_digests']} of {facts['compared']} digests are equal; here it ends with {facts['digest']}"
    )
    for each in facts["ran"]:
        found = f"not run, {each['why']}" if each["why"] else f"{each['equal']} of {each['compared']} digests are equal"
        typer.echo(f"{each['where']}: {found}")


def _difference(ran: dict[str, Any]) -> str:
    """Where a folder's own code differs, after how many readings, and why it failed where it did."""
    why = f" ({ran['why']})" if ran["why"] else ""
    return f"{ran['where']} after {ran['differs']} readings{why}"
