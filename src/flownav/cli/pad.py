"""`flownav pad`: the landing target, printed, found in a user's own pictures, or measured in rendered frames."""

from __future__ import annotations

import math
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any

import typer

from flownav.cli import options
from flownav.cli.options import CAMERAS, PATTERNS, one_of, option, out_option
from flownav.cli.output import emit
from flownav.core.text import finite

if TYPE_CHECKING:
    from flownav.lab.optics.pad_target import PadTarget
    from flownav.lab.optics.pad_trial import Trials

HEIGHTS = ["0.15,0.175,0.2,0.3,0.5,1,2,3,4"]
SPEEDS = ["0.1,0.5,1.5"]
WIDE = 110  # columns of the table of what was measured


FramesArgument = Annotated[
    list[Path] | None,
    typer.Argument(help="Your pictures: a folder, pictures, or one video. None: measure.", show_default=False),
]
SideOption = Annotated[float, option("M", "Side of the tag's black square, or of a plain pad [m].")]
FOCAL = "Focal length of your pictures [px], undistorted."
FocalOption = Annotated[float | None, option("PX", FOCAL, unset=False, within=(1.0, 1e6))]
IMAGE_X = "Where the pictures' right is, clockwise from body forward."
FOCUS = "Where its lens is focused [m]."
FocusOption = Annotated[float | None, option("M", FOCUS, unset="as built", within=(0.05, 1000.0))]
HeightsOption = Annotated[list[str], option("M", "Heights to measure at [m], repeated or with commas.")]
SpeedsOption = Annotated[list[str], option("M/S", "Speeds over ground [m/s], repeated or with commas.")]
FlightsOption = Annotated[int, option("N", "Cameras, each on a flight of its own.", within=(2, 100_000))]
CountOption = Annotated[int, option("N", "Frames a flight, height and speed.", "--frames", within=(1, 100_000))]
TiltOption = Annotated[float, option("DEG", "Greatest tilt.", "--tilt-deg", within=(0.0, 45.0))]
MOUNTING = "How well it is mounted, for the datasheet."
MountingOption = Annotated[float, option("DEG", MOUNTING, "--mounting-deg", within=(0.0, 5.0))]
PICTURES = "A folder for one frame of each flight and height."
PrintOption = Annotated[
    Path | None, option("PATH", "Only write the target as a PNG of true size.", "--print", unset=False)
]


def command(
    frames: FramesArgument = None,
    side: SideOption = 0.2,
    pattern: Annotated[str, typer.Option(help="What is printed on the pad.", **one_of(*PATTERNS))] = "tag",
    code: Annotated[int, option("N", "Which tag of AprilTag 36h11, 0 to 15.")] = 0,
    focal: FocalOption = None,
    image_x: Annotated[float, option("DEG", IMAGE_X, "--image-x-deg")] = 0.0,
    camera: Annotated[str, typer.Option(help="The camera to measure with.", **one_of(*CAMERAS))] = "wide120",
    focus: FocusOption = None,
    heights: HeightsOption = HEIGHTS,
    speeds: SpeedsOption = SPEEDS,
    flights: FlightsOption = 24,
    count: CountOption = 2,
    tilt: TiltOption = 15.0,
    mounting: MountingOption = 0.4,
    seed: options.Seed = 1,
    out: Annotated[Path | None, out_option("The datasheet (TOML), which a scenario's [sensors] name")] = None,
    force: options.Force = False,
    pictures: Annotated[Path | None, option("PATH", PICTURES, unset=False)] = None,
    print_to: PrintOption = None,
    as_json: options.Json = False,
) -> None:
    """Where the pad is from the lens: angles, distance, heading; and how well, by height."""
    from flownav.cli.options import numbers
    from flownav.cli.output import folder_place, place
    from flownav.lab.optics.pad_target import PadTarget, checked
    from flownav.lab.optics.pad_trial import Trials

    target = checked(PadTarget(side, pattern, code))
    if print_to is not None:
        return _print_target(target, place(print_to, force=force), as_json)
    if frames:
        return _show(_found(frames, target, focal, image_x), as_json, _print_found)
    datasheet = None if out is None else place(out, force=force)
    frames_in = None if pictures is None else folder_place(pictures)
    at_m = sorted(set(numbers("--heights", heights, 0.05, 50.0)))
    at_m_s = sorted(set(numbers("--speeds", speeds, 0.0, 50.0)))
    trials = Trials(at_m, at_m_s, flights, count, math.radians(tilt), seed)
    facts = _measured(target, camera, focus, trials, tilt, frames_in)
    if datasheet is not None:
        facts["datasheet"] = _write_datasheet(datasheet, facts, target, camera, focus, mounting)
    _show(_plain(facts), as_json, _print_measured)


