"""`flownav rig`: the paper's pendulum experiment, simulated from pixels, logged as a real rig would."""

from __future__ import annotations

from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any

import typer

from flownav.cli import options
from flownav.cli.options import AXES, EXCITATIONS, LIGHTS, RIG_PADS, one_of, option, out_option
from flownav.cli.output import emit

if TYPE_CHECKING:
    from flownav.lab.rig.experiment import RigLog, RigSettings

HEIGHTS_M = ["0.6"]
OutOption = Annotated[Path | None, out_option("The folder, with a folder in it for each of several runs", "out/rig")]
HEIGHT = "Sensor's height above the pad at rest [m], repeated or with commas."
HeightOption = Annotated[list[str], option("M", HEIGHT, "--height", "--heights")]
ExcitationOption = Annotated[str, typer.Option(help="How it is swung; swing is the paper's.", **one_of(*EXCITATIONS))]
PadOption = Annotated[
    str, typer.Option(help="What it looks at; MM is the stripes' width.", **one_of(*RIG_PADS, beside="FILE:WIDTH_M"))
]
GYRO_LATE = "How much older the gyro is than the flow [s]; below 0 the flow is older."


def command(
    out: OutOption = None,
    force: options.Force = False,
    height: HeightOption = HEIGHTS_M,
    runs: Annotated[int, option("N", "Runs at each height.")] = 1,
    duration: Annotated[float, option("S", "Length of a run [s].")] = 25.0,
    excitation: ExcitationOption = "swing",
    pad: PadOption = "stripes",
    light: Annotated[str, typer.Option(help="How bright it is.", **one_of(*LIGHTS))] = "normal",
    firmware: options.Firmware = "2013-09",
    along: Annotated[str, typer.Option(help="The camera's axis along the swing.", **one_of(*AXES))] = "x",
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
    from flownav.cli.options import numbers
    from flownav.cli.output import folder_place
    from flownav.lab.rig.experiment import RigSettings

    heights = numbers("--height", height, 0.01, 100.0)
    settings = RigSettings(
        height_m=heights[0],
        pivot_height_m=pivot_height,
        start_angle_rad=start_angle,
        duration_s=duration,
        pad=pad,
        light=light,
        firmware=firmware,
        excitation=excitation,
        along=along,
        refocus=refocus,
        chain_delay_s=chain_delay,
        gyro_late_s=gyro_late,
        sonar_late_s=sonar_late,
        runs=runs,
        seed=seed,
    )
    rows = _swung(settings, heights, folder_place(out or Path("out/rig"), force=force))
    if as_json:
        emit({"seed": seed, "firmware": firmware, "pad": pad, "excitation": excitation, "runs": rows})
    else:
        _print(rows)


def _swung(settings: RigSettings, heights_m: list[float], folder: Path) -> list[dict[str, Any]]:
    """Every run at every height, written in a folder of its own; what each was."""
    from flownav.cli.output import progress
    from flownav.core.compile import announce_compilation
    from flownav.core.provenance import command_line
    from flownav.lab.rig.campaign import run_campaign
    from flownav.lab.rig.log_folder import check_rig_folder, run_folders, write_rig_folder

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
    """What a run was and what it looks like."""
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


def _print(rows: list[dict[str, Any]]) -> None:
    from rich.console import Console
    from rich.table import Table

    table = Table(title="Logs written", title_justify="left")
    for heading in ("folder", "height [m]", "rod [m]", "peak [m/s]", "encoder rms [m/s]", "flow rms [m/s]", "quality"):
        table.add_column(heading, justify="left" if heading == "folder" else "right")
    for row in rows:
        table.add_row(
            row["folder"],
            f"{row['height_m']:g}",
            f"{row['rod_length_m']:.3f}",
            f"{row['peak_reference_m_s']:.3f}",
            f"{row['rms_reference_m_s']:.3f}",
            f"{row['rms_flow_m_s']:.3f}",
            f"{row['mean_quality']:.0f}",
        )
    Console(markup=False, highlight=False).print(table)
