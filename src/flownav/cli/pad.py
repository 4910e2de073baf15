"""`flownav pad`: the landing target, printed, found in a user's own pictures, or measured in rendered frames."""

from __future__ import annotations

import math
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any

import typer

from flownav.cli import options, output
from flownav.cli.options import chosen, numbers, option, out_option
from flownav.core.errors import InputError
from flownav.core.text import finite

if TYPE_CHECKING:
    from flownav.lab.optics.pad import PadTarget
    from flownav.lab.optics.pad_trial import Trials

HEIGHTS = ["0.15,0.175,0.2,0.3,0.5,1,2,3,4"]
SPEEDS = ["0.1,0.5,1.5"]
WIDE = 110  # columns of the table of what was measured


SIDE = "Side of the tag's black square, or of a plain pad [m]."
FOCAL = "Focal length of your pictures [px], undistorted."
IMAGE_X = "Where the pictures' right is, clockwise from body forward."
FOCUS = "Where its lens is focused [m]."
AT = "Heights to measure at [m], repeated or with commas."
FLYING = "Speeds over ground [m/s], repeated or with commas."
EACH = "Cameras, each on a flight of its own."
MOUNTING = "How well it is mounted, for the datasheet."
SHEET = "The datasheet (TOML), which a scenario's [sensors] name"
PICTURES = "A folder for one frame of each flight and height."
PRINT = "Only write the target as a PNG of true size."
YOURS = "Your pictures: a folder, pictures, or one video. None: measure."
FOUND = (
    output.Column("frame", "frame", ""),
    output.Column("tan forward", lambda row: _of_fix(row, "tan_forward", ".5f")),
    output.Column("tan right", lambda row: _of_fix(row, "tan_right", ".5f")),
    output.Column("distance [m]", lambda row: _of_fix(row, "distance_m", ".4f")),
    output.Column("heading [deg]", lambda row: _of_fix(row, "heading_rad", ".2f", 57.29577951308232)),
    output.Column("what became of it", "reason"),
)
MEASURED = (
    output.Column("height [m]", "height_m", "g"),
    output.Column("speed [m/s]", "speed_m_s", "g"),
    output.Column("rate [rad/s]", "image_rate_rad_s", ".2f"),
    output.Column("in view", lambda row: f"{row['in_view']}/{row['frames']}"),
    output.Column("found", "found"),
    output.Column("wrong", "wrong"),
    output.Column("angle [mrad]", "angle_sigma_rad", ".2f", 1e3),
    output.Column("distance [%]", "distance_sigma", ".2f", 1e2),
    output.Column("heading [mrad]", "heading_sigma_rad", ".2f", 1e3),
)


def command(
    frames: Annotated[list[Path] | None, typer.Argument(help=YOURS, show_default=False)] = None,
    side: Annotated[float, option("M", SIDE)] = 0.2,
    pattern: Annotated[str, chosen("The pattern printed on the pad.", *options.PATTERNS)] = "tag",
    code: Annotated[int, option("N", "Which tag of AprilTag 36h11, 0 to 15.")] = 0,
    focal: Annotated[float | None, option("PX", FOCAL, unset=False, within=(1.0, 1e6))] = None,
    image_x: Annotated[float, option("DEG", IMAGE_X, "--image-x-deg")] = 0.0,
    camera: Annotated[str, chosen("The camera to measure with.", *options.CAMERAS)] = "wide120",
    focus: Annotated[float | None, option("M", FOCUS, unset="as built", within=(0.05, 1000.0))] = None,
    heights: Annotated[list[str], option("M", AT)] = HEIGHTS,
    speeds: Annotated[list[str], option("M/S", FLYING)] = SPEEDS,
    flights: Annotated[int, option("N", EACH, within=(2, 100_000))] = 24,
    count: Annotated[int, option("N", "Frames a flight, height and speed.", "--frames", within=(1, 100_000))] = 2,
    tilt: Annotated[float, option("DEG", "Greatest tilt.", "--tilt-deg", within=(0.0, 45.0))] = 15.0,
    mounting: Annotated[float, option("DEG", MOUNTING, "--mounting-deg", within=(0.0, 5.0))] = 0.4,
    seed: options.Seed = 1,
    out: Annotated[Path | None, out_option(SHEET)] = None,
    force: options.Force = False,
    pictures: Annotated[Path | None, option("PATH", PICTURES, unset=False)] = None,
    print_to: Annotated[Path | None, option("PATH", PRINT, "--print", unset=False)] = None,
    as_json: options.Json = False,
) -> None:
    """Where the pad is from the lens: angles, distance, heading; and how well, by height."""
    from flownav.lab.optics.pad import PadTarget, checked
    from flownav.lab.optics.pad_trial import Trials

    target = checked(PadTarget(side, pattern, code))
    if print_to is not None:
        return _print_target(target, output.place(print_to, force=force), as_json)
    if frames:
        found = _found(frames, target, focal, image_x)
        summary = f"found in {found['found']} of {found['frames']} frames"
        return output.answer(found, as_json, lambda: output.say(output.table_of(FOUND, found["per_frame"]), summary))
    datasheet = None if out is None else output.place(out, force=force)
    frames_in = None if pictures is None else output.folder_place(pictures)
    at_m = sorted(set(numbers("--heights", heights, 0.05, 50.0)))
    at_m_s = sorted(set(numbers("--speeds", speeds, 0.0, 50.0)))
    trials = Trials(at_m, at_m_s, flights, count, math.radians(tilt), seed)
    facts = _measured(target, camera, focus, trials, tilt, frames_in)
    if datasheet is not None:
        facts["datasheet"] = _write_datasheet(datasheet, facts, target, camera, focus, mounting)
    plain = _plain(facts)
    output.answer(plain, as_json, lambda: _show_measured(plain))


