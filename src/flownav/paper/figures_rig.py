"""The paper's figures 2, 3, 8, 10 to 13 and 15 from the synthetic rig; plain figures, something against something."""

from typing import Any

import numpy as np
from numpy.typing import ArrayLike

from flownav.core.measurement import Array
from flownav.lab.optics.camera import FIRMWARE_FOCAL_PX, Camera, effective_focal_px, refocused
from flownav.lab.optics.firmware import EARLY_GYRO_SCALE, firmware_named
from flownav.lab.optics.flow import flow_of_frames, raw_flow
from flownav.lab.optics.pad import BLACK, WHITE, Pad, stripes, texture
from flownav.lab.optics.projection import pose_looking_down
from flownav.lab.optics.render import film
from flownav.lab.rig.experiment import RigLog
from flownav.paper.laboratory import Laboratory, reading
from flownav.paper.published import HEIGHTS_M
from flownav.report.chart import Stack, drawn
from flownav.report.panels import Panel
from flownav.report.style import COLOUR, axis, drawing, layout

PAPER, HERE = "gps", "estimate"  # whose figures: the colour of each
GREY = [[0, "rgb(0,0,0)"], [1, "rgb(255,255,255)"]]
HEIGHT_COLOURS = dict(zip(HEIGHTS_M, ("estimate", "flow", "gps", "autopilot"), strict=True))
HEIGHT_SYMBOLS = dict(zip(HEIGHTS_M, ("circle", "square", "diamond", "triangle-up"), strict=True))


def dots(name: str, colour: str, x: ArrayLike, y: ArrayLike, **style: Any) -> dict[str, Any]:
    """A cloud of markers; style: parts of the marker."""
    marker = {"color": COLOUR[colour], "size": 7, "opacity": 0.75, **style}
    return _trace(name, x, y, {"mode": "markers", "marker": marker})


def line(
    name: str, colour: str, x: ArrayLike, y: ArrayLike, dash: str = "solid", width: float = 1.6, markers: bool = False
) -> dict[str, Any]:
    """A line, with markers at its points if asked."""
    style = {"mode": "lines+markers" if markers else "lines", "marker": {"size": 7}}
    return _trace(name, x, y, {**style, "line": {"color": COLOUR[colour], "width": width, "dash": dash}})


def _trace(name: str, x: ArrayLike, y: ArrayLike, style: dict[str, Any]) -> dict[str, Any]:
    points = {"x": drawn(np.asarray(x, float)), "y": drawn(np.asarray(y, float))}
    return {"type": "scatter", "name": name, **points, "hovertemplate": "%{x:.3g}, %{y:.4g}", **style}


def figure(
    traces: list[dict[str, Any]], x_title: str, y_title: str, height_px: int = 380, **axes: dict[str, Any]
) -> Any:
    """The Plotly figure; axes: what xaxis and yaxis have beside their looks."""
    looks = layout(height_px) | {"hovermode": "closest"}
    looks["xaxis"] = axis(x_title) | {"zeroline": False} | axes.get("xaxis", {})
    looks["yaxis"] = axis(y_title) | {"zeroline": False} | axes.get("yaxis", {})
    return drawing(traces, looks)


def pictures(images: list[tuple[str, ArrayLike]], height_px: int = 300) -> Any:
    """Grey pictures 0 to 255 side by side, each with its title; rows run downwards."""
    looks = layout(height_px) | {"hovermode": "closest", "annotations": []}
    data, gap = [], 0.06
    width = (1.0 - gap * (len(images) - 1)) / len(images)
    for k, (title, image) in enumerate(images, 1):
        left = (k - 1) * (width + gap)
        number = "" if k == 1 else str(k)
        look: dict[str, Any] = {"zmin": 0, "zmax": 255, "colorscale": GREY, "showscale": False}
        place = {"xaxis": f"x{number}", "yaxis": f"y{number}", "hovertemplate": "%{x}, %{y}: grey %{z}"}
        data.append({"type": "heatmap", "name": title, "z": np.asarray(image, np.uint8), **look, **place})
        square = {"showgrid": False, "zeroline": False, "constrain": "domain"}
        across = {"domain": [left, left + width], "anchor": f"y{number}"}
        down = {"anchor": f"x{number}", "scaleanchor": f"x{number}", "autorange": "reversed", "constraintoward": "top"}
        looks[f"xaxis{number}"] = axis("pixels") | square | across
        looks[f"yaxis{number}"] = axis() | square | down
        over = {"x": left + 0.5 * width, "y": 1.0, "xref": "paper", "yref": "paper"}
        middle = {"xanchor": "center", "yanchor": "bottom", "showarrow": False}
        looks["annotations"].append({"text": title, "font": {"size": 12, "color": COLOUR["ink"]}, **over, **middle})
    return drawing(data, looks)


