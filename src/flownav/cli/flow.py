"""`flownav flow`: a user's own pictures through the PX4FLOW's block matching."""

from __future__ import annotations

from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any

import typer

from flownav.cli import options
from flownav.cli.options import option
from flownav.cli.tables import answer, say, table

if TYPE_CHECKING:
    from flownav.lab.optics.flow import FlowSeries


FOCAL = "Focal length [px]; the PX4FLOW's is 666.67."
RANGE = "Distance to the ground [m]; adds velocities."
RATES = "CSV with columns rate_x_rad_s, rate_y_rad_s, rate_z_rad_s, a row a frame: compensates rotation."
MIDDLE = "Use the middle PX x PX pixels only."
BIN = "Average PX x PX pixels into one first."
Frames = Annotated[
    list[Path], typer.Argument(help="A folder of pictures, pictures in order, or one video.", show_default=False)
]


def command(
    frames: Frames,
    fps: Annotated[float, option("HZ", "Frames a second.", unset=False, within=(1e-3, 1e6))],
    focal: Annotated[float, option("PX", FOCAL, within=(1.0, 1e6))] = 666.67,
    distance: Annotated[float | None, option("M", RANGE, "--range", unset=False, within=(0.01, 10_000.0))] = None,
    rates: Annotated[Path | None, option("FILE.csv", RATES, unset=False)] = None,
    firmware: options.Firmware = "2014-12",
    window: Annotated[int | None, option("PX", MIDDLE, unset=False)] = None,
    bin_by: Annotated[int, option("PX", BIN, "--bin", within=(1, 64))] = 1,
    as_json: options.Json = False,
) -> None:
    """Flow and quality from each frame to the next, with the historical firmware of your choice."""
    from flownav.core.compile import announce_compilation
    from flownav.lab.optics.flow import flow_of_frames
    from flownav.lab.optics.frame_files import binned, middle, read_frames

    turned = _rates(rates) if rates else None
    grey = binned(read_frames(frames), bin_by)
    if window is not None:
        grey = middle(grey, window)
    with announce_compilation("flow"):
        series = flow_of_frames(
            grey, fps, focal_px=focal / bin_by, rates_rad_s=turned, range_m=distance, firmware=firmware
        )
    facts = _facts(series, len(grey), grey.shape[2], grey.shape[1], fps, focal / bin_by, firmware)
    answer(facts, as_json, lambda: _show(facts))


def _rates(path: Path) -> Any:
    """The rates of a CSV file, one row a frame."""
    import csv

    import numpy as np

    from flownav.core.errors import InputError
    from flownav.core.guard import an_input
    from flownav.core.text import number

    names = ("rate_x_rad_s", "rate_y_rad_s", "rate_z_rad_s")
    try:
        with an_input(path).open(newline="", encoding="utf-8") as stream:
            rows = list(csv.DictReader(stream))
    except (OSError, UnicodeDecodeError) as error:
        raise InputError(f"{path}: cannot be read ({error})") from None
    try:
        return np.array([[number(row[name]) for name in names] for row in rows]).reshape(-1, 3)
    except (KeyError, TypeError, ValueError):
        raise InputError(f"{path}: columns {', '.join(names)} of numbers are needed, one row a frame") from None


def _facts(
    series: FlowSeries, count: int, width: int, height: int, fps: float, focal_px: float, firmware: str
) -> dict[str, Any]:
    import numpy as np

    good = series.quality > 0
    moving = np.isfinite(series.velocity_m_s).all()
    per_frame = []
    for k in range(count - 1):
        row = {
            "t_s": float(series.time_s[k]),
            "flow_x_px": float(series.flow_px[k, 0]),
            "flow_y_px": float(series.flow_px[k, 1]),
            "quality": int(series.quality[k]),
        }
        if moving:
            row |= {f"velocity_{a}_m_s": float(v) for a, v in zip("xy", series.velocity_m_s[k], strict=True)}
        per_frame.append(row)
    summary = {
        "valid": int(good.sum()),
        "mean_quality": float(series.quality.mean()),
        "mean_flow_px": _mean(series.flow_px, good),
        "std_flow_px": series.flow_px[good].std(axis=0).tolist() if good.any() else None,
        "mean_flow_rad_s": _mean(series.flow_rad_s, good),
        "mean_velocity_m_s": _mean(series.velocity_m_s, good) if moving else None,
    }
    return {
        "frames": count,
        "size_px": [width, height],
        "fps": fps,
        "focal_px": focal_px,
        "firmware": firmware,
        "summary": summary,
        "per_frame": per_frame,
    }


def _mean(values: Any, good: Any) -> list[float] | None:
    """The mean of the valid rows, None where there are none."""
    return values[good].mean(axis=0).tolist() if good.any() else None


def _show(facts: dict[str, Any]) -> None:
    summary = facts["summary"]
    width, height = facts["size_px"]
    rows = [
        (label, *(f"{value:.4f}" for value in summary[key]))
        for label, key in (
            ("flow [px]", "mean_flow_px"), ("spread [px]", "std_flow_px"), ("flow [rad/s]", "mean_flow_rad_s"),
            ("velocity [m/s]", "mean_velocity_m_s"),
        )
        if summary[key] is not None
    ]  # fmt: skip
    say(
        f"{facts['frames']} frames of {width}x{height} px, firmware {facts['firmware']}",
        f"{summary['valid']} of {facts['frames'] - 1} pairs valid, quality {summary['mean_quality']:.0f}/255",
        table(("mean of the valid pairs", "x", "y"), rows),
    )