def _print_target(target: PadTarget, picture: Path, as_json: bool) -> None:
    """The target as a picture of its true size."""
    from flownav.lab.optics.pad import print_target

    print_target(target, picture)
    facts: dict[str, Any] = {"target": target._asdict(), "picture": str(picture)}
    output.answer(facts, as_json, lambda: typer.echo(f"{picture}: print it at 100 %, and measure its side"))


# -- a user's own pictures ------------------------------------------------------------------------------------------
def _found(frames: list[Path], target: PadTarget, focal_px: float | None, image_x_deg: float) -> dict[str, Any]:
    import numpy as np

    from flownav.core.compile import announce_compilation
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


def _of_fix(row: dict[str, Any], key: str, form: str, scale: float = 1.0) -> str:
    return output.figure(row[key], form, scale) if row["reason"] == "found" else ""


# -- rendered frames --------------------------------------------------------------------------------------------------
def _measured(
    target: PadTarget,
    camera_name: str,
    focus_m: float | None,
    trials: Trials,
    tilt_deg: float,
    pictures: Path | None,
) -> dict[str, Any]:
    from flownav.core.compile import announce_compilation
    from flownav.lab.optics.pad_statistics import laws_of
    from flownav.lab.optics.pad_trial import camera_named, fly_cameras

    trial, shown = camera_named(camera_name, focus_m), target.inner  # the outer is the same tag, five times as large
    with announce_compilation("pad"), output.progress("flights", trials.flights) as advance:
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
    """A value as JSON has it: NaN is null, laws are objects."""
    laws = facts["laws"]._asdict()
    laws |= {name: laws[name]._asdict() for name in ("angle", "distance", "missed")}
    return facts | {"laws": laws, "cells": finite(facts["cells"])}


def _write_datasheet(
    out: Path, facts: dict[str, Any], target: PadTarget, camera_name: str, focus_m: float | None, mounting_deg: float
) -> str:
    from flownav.core.guard import write_text
    from flownav.core.provenance import command_line
    from flownav.lab.optics.pad_datasheet import Assumed, datasheet
    from flownav.lab.optics.pad_trial import camera_named
    from flownav.sensors.camera_sheets import PadCameraSheet

    sheet = PadCameraSheet.read()
    lens_m = (float(sheet.lens.forward_m), float(sheet.lens.right_m), float(sheet.lens.down_m))
    assumed = Assumed(float(sheet.rate_hz), float(sheet.latency_s), float(sheet.jitter_s), lens_m, mounting_deg)
    trial = camera_named(camera_name, focus_m)
    text = datasheet(facts["laws"], trial, camera_name, target, assumed, command_line())
    write_text(text, out)
    PadCameraSheet.read(out)
    return str(out)


def _show_measured(facts: dict[str, Any]) -> None:
    target, camera, laws = facts["target"], facts["camera"], facts["laws"]
    output.say(
        f"{target['pattern']} of {target['side_m']:g} m, tilt to {facts['tilt_deg']:g} deg; "
        f"{facts['flights']} cameras {camera['name']}, {laws['frames']} frames",
        output.table_of(MEASURED, facts["cells"], left=0, **output.plain_look()),
        *_law_lines(laws),
        *([f"datasheet: {facts['datasheet']}"] if "datasheet" in facts else []),
        wide=WIDE,
    )


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