def heights_axis() -> dict[str, Any]:
    """An axis of the four heights."""
    return {"tickvals": list(HEIGHTS_M), "range": [0.5, 1.6]}


FRAME_RATE_HZ = 250.0
SPEED_M_S = 0.35
NUMBERS = dict(zip(HEIGHTS_M, (10, 11, 12, 13), strict=True))
TILT_HEIGHT_M, PAD_M, TILT_RAD = 3.0, 1.0, np.radians(9.5)
ROCK_S, ROCK_HZ, ROCK_RAD, ROCK_HEIGHT_M = 2.0, 1.0, np.radians(8.0), 1.0


def depth() -> list[Panel]:
    """Figure 2: the pad from two heights, and the flow of one velocity against height."""
    images = [
        (
            f"{height:.1f} m: {1000 * 64 * height / FIRMWARE_FOCAL_PX:.0f} mm in view",
            film(stripes(), [pose_looking_down(height_m=height)], camera=_focused(height))[0],
        )
        for height in (HEIGHTS_M[0], HEIGHTS_M[-1])
    ]
    heights = np.linspace(0.5, 1.6, 12)
    flows = np.array([_flow_of_velocity(float(height)) for height in heights])
    ideal = [SPEED_M_S / FRAME_RATE_HZ / h * effective_focal_px(_focused(float(h))) for h in heights]
    traces = [
        line("f v/(fps h)", "truth", heights, ideal, dash="5px,3px"),
        dots("block matching", "flow", heights, flows),
    ]
    frames = "One frame of 64 by 64 pixels from each height: the nearer camera sees fewer, wider lines."
    curve = f"The same {SPEED_M_S} m/s moves the image less the farther the pad is; the firmware's matching, in steps "
    curve += "of half a pixel, against the motion field."
    plot = figure(traces, "height (m)", "flow (px a frame)", yaxis={"rangemode": "tozero"})
    return [
        Panel("figure-2-frames", "Figure 2: the pad from near and from far", frames, frames, pictures(images)),
        Panel("figure-2-flow", "Figure 2: flow against depth", curve, "Flow against height. " + curve, plot),
    ]


def _focused(height_m: float) -> Camera:
    return refocused(Camera(), height_m, 1.0)


def _flow_of_velocity(height_m: float, frames: int = 21) -> float:
    """Mean flow [px a frame] that the 2014 firmware's matching sees at SPEED_M_S."""
    poses = [pose_looking_down(x_m=k * SPEED_M_S / FRAME_RATE_HZ, height_m=height_m) for k in range(frames)]
    flow, _ = raw_flow(film(texture(), poses, camera=_focused(height_m)), firmware_named("2014-12"))
    return float(abs(flow[:, 0].mean()))


def rotation() -> list[Panel]:
    """Figure 3: what a roll does to the view, and to the flow before and after compensation."""
    camera = _focused(TILT_HEIGHT_M)
    views = [
        (title, film(_pad_on_ground(), [pose_looking_down(height_m=TILT_HEIGHT_M, roll_rad=angle)], camera=camera)[0])
        for title, angle in (("(a) level", 0.0), (f"(b) rolled by {np.degrees(TILT_RAD):.1f}°", TILT_RAD))
    ]
    t_s = np.arange(0.0, ROCK_S, 1.0 / FRAME_RATE_HZ)
    angle = ROCK_RAD * np.sin(2.0 * np.pi * ROCK_HZ * t_s)
    rates = np.zeros((len(t_s), 3))
    rates[:, 1] = np.gradient(angle, t_s)
    poses = [pose_looking_down(height_m=ROCK_HEIGHT_M, pitch_rad=float(a)) for a in angle]
    frames = film(texture(), poses, camera=_focused(ROCK_HEIGHT_M))
    stack = Stack(("velocity it reports (m/s)",), row_height_px=245)
    for role, name, firmware, given in (
        ("flow", "not compensated", "2014-12", None),
        ("gps", "gyro scale of 2013", "2014-12,+gyro-scale", rates),
        ("estimate", "exact gyro scale", "2014-12", rates),
    ):
        series = flow_of_frames(frames, FRAME_RATE_HZ, rates_rad_s=given, range_m=ROCK_HEIGHT_M, firmware=firmware)
        stack.line(1, role, name, _smoothed(series.time_s), _smoothed(series.velocity_m_s[:, 0]))
    figure = stack.chart((0.0, ROCK_S))
    view = f"A pad of {PAD_M:g} m from {TILT_HEIGHT_M:g} m; {np.degrees(TILT_RAD):.1f}° of roll move the view by "
    view += f"{TILT_HEIGHT_M * np.tan(TILT_RAD):.2f} m."
    flow = f"The camera rocks by ±{np.degrees(ROCK_RAD):.0f}° at {ROCK_HEIGHT_M:g} m and does not move: what is not "
    flow += f"compensated reads as velocity. The firmware of 2013 takes out {100.0 * EARLY_GYRO_SCALE:.0f} % of it."
    return [
        Panel("figure-3-frames", "Figure 3: a roll takes the pad out of view", view, view, pictures(views)),
        Panel("figure-3-flow", "Figure 3: flow of a rotation", flow, "Reported velocity over time. " + flow, figure),
    ]


