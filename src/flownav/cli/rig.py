"""`flownav rig` and `flownav sample`: simulated logs, of the paper's pendulum experiment and of a flight."""

from __future__ import annotations

from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any

import typer

from flownav.cli import options
from flownav.cli.options import SAMPLES, argument, chosen, numbers, option, out_option, switch, words
from flownav.cli.output import Column, answer, emit, folder_place, progress, say, table_of
from flownav.core.errors import InputError

if TYPE_CHECKING:
    from flownav.export.samples.kinds import Written
    from flownav.lab.rig.experiment import RigLog, RigSettings

HEIGHTS_M = ["0.6"]
HEIGHT = "Sensor's height above the pad at rest [m], repeated or with commas."
EXCITATION = "How it is swung; swing is the paper's."
PAD = "The target; MM is the stripes' width."
FOLDER = "The folder, with a folder in it for each of several runs"
COLUMNS = (
    Column("folder", "folder"),
    Column("height [m]", "height_m", "g"),
    Column("rod [m]", "rod_length_m", ".3f"),
    Column("peak [m/s]", "peak_reference_m_s", ".3f"),
    Column("encoder rms [m/s]", "rms_reference_m_s", ".3f"),
    Column("flow rms [m/s]", "rms_flow_m_s", ".3f"),
    Column("quality", "mean_quality", ".0f"),
)
GYRO_LATE = "How much older the gyro is than the flow [s]; below 0 the flow is older."


def command(
    out: Annotated[Path | None, out_option(FOLDER, "out/rig")] = None,
    force: options.Force = False,
    height: Annotated[list[str], option("M", HEIGHT, "--height", "--heights")] = HEIGHTS_M,
    runs: Annotated[int, option("N", "Runs at each height.")] = 1,
    duration: Annotated[float, option("S", "Length of a run [s].")] = 25.0,
    excitation: Annotated[str, chosen(EXCITATION, *options.EXCITATIONS)] = "swing",
    pad: Annotated[str, chosen(PAD, *options.RIG_PADS, beside="FILE:WIDTH_M")] = "stripes",
    light: Annotated[str, chosen("How bright it is.", *options.LIGHTS)] = "normal",
    firmware: options.Firmware = "2013-09",
    along: Annotated[str, chosen("The camera's axis along the swing.", *options.AXES)] = "x",
    pivot_height: Annotated[float, option("M", "Pivot above the pad [m].")] = 2.1,
    start_angle: Annotated[float, option("RAD", "Amplitude of the swing [rad].")] = 0.0912,
    refocus: Annotated[float, option("0..1", "1: lens focused at each height; 0: at 0.6 m.")] = 1.0,
    chain_delay: Annotated[float, option("S", "Serial and logging chain [s].")] = 0.07,
    gyro_late: Annotated[float, option("S", GYRO_LATE)] = 0.0,
    sonar_late: Annotated[float, option("S", "From the sonar's trigger to its reading [s].")] = 0.05,
    seed: options.RigSeed = 1,
    as_json: options.Json = False,
) -> None:
    """Swing a PX4FLOW over a pad beside an encoder and log both: rig.csv and rig.toml, a folder a run."""
    from flownav.lab.rig.experiment import RigSettings

    heights = numbers("--height", height, 0.01, 100.0)
    settings = RigSettings(
        height_m=heights[0], pivot_height_m=pivot_height, start_angle_rad=start_angle, duration_s=duration, pad=pad,
        light=light, firmware=firmware, excitation=excitation, along=along, refocus=refocus, chain_delay_s=chain_delay,
        gyro_late_s=gyro_late, sonar_late_s=sonar_late, runs=runs, seed=seed,
    )  # fmt: skip
    rows = _swung(settings, heights, folder_place(out or Path("out/rig"), force=force))
    facts = {"seed": seed, "firmware": firmware, "pad": pad, "excitation": excitation, "runs": rows}
    shown = table_of(COLUMNS, rows, title="Logs written", title_justify="left", left=1)
    answer(facts, as_json, lambda: say(shown))