def _print_target(target: PadTarget, picture: Path, as_json: bool) -> None:
    """The target as a picture of its true size."""
    from flownav.lab.optics.pad_target import print_target

    print_target(target, picture)
    facts: dict[str, Any] = {"target": target._asdict(), "picture": str(picture)}
    _show(facts, as_json, lambda _: typer.echo(f"{picture}: print it at 100 %, and measure its side"))


def _show(facts: dict[str, Any], as_json: bool, printer: Any) -> None:
    if as_json:
        emit(facts)
    else:
        printer(facts)


# -- a user's own pictures ------------------------------------------------------------------------------------------
def _found(frames: list[Path], target: PadTarget, focal_px: float | None, image_x_deg: float) -> dict[str, Any]:
    import numpy as np

    from flownav.core.compile import announce_compilation
    from flownav.core.errors import InputError
    from flownav.lab.optics.frame_files import read_frames
    from flownav.lab.optics.pad_fix import find_pad

    if focal_px is None:
        raise InputError("--focal: pictures need their focal length in pixels")
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

    table = Table("frame", "tan forward", "tan right", "distance [m]", "heading [deg]", "what became of it")
    for row in facts["per_frame"]:
        fix = [""] * 4
        if row["reason"] == "found":
            fix = [f"{row['tan_forward']:.5f}", f"{row['tan_right']:.5f}", f"{row['distance_m']:.4f}"]
            fix.append(f"{row['heading_rad'] * 57.29577951308232:.2f}")
        table.add_row(str(row["frame"]), *fix, row["reason"])
    console = Console(markup=False, highlight=False)
    console.print(table)
    console.print(f"found in {facts['found']} of {facts['frames']} frames")


# -- rendered frames --------------------------------------------------------------------------------------------------
def _measured(
    target: PadTarget,
    camera_name: str,
    focus_m: float | None,
    trials: Trials,
    tilt_deg: float,
    pictures: Path | None,
) -> dict[str, Any]:
    from flownav.cli.output import progress
    from flownav.core.compile import announce_compilation
    from flownav.lab.optics.pad_statistics import laws_of
    from flownav.lab.optics.pad_trial import camera_named, fly_cameras

    trial, shown = camera_named(camera_name, focus_m), target.inner  # the outer is the same tag, five times as large
    with announce_compilation("pad"), progress("flights", trials.flights) as advance:
        frames = fly_cameras(trial, shown, trials, advance, pictures)
    laws, cells = laws_of(frames)
    return {
        "target": target._asdict(),
        "camera": {"name": camera_name, "focal_m": trial.camera.focal_m, "focus_m": trial.camera.focus_m},
        "tilt_deg": tilt_deg,
        "seed": trials.seed,
        "flights": trials.flights,
        "cells": [cell._asdict() for cell in cells],
        "laws": laws,
    }


def _plain(facts: dict[str, Any]) -> dict[str, Any]:
    """As JSON has it: NaN is null, laws are objects."""
    laws = facts["laws"]._asdict()
    laws |= {name: laws[name]._asdict() for name in ("angle", "distance", "missed")}
    return facts | {"laws": laws, "cells": finite(facts["cells"])}


