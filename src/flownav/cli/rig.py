"""`flownav rig`: the paper's pendulum experiment, simulated from pixels, logged as a real rig would."""

from __future__ import annotations

from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any

from flownav.cli import options
from flownav.cli.options import chosen, numbers, option, out_option
from flownav.cli.tables import Column, answer, say, table_of

if TYPE_CHECKING:
    from flownav.lab.rig.experiment import RigLog, RigSettings

HEIGHTS_M = ["0.6"]
HEIGHT = "Sensor's height above the pad at rest [m], repeated or with commas."
EXCITATION = "How it is swung; swing is the paper's."
PAD = "What it looks at; MM is the stripes' width."
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
    facts = {"seed": seed, "firmware": firmware, "pad": pad, "excitation": excitation, "runs": rows}
    shown = table_of(COLUMNS, rows, title="Logs written", title_justify="left", left=1)
    answer(facts, as_json, lambda: say(shown))


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