def _pad_on_ground(texel_m: float = 0.00175) -> Pad:
    """A striped square on plain ground, repeated every two of its sides."""
    half = round(0.5 * PAD_M / texel_m)
    ground = np.full((4 * half, 4 * half), 0.5 * (BLACK + WHITE), np.float32)
    lines = np.where((np.arange(2 * half) // 4) % 2 == 0, WHITE, BLACK).astype(np.float32)
    ground[half : 3 * half, half : 3 * half] = lines
    return Pad("a pad on the ground", np.roll(ground, (-2 * half, -2 * half), (0, 1)), texel_m)


def _smoothed(values: Array, frames: int = 11) -> Array:
    return np.convolve(values, np.full(frames, 1.0 / frames), "valid")


def light(lights: tuple[RigLog, ...]) -> Panel:
    """Figure 8: the sensor beside the encoder in low and in intense light."""
    stack = Stack([f"{log.settings.light} light (m/s)" for log in lights], row_height_px=170)
    for row, log in enumerate(lights, 1):
        _beside_encoder(stack, row, log)
    sde = ", ".join(f"{log.settings.light} {_difference(log):.3f} m/s" for log in lights)
    caption = f"0.6 m. Standard deviation of sensor less encoder, delay included: {sde}."
    return Panel("figure-8", "Figure 8: low and intense light", caption, caption, stack.chart((0.0, 15.0)), wide=True)


def _difference(log: RigLog) -> float:
    return float((log.flow_velocity_m_s - log.reference_velocity_m_s).std())


def _beside_encoder(stack: Stack, row: int, log: RigLog) -> None:
    stack.line(row, "flow", "PX4FLOW, simulated", log.time_s, log.flow_velocity_m_s)
    stack.line(row, "truth", "encoder", log.time_s, log.reference_velocity_m_s)


def heights(laboratory: Laboratory) -> list[Panel]:
    """Figures 10 to 13: the sensor beside the encoder at the four heights, run 1."""
    panels = []
    for height_m, number in NUMBERS.items():
        log = laboratory.at(height_m)[0].log
        stack = Stack(("velocity (m/s)",), row_height_px=220)
        _beside_encoder(stack, 1, log)
        slow = np.abs(log.reference_velocity_m_s) < 0.5 * np.abs(log.reference_velocity_m_s).max()
        off = float((log.flow_velocity_m_s - log.reference_velocity_m_s)[slow].std())
        caption = (
            f"Rod of {log.rod_length_m:.1f} m. Below half the top speed the sensor is off by {off:.3f} m/s rms, its "
        )
        caption += "delay included."
        title = f"Figure {number}: sensor and encoder at {height_m:.1f} m"
        panels.append(Panel(f"figure-{number}", title, caption, caption, stack.chart((0.0, 25.0))))
    return panels


def validation(laboratory: Laboratory, height_m: float = 0.6) -> Panel:
    """Figure 15: each of the seven models of 60 cm on a run that it has not seen."""
    runs = laboratory.at(height_m)
    stack = Stack([f"TF{k} (m/s)" for k in range(1, len(runs) + 1)], row_height_px=104)
    window = (4.0, 14.0)
    for row, (run, unseen) in enumerate(zip(runs, [*runs[1:], runs[0]], strict=True), 1):
        shown = (unseen.log.time_s >= window[0]) & (unseen.log.time_s <= window[1])
        t_s = unseen.log.time_s[shown]
        stack.line(row, "flow", "PX4FLOW, simulated", t_s, unseen.log.flow_velocity_m_s[shown])
        stack.line(row, "estimate", "identified model", t_s, reading(run.dynamics, unseen.log)[shown])
        stack.line(row, "truth", "encoder", t_s, unseen.log.reference_velocity_m_s[shown])
    title = "Figure 15: validation of the seven models at 60 cm"
    caption = "Encoder into the model, its output beside the sensor's, ten seconds of each run."
    return Panel("figure-15", title, caption, caption, stack.chart(window), wide=True)
