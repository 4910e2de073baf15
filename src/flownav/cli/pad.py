"""`flownav pad`: the landing target, printed, measured in the laboratory, or found in a user's own pictures."""

from __future__ import annotations

import json
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any

import typer

if TYPE_CHECKING:
    from flownav.optics.pad_target import PadTarget

HEIGHTS = "0.3,0.5,0.75,1,1.5,2,3,4,5"


def command(
    frames: Annotated[
        list[Path] | None,
        typer.Argument(help="Your pictures: a folder, pictures, or one video. None: measure.", show_default=False),
    ] = None,
    side: Annotated[float, typer.Option(help="Side of the tag's black square, or of a plain pad [m].")] = 0.2,
    pattern: Annotated[str, typer.Option(help="tag, checker or stripes.")] = "tag",
    code: Annotated[int, typer.Option(help="Which tag of AprilTag 36h11, 0 to 15.")] = 0,
    focal: Annotated[
        float | None, typer.Option(help="Focal length of your pictures [px], undistorted.", show_default=False)
    ] = None,
    image_x: Annotated[
        float, typer.Option("--image-x-deg", help="Where the pictures' right is, clockwise from body forward.")
    ] = 0.0,
    camera: Annotated[str, typer.Option(help="Measure with: wide (640x480, 60 degrees) or px4flow.")] = "wide",
    focus: Annotated[
        float | None, typer.Option(help="Where its lens is focused [m]; as built without it.", show_default=False)
    ] = None,
    heights: Annotated[str, typer.Option(help="Heights to measure at [m], with commas.")] = HEIGHTS,
    count: Annotated[int, typer.Option("--frames", help="Frames a height.")] = 40,
    tilt: Annotated[float, typer.Option("--tilt-deg", help="Greatest tilt.")] = 15.0,
    light: Annotated[str, typer.Option(help="low, normal or intense.")] = "normal",
    seed: Annotated[int, typer.Option(help="Of ground, poses and noise.")] = 1,
    print_to: Annotated[
        Path | None, typer.Option("--print", help="Only write the target as a PNG of true size.", show_default=False)
    ] = None,
    as_json: Annotated[bool, typer.Option("--json", help="Print one JSON object and nothing else.")] = False,
) -> None:
    """Where the pad is from the lens: angles, distance, heading; and how well, by height."""
    from flownav.cli.output import require_between
    from flownav.optics.pad_target import PadTarget, checked, print_target

    target = checked(PadTarget(side, pattern, code))
    if print_to is not None:
        print_target(target, print_to)
        facts: dict[str, Any] = {"target": target._asdict(), "picture": str(print_to)}
        typer.echo(json.dumps(facts) if as_json else f"{print_to}: print it at 100 %, and measure its side")
    elif frames:
        from flownav.errors import InputError

        if focal is None:
            raise InputError("--focal: pictures need their focal length in pixels")
        require_between("--focal", focal, 1.0, 1e6)
        _show(_found(frames, target, focal, image_x), as_json, _print_found)
    else:
        require_between("--frames", count, 2, 100_000)
        require_between("--tilt-deg", tilt, 0.0, 45.0)
        if focus is not None:
            require_between("--focus", focus, 0.05, 1000.0)
        _show(_measured(target, camera, focus, heights, count, tilt, light, seed), as_json, _print_measured)


def _show(facts: dict[str, Any], as_json: bool, printer: Any) -> None:
    if as_json:
        typer.echo(json.dumps(facts))
    else:
        printer(facts)


# -- a user's own pictures ------------------------------------------------------------------------------------------
def _found(frames: list[Path], target: PadTarget, focal_px: float, image_x_deg: float) -> dict[str, Any]:
    import numpy as np

    from flownav.compile import announce_compilation
    from flownav.optics.frame_files import read_frames
    from flownav.optics.pad_fix import find_pad

    grey = read_frames(frames)
    c, s = np.cos(np.radians(image_x_deg)), np.sin(np.radians(image_x_deg))
    axes = np.array([[c, -s, 0.0], [s, c, 0.0], [0.0, 0.0, 1.0]])
    rows = []
    with announce_compilation("pad"):
        for k, frame in enumerate(grey):
            fix, reason = find_pad(frame, target, focal_px, axes)
            row: dict[str, Any] = {"frame": k, "reason": reason}
            if fix is not None:
                row |= {**fix._asdict(), "corners_px": fix.corners_px.tolist()}
            rows.append(row)
    found = sum(row["reason"] == "found" for row in rows)
    return {"target": target._asdict(), "focal_px": focal_px, "frames": len(rows), "found": found, "per_frame": rows}