def _write_datasheet(
    out: Path, facts: dict[str, Any], target: PadTarget, camera_name: str, focus_m: float | None, mounting_deg: float
) -> str:
    from flownav.core.guard import written_whole
    from flownav.core.provenance import command_line
    from flownav.lab.optics.pad_datasheet import Assumed, datasheet
    from flownav.lab.optics.pad_trial import camera_named
    from flownav.sensors.pad_camera_sheet import load_pad_camera_sheet

    sheet = load_pad_camera_sheet()
    lens_m = (float(sheet.lens.forward_m), float(sheet.lens.right_m), float(sheet.lens.down_m))
    assumed = Assumed(float(sheet.rate_hz), float(sheet.latency_s), float(sheet.jitter_s), lens_m, mounting_deg)
    trial = camera_named(camera_name, focus_m)
    text = datasheet(facts["laws"], trial, camera_name, target, assumed, command_line())
    with written_whole(out) as temporary:
        temporary.write_text(text, encoding="utf-8", errors="backslashreplace")
    load_pad_camera_sheet(out)
    return str(out)


def _print_measured(facts: dict[str, Any]) -> None:
    from rich import box
    from rich.console import Console
    from rich.table import Table

    console = Console(markup=False, highlight=False)
    console.width = max(console.width, WIDE)
    target, camera, laws = facts["target"], facts["camera"], facts["laws"]
    console.print(
        f"{target['pattern']} of {target['side_m']:g} m, tilt to {facts['tilt_deg']:g} deg; "
        f"{facts['flights']} cameras {camera['name']}, {laws['frames']} frames"
    )
    table = Table(box=box.SIMPLE_HEAD)
    for name in (
        "height [m]", "speed [m/s]", "rate [rad/s]", "in view", "found", "wrong", "angle [mrad]", "distance [%]",
        "heading [mrad]",
    ):  # fmt: skip
        table.add_column(name, justify="right")
    for row in facts["cells"]:
        table.add_row(
            f"{row['height_m']:g}", f"{row['speed_m_s']:g}", f"{row['image_rate_rad_s']:.2f}",
            f"{row['in_view']}/{row['frames']}", str(row["found"]), str(row["wrong"]),
            _figure(row["angle_sigma_rad"], 1e3), _figure(row["distance_sigma"], 1e2),
            _figure(row["heading_sigma_rad"], 1e3),
        )  # fmt: skip
    console.print(table)
    for line in _law_lines(laws):
        console.print(line)
    if "datasheet" in facts:
        console.print(f"datasheet: {facts['datasheet']}")


def _law_lines(laws: dict[str, Any]) -> list[str]:
    angle, distance, missed = laws["angle"], laws["distance"], laws["missed"]
    a, b = missed["hidden"]
    return [
        f"from {laws['min_height_m']:.3g} to {laws['max_height_m']:.3g} m; r the reach, distance^2/height [m], "
        "w the image rate [rad/s]",
        f"angle [mrad]: {1e3 * angle['floor']:.2f}, {1e3 * angle['per_m']:.2f} r, {1e3 * angle['per_rad_s']:.2f} w, "
        f"added in squares; between flights x exp(N(0, {angle['spread']:.2f}))",
        f"distance [%]: {1e2 * distance['floor']:.2f}, {1e2 * distance['per_m']:.2f} r, "
        f"{1e2 * distance['per_rad_s']:.2f} w; between flights x exp(N(0, {distance['spread']:.2f}))",
        f"bias that lasts a flight: {1e3 * laws['bias_rad']:.2f} mrad of each angle, scale {1e2 * laws['scale']:.2f} %",
        f"missed: {100 * missed['share']:.1f} % low and slow, {100 * missed['share_at_max_height']:.1f} % at "
        f"{laws['max_height_m']:.3g} m, {100 * missed['share_at_blur']:.1f} % at {missed['blur_rad_s']:.1f} rad/s",
        f"hidden: {100 * a / (a + b):.1f} %, between flights Beta({a:.3f}, {b:.3f}); "
        f"false: {100 * laws['false_share']:.2f} %",
    ]


def _figure(value: float | None, scale: float) -> str:
    return "-" if value is None else f"{value * scale:.2f}"
