"""The datasheet of a pad camera as `flownav pad --out` writes it: what was measured, and what is assumed beside it."""

import math
from typing import NamedTuple

import numpy as np

from flownav.lab.optics.camera import Lens, field_angle_rad
from flownav.lab.optics.pad import PadTarget
from flownav.lab.optics.pad_statistics import PadLaws
from flownav.lab.optics.pad_trial import TrialCamera

SMALLEST_FIGURE = 1e-5  # a figure below this is none


class Assumed(NamedTuple):
    """Assumptions that no rendered frame shows: rate, latency and jitter, where the lens sits, and how far off it is
    mounted.

    A camera that is `mounting_deg` off, on top of what its calibration leaves, is so far off in all.
    """

    rate_hz: float
    latency_s: float
    jitter_s: float
    lens_m: tuple[float, float, float]
    mounting_deg: float


def datasheet(
    laws: PadLaws, trial: TrialCamera, camera_name: str, target: PadTarget, assumed: Assumed, command: str
) -> str:
    """TOML that `sensors.pad_camera_sheet` reads."""
    kind = "nested tag" if target.pattern == "nested" else target.pattern
    measured = f"measured in {laws.frames} frames of {laws.flights} cameras"
    lines = [
        "# A camera that looks down for a fiducial on the pad, as `flownav pad --out` measures it in rendered frames.",
        f"# {command}",
        "schema_version = 1",
        f'name = "camera {camera_name} and a {kind} of {target.side_m:g} m, {assumed.rate_hz:g} Hz"',
        f'provenance = "{measured} (docs/explanation/pad-target.md), but for what is marked as assumed"',
        f'camera = "{camera_name}"',
        *_camera_lines(laws, trial, target, assumed),
        *_noise_lines(laws, measured),
        *_missed_lines(laws, measured),
        "",
        "[lens]",
        _entry("forward_m", assumed.lens_m[0], "assumed: beside the flow camera"),
        f"right_m = {assumed.lens_m[1]:g}",
        _entry("down_m", assumed.lens_m[2], "assumed"),
    ]
    return "\n".join(lines) + "\n"


def _entry(name: str, value: float, source: str) -> str:
    return f'{name} = {{ value = {value if abs(value) > SMALLEST_FIGURE else 0.0:.4g}, source = "{source}" }}'


def _camera_lines(laws: PadLaws, trial: TrialCamera, target: PadTarget, assumed: Assumed) -> list[str]:
    """When the camera speaks, what it can see, and what it is wrong in as a whole."""
    camera = trial.camera
    lens = Lens(camera.nominal_focal_px, k1=trial.k1, k2=trial.k2)
    ahead, aside = np.degrees(field_angle_rad(lens, 0.5 * np.array([camera.width_px, camera.height_px])))
    a, b = laws.missed.hidden
    bias_deg, mounting_deg = math.degrees(laws.bias_rad), assumed.mounting_deg
    return [
        _entry("rate_hz", assumed.rate_hz, "assumed: LANDING_TARGET as detectors on small computers send it"),
        _entry("latency_s", assumed.latency_s, "assumed: exposure, detection and link"),
        _entry("jitter_s", assumed.jitter_s, "assumed: detection takes longer over clutter"),
        _entry("min_height_m", laws.min_height_m, "the lowest measured height at which half of whole pads are found"),
        _entry("max_height_m", laws.max_height_m, "the greatest distance^2/height at which half of them are found"),
        _entry("half_view_deg", float(ahead), "of the lens, along its rows, which lie forward"),
        _entry("half_view_right_deg", float(aside), "along its columns"),
        _entry("side_m", target.inner.board_m, "of the tag with its white ring, which must be whole in view"),
        _entry("ratio", target.side_m / target.inner.side_m, "of the tag round it; 1: there is none"),
        _entry(
            "boresight_deg",
            math.hypot(mounting_deg, bias_deg),
            f"mounting {mounting_deg:g} (assumed) and calibration {bias_deg:.2f} (measured), added in squares",
        ),
        _entry("scale_percent", 100.0 * laws.scale, "what a calibration leaves of focal length and distortion"),
        _entry("hidden_share", a / (a + b), f"shadows, glare, covers; between flights Beta({a:.3f}, {b:.3f})"),
        "stated_spread = 0.0  # it states what stands here",
        _entry("false_share", laws.false_share, "as many as this many frames allow"),
    ]


def _noise_lines(laws: PadLaws, measured: str) -> list[str]:
    """The laws of angle and distance."""
    return [
        "",
        f"[angle]  # between flights times exp(N(0, {laws.angle.spread:.2f}))",
        _entry("floor_mrad", 1e3 * laws.angle.floor, measured),
        _entry("per_m_mrad", 1e3 * laws.angle.per_m, "likewise: few pixels"),
        _entry("per_rad_s_mrad", 1e3 * laws.angle.per_rad_s, "likewise: rolling shutter"),
        "",
        f"[distance]  # between flights times exp(N(0, {laws.distance.spread:.2f}))",
        _entry("floor_percent", 1e2 * laws.distance.floor, measured),
        _entry("per_m_percent", 1e2 * laws.distance.per_m, "likewise: few pixels"),
        _entry("per_rad_s_percent", 1e2 * laws.distance.per_rad_s, "likewise: rolling shutter"),
    ]


def _missed_lines(laws: PadLaws, measured: str) -> list[str]:
    """The law of what is missed."""
    return [
        "",
        "[missed]  # of frames in which nothing hides the pad",
        _entry("share", laws.missed.share, measured),
        _entry("share_at_max_height", max(laws.missed.share_at_max_height, laws.missed.share), "likewise"),
        _entry("share_at_blur", max(laws.missed.share_at_blur, laws.missed.share), "likewise"),
        _entry("blur_rad_s", laws.missed.blur_rad_s, "the image rate that one frame in ten exceeds"),
    ]
