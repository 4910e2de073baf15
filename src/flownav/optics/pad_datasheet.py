"""The datasheet of a pad camera as `flownav pad --out` writes it: what was measured, and what is assumed beside it."""

from __future__ import annotations

import math

import numpy as np

from flownav.optics.lens import Lens, field_angle_rad
from flownav.optics.pad_statistics import PadLaws
from flownav.optics.pad_target import PadTarget
from flownav.optics.pad_trial import TrialCamera

SMALLEST = 1e-5  # a figure below this is none


def datasheet(
    laws: PadLaws, trial: TrialCamera, camera_name: str, target: PadTarget, mounting_deg: float, command: str, *,
    rate_hz: float, latency_s: float, jitter_s: float, lens_m: tuple[float, float, float],
) -> str:  # fmt: skip
    """TOML that `sensors.pad_camera_sheet` reads. rate, latency, jitter and the lens's place are not measured here.

    A camera that is `mounting_deg` off, on top of what its calibration leaves, is so far off in all.
    """
    camera = trial.camera
    lens = Lens(camera.nominal_focal_px, k1=trial.k1, k2=trial.k2)
    ahead, aside = np.degrees(field_angle_rad(lens, 0.5 * np.array([camera.width_px, camera.height_px])))
    a, b = laws.missed.hidden
    bias_deg = math.degrees(laws.bias_rad)

    def entry(name: str, value: float, source: str) -> str:
        return f'{name} = {{ value = {value if abs(value) > SMALLEST else 0.0:.4g}, source = "{source}" }}'

    kind = "nested tag" if target.pattern == "nested" else target.pattern
    measured = f"measured in {laws.frames} frames of {laws.flights} cameras"
    lines = [
        "# A camera that looks down for a fiducial on the pad, as `flownav pad --out` measures it in rendered frames.",
        f"# {command}",
        "schema_version = 1",
        f'name = "camera {camera_name} and a {kind} of {target.side_m:g} m, {rate_hz:g} Hz"',
        f'provenance = "{measured} (docs/explanation/pad-target.md), but for what is marked as assumed"',
        f'camera = "{camera_name}"',
        entry("rate_hz", rate_hz, "assumed: LANDING_TARGET as detectors on small computers send it"),
        entry("latency_s", latency_s, "assumed: exposure, detection and link"),
        entry("jitter_s", jitter_s, "assumed: detection takes longer over clutter"),
        entry("min_height_m", laws.min_height_m, "the lowest measured height at which half of whole pads are found"),
        entry("max_height_m", laws.max_height_m, "the greatest distance^2/height at which half of them are found"),
        entry("half_view_deg", float(ahead), "of the lens, along its rows, which lie forward"),
        entry("half_view_right_deg", float(aside), "along its columns"),
        entry("side_m", target.inner.board_m, "of the tag with its white ring, which must be whole in view"),
        entry("ratio", target.side_m / target.inner.side_m, "of the tag round it; 1: there is none"),
        entry(
            "boresight_deg",
            math.hypot(mounting_deg, bias_deg),
            f"mounting {mounting_deg:g} (assumed) and calibration {bias_deg:.2f} (measured), added in squares",
        ),
        entry("scale_percent", 100.0 * laws.scale, "what a calibration leaves of focal length and distortion"),
        entry("hidden_share", a / (a + b), f"shadows, glare, covers; between flights Beta({a:.3f}, {b:.3f})"),
        "stated_spread = 0.0  # it states what stands here",
        entry("false_share", laws.false_share, "as many as this many frames allow"),
        "",
        f"[angle]  # between flights times exp(N(0, {laws.angle.spread:.2f}))",
        entry("floor_mrad", 1e3 * laws.angle.floor, measured),
        entry("per_m_mrad", 1e3 * laws.angle.per_m, "likewise: few pixels"),
        entry("per_rad_s_mrad", 1e3 * laws.angle.per_rad_s, "likewise: rolling shutter"),
        "",
        f"[distance]  # between flights times exp(N(0, {laws.distance.spread:.2f}))",
        entry("floor_percent", 1e2 * laws.distance.floor, measured),
        entry("per_m_percent", 1e2 * laws.distance.per_m, "likewise: few pixels"),
        entry("per_rad_s_percent", 1e2 * laws.distance.per_rad_s, "likewise: rolling shutter"),
        "",
        "[missed]  # of frames in which nothing hides the pad",
        entry("share", laws.missed.share, measured),
        entry("share_at_max_height", max(laws.missed.share_at_max_height, laws.missed.share), "likewise"),
        entry("share_at_blur", max(laws.missed.share_at_blur, laws.missed.share), "likewise"),
        entry("blur_rad_s", laws.missed.blur_rad_s, "the image rate that one frame in ten exceeds"),
        "",
        "[lens]",
        entry("forward_m", lens_m[0], "assumed: beside the flow camera"),
        f"right_m = {lens_m[1]:g}",
        entry("down_m", lens_m[2], "assumed"),
    ]
    return "\n".join(lines) + "\n"