def _swung(settings: RigSettings, heights_m: list[float], folder: Path) -> list[dict[str, Any]]:
    """Every run at every height, written in a folder of its own; what each was."""
    from flownav.core.compile import announce_compilation
    from flownav.core.provenance import command_line
    from flownav.lab.rig.experiment import check_rig_folder, run_campaign, run_folders, write_rig_folder

    count = len(heights_m) * settings.runs
    rows, folders = [], list(run_folders(folder, count))
    for each in folders:
        check_rig_folder(each)
    with announce_compilation("rig"), progress("Swinging", count) as advance:
        for log, each in zip(run_campaign(settings, heights_m, advance), folders, strict=True):
            write_rig_folder(log, each, command_line())
            rows.append(_facts(log, each))
    return rows


def _facts(log: RigLog, folder: Path) -> dict[str, Any]:
    """The facts of a run: its folder, geometry and peak velocity."""
    import numpy as np

    return {
        "folder": str(folder),
        "height_m": log.settings.height_m,
        "rod_length_m": round(log.rod_length_m, 4),
        "rows": len(log.time_s),
        "peak_reference_m_s": float(np.abs(log.reference_velocity_m_s).max()),
        "rms_reference_m_s": float(np.sqrt(np.mean(log.reference_velocity_m_s**2))),
        "rms_flow_m_s": float(np.sqrt(np.mean(log.flow_velocity_m_s**2))),
        "mean_quality": float(log.quality.mean()),
    }


def sample(
    kinds: Annotated[list[str] | None, argument("KIND", "Which samples", *SAMPLES, default="all of them")] = None,
    list_only: Annotated[bool, switch("Only say what there is; write nothing.", "--list")] = False,
    out: Annotated[Path | None, out_option("The folder to write into", "samples")] = None,
    seed: options.RigSeed = 1,
    force: options.Force = False,
    as_json: options.Json = False,
) -> None:
    """Write sample logs: a simulated flight in the formats of PX4, ArduPilot, MAVLink and CSV, a rig, and a record."""
    from importlib.util import find_spec

    from flownav.export.samples.kinds import SAMPLES as MADE
    from flownav.export.samples.kinds import sample_of, write_samples

    folder = out or Path("samples")
    asked = [sample_of(kind) for kind in (words("KIND", kinds) if kinds else [])]
    if list_only:
        _list(as_json=as_json)
        return
    has_mavlink = find_spec("pymavlink") is not None
    left_out = [s for s in MADE if s.uses and not has_mavlink]
    if unmade := [sample.kind for sample in asked if sample in left_out]:
        raise InputError(f"{unmade[0]}: needs pymavlink; install it with `pip install 'flownav[live]'`")
    samples = asked or [sample for sample in MADE if sample not in left_out]
    notes = [] if asked else [f"{s.kind} is left out: `pip install 'flownav[{s.uses}]'` adds it" for s in left_out]
    written = write_samples(samples, folder, seed, force=force, on_written=_quiet if as_json else _show_written)
    if as_json:
        emit({"folder": str(folder), "seed": seed, "samples": _facts_written(written), "notes": notes})
        return
    for note in notes:
        typer.echo(f"Note: {note}")
    typer.echo(f"{folder / 'README.txt'} describes each.")


def _list(*, as_json: bool) -> None:
    from flownav.export.samples.kinds import SAMPLES as MADE

    rows = [{"kind": s.kind, "name": s.name, "what": s.what, "commands": list(s.commands)} for s in MADE]
    listing = "\n".join(f"{row['kind']:<10} {row['name']}\n    {row['what']}" for row in rows)
    answer({"samples": rows}, as_json, lambda: typer.echo(listing))


def _facts_written(written: list[Written]) -> list[dict[str, Any]]:
    return [
        {"kind": each.sample.kind, "path": str(each.path), "bytes": each.size_bytes, "state": each.state,
         "what": each.sample.what, "commands": each.commands}
        for each in written
    ]  # fmt: skip


def _quiet(written: Written) -> None:
    """A listener that prints nothing next to the JSON object."""


def _show_written(written: Written) -> None:
    """A sample, and what to try with it."""
    size = f"{written.size_bytes / 1e6:.1f} MB, {written.state}"
    taken = f"; {written.instead_of} is there already (--force replaces it)" if written.instead_of else ""
    typer.echo(f"{written.path} ({size}{taken})\n  {written.sample.what}")
    for sample in written.commands:
        typer.echo(f"    {sample}")