def _print_found(facts: dict[str, Any]) -> None:
    from rich.console import Console
    from rich.table import Table

    table = Table("frame", "tan forward", "tan right", "distance [m]", "heading [deg]", "")
    for row in facts["per_frame"]:
        fix = [""] * 4
        if row["reason"] == "found":
            fix = [f"{row['tan_forward']:.5f}", f"{row['tan_right']:.5f}", f"{row['distance_m']:.4f}"]
            fix.append(f"{row['heading_rad'] * 57.29577951308232:.2f}")
        table.add_row(str(row["frame"]), *fix, row["reason"])
    console = Console(markup=False, highlight=False)
    console.print(table)
    console.print(f"found in {facts['found']} of {facts['frames']} frames")


# -- the laboratory ---------------------------------------------------------------------------------------------------
def _measured(
    target: PadTarget,
    camera_name: str,
    focus_m: float | None,
    heights: str,
    count: int,
    tilt_deg: float,
    light: str,
    seed: int,
) -> dict[str, Any]:
    import math

    from flownav.cli.output import progress
    from flownav.compile import announce_compilation
    from flownav.optics.camera import effective_focal_px
    from flownav.optics.pad_noise import camera_named, measure_height, noise_law

    camera = camera_named(camera_name, focus_m)
    rows = []
    heights_m = _heights(heights)
    with announce_compilation("pad"), progress("heights", len(heights_m)) as advance:
        for height_m in heights_m:
            rows.append(
                measure_height(
                    target, camera, height_m, frames=count, tilt_rad=math.radians(tilt_deg), light=light, seed=seed
                )
            )
            advance(1)
    law = noise_law(rows)
    return {
        "target": target._asdict(),
        "camera": {"name": camera_name, "focal_px": effective_focal_px(camera), "focus_m": camera.focus_m},
        "tilt_deg": tilt_deg,
        "light": light,
        "seed": seed,
        "heights": [
            {k: None if isinstance(v, float) and math.isnan(v) else v for k, v in row._asdict().items()} for row in rows
        ],
        "noise": None if law is None else law._asdict(),
    }


def _heights(text: str) -> list[float]:
    from flownav.cli.output import require_between
    from flownav.errors import InputError

    try:
        heights = sorted(float(part) for part in text.split(","))
    except ValueError:
        raise InputError(f"--heights {text}: give numbers with commas, such as {HEIGHTS}") from None
    for height_m in heights:
        require_between("--heights", height_m, 0.05, 50.0)
    return heights


def _print_measured(facts: dict[str, Any]) -> None:
    from rich import box
    from rich.console import Console
    from rich.table import Table

    console = Console(markup=False, highlight=False)
    target, camera = facts["target"], facts["camera"]
    console.print(
        f"{target['pattern']} of {target['side_m']:g} m, tilt to {facts['tilt_deg']:g} deg, {facts['light']} light"
    )
    console.print(f"camera {camera['name']}: {camera['focal_px']:.1f} px, focused at {camera['focus_m']:g} m")
    table = Table(box=box.SIMPLE_HEAD)
    for name in ("height", "in view", "found", "wrong", "angle", "bias", "distance", "bias", "heading"):
        table.add_column(name, justify="right")
    table.add_row("m", "", "", "", "urad", "urad", "ppm", "ppm", "mrad", style="dim")
    for row in facts["heights"]:
        table.add_row(
            f"{row['height_m']:g}",
            f"{row['in_view']}/{row['frames']}",
            str(row["found"]),
            str(row["wrong"]),
            *(
                _figure(row[key], scale)
                for key, scale in (
                    ("angle_sigma_rad", 1e6),
                    ("angle_bias_rad", 1e6),
                    ("distance_sigma", 1e6),
                    ("distance_bias", 1e6),
                    ("heading_sigma_rad", 1e3),
                )
            ),
        )
    console.print(table)
    law = facts["noise"]
    if law is None:
        console.print("no height at which nine of ten frames with the whole pad in view give a fix")
        return
    console.print(
        f"from {law['least_height_m']:g} to {law['greatest_height_m']:g} m: "
        f"angle {law['angle_sigma_rad'] * 1e6:.1f} urad, "
        f"distance {law['distance_relative_sigma'] * 1e6:.0f} ppm x (d/1 m)^{law['distance_exponent']:.2f}, "
        f"missed {law['outage_probability'] * 100:.1f} %"
    )


def _figure(value: float | None, scale: float) -> str:
    return "-" if value is None else f"{value * scale:.1f}"
