"""The picture of a landing: to scale, where the record says it was, and moved along the record's own path."""

from __future__ import annotations

import re
from xml.etree import ElementTree

import numpy as np
import pytest

from flownav.report import path_picture as path_module
from flownav.report import series
from flownav.report.campaign_figures import Touchdowns
from flownav.report.cloud_picture import cloud_picture
from flownav.report.headline import flown_with, headline
from flownav.report.html import render
from flownav.report.landing import landing_picture
from flownav.report.landing_scene import FRAMES
from flownav.report.path_picture import path_picture
from flownav.report.sureness import three_sigma
from flownav.scoring.phases import NAMES, Phase
from report_records import flight, navigated, replay

SVG = "{http://www.w3.org/2000/svg}"
JOKER = {"main_rotor.radius_m": {"value": 0.89}, "main_rotor.hub_above_cg_m": 0.25, "tail_rotor.behind_cg_m": 1.065,
         "tail_rotor.radius_m": 0.155, "skids.cg_above_skid_m": 0.0}  # fmt: skip


def landed(**more):
    """The made landing, which touched 0.35 m north and 0.12 m east of the centre of a pad of 3 m."""
    record = navigated()
    contact = record.manifest["scores"]["touchdown"]["contact"]
    contact |= {"north_m": 0.35, "east_m": 0.12, "distance_m": float(np.hypot(0.35, 0.12))}
    record.manifest["pad_size_m"] = 3.0
    record.manifest.setdefault("parameters", {})
    record.manifest["parameters"] |= {"vehicle": JOKER, "scenario": {"wind": {"speed_20ft_m_s": 4.0,
                                                                              "from_direction_deg": 90.0}}}  # fmt: skip
    record.manifest |= more
    return record


def views(record, **options):
    root = ElementTree.fromstring(landing_picture(record, **options).svg)
    return root.findall(f"{SVG}g") or [view.find(f"{SVG}g") for view in root.findall(f"{SVG}svg")]


def floats(text):
    return np.array([float(number) for number in re.findall(r"-?\d+\.?\d*", text)])


def test_the_vehicle_the_pad_and_the_touchdown_are_to_one_scale():
    _, above, _ = views(landed())
    pad = next(one for one in above.iter(f"{SVG}rect") if one.get("class") == "pad")
    scale = float(pad.get("width")) / 3.0
    rotor = next(above.iter(f"{SVG}circle"))
    assert float(rotor.get("r")) == pytest.approx(0.89 * scale, abs=0.1)
    centre = np.array([float(pad.get("x")), float(pad.get("y"))]) + 1.5 * scale
    cross = next(one for one in above.iter(f"{SVG}path") if one.get("class") == "cross")
    corner = floats(cross.get("d"))[:2] + 6.0
    assert (corner - centre) / scale == pytest.approx([0.12, -0.35], abs=0.02)
    wind = next(one for one in above.iter(f"{SVG}g") if one.find(f"{SVG}path[@class='wind']") is not None)
    assert wind.get("transform").endswith("rotate(270)")  # from the east it blows to the west


def test_the_loop_is_the_records_own_path():
    record = landed()
    _, above, _ = views(record)
    scale = float(next(one for one in above.iter(f"{SVG}rect") if one.get("class") == "pad").get("width")) / 3.0
    moving = next(one for one in above.iter(f"{SVG}g") if one.get("class") == "moving vehicle")
    way = moving.find(f"{SVG}animateTransform")
    assert way.get("dur") == "5s"
    drawn = floats(way.get("values")).reshape(FRAMES, 2)
    touch_s, truth = record.manifest["scores"]["touchdown"]["contact"]["t_s"], record.tables["truth"]
    last = np.searchsorted(truth["t_s"], min(touch_s + 1.5, truth["t_s"][-1]))
    high_s = truth["t_s"][(-truth["pos_d_m"] > 2.0) & (truth["t_s"] < touch_s)][-1]
    first = np.searchsorted(truth["t_s"], min(high_s, touch_s - 8.0))
    moved = (drawn[-1] - drawn[0]) / scale
    expected = [truth[name][last] - truth[name][first] for name in ("pos_e_m", "pos_n_m")]
    assert moved == pytest.approx([expected[0], -expected[1]], abs=0.02)


def test_the_tube_is_three_sigma_of_what_the_filter_states():
    record = landed()
    estimate = record.tables["estimate"]
    estimate |= {f"std_pos_{axis}_m": np.full(len(estimate["t_s"]), 0.01 * k) for k, axis in enumerate("ned", 2)}
    _, above, _ = views(record)
    scale = float(next(one for one in above.iter(f"{SVG}rect") if one.get("class") == "pad").get("width")) / 3.0
    ellipses = list(above.iter(f"{SVG}ellipse"))
    tube = next(one for one in above.iter(f"{SVG}g") if one.get("class") == "tube")
    assert len(list(tube)) > 20
    first = next(iter(tube))
    assert float(first.get("rx")) == pytest.approx(3.0 * 0.03 * scale, abs=0.06)  # east is to the right
    assert float(first.get("ry")) == pytest.approx(3.0 * 0.02 * scale, abs=0.06)
    assert first in ellipses
    estimate["std_pos_n_m"] = np.full(len(estimate["t_s"]), np.nan)
    assert not [one for view in views(record) for one in view.iter(f"{SVG}g") if one.get("class") == "tube"]


def test_pad_fixes_say_how_sure_it_is_against_the_pad():
    record, fix_s = landed(), np.arange(10.0, 20.0, 0.1)
    names = ("tan_forward", "tan_right", "distance_m")
    count = len(fix_s)
    record.tables["pad"] = {
        "t_s": fix_s, **dict.fromkeys(names[:2], np.zeros(count)),
        "distance_m": np.full(count, 2.0), "quality": np.full(count, 255.0),
    }  # fmt: skip
    inner = {"forward": 3e-4 + 1e-4, "right": 3e-4 + 1e-4, "distance_m": 3e-4 + 9e-4}
    record.tables["innovation"] = {
        "t_s": np.repeat(fix_s, 3), "sensor": np.array(["pad"] * 3 * count), "component": np.array(names * count),
        "observation": np.zeros(3 * count), "innovation": np.zeros(3 * count), "test_ratio": np.zeros(3 * count),
        "observation_variance": np.full(3 * count, 3e-4), "innovation_variance": np.tile(list(inner.values()), count),
        "fused": np.ones(3 * count), "reason": np.array([""] * 3 * count),
    }  # fmt: skip
    near, far = three_sigma(record, np.array([15.0, 25.0]))
    assert near == pytest.approx([3 * 0.02, 3 * 0.02, 3 * 0.03])  # 0.01 m per metre of distance, at 2 m
    assert np.isnan(far).all()


def test_the_phases_colour_the_path():
    side = views(landed())[0]
    coloured = [one.get("style") for one in side.iter(f"{SVG}polyline") if one.get("class") == "phase-way"]
    named = [text.text for text in side.iter(f"{SVG}text")]
    assert coloured
    assert all(re.search(r"phase-(\w+)", style)[1] in named for style in coloured)


def test_the_vehicle_is_never_drawn_over_the_key_of_the_phases():
    side, _, _ = views(landed())
    key = [float(one.get("y")) for one in side.iter(f"{SVG}rect") if "phase" in (one.get("style") or "")]
    moving = next(one for one in side.iter(f"{SVG}g") if one.get("class") == "moving vehicle")
    skids_px = floats(moving.find(f"{SVG}animateTransform").get("values")).reshape(-1, 2)[:, 1].min()
    scale = next(float(one.get("width")) for one in side.iter(f"{SVG}rect") if one.get("class") == "pad") / 3.0
    assert max(key) + 10.0 < skids_px - 0.25 * scale  # the hub stands 0.25 m over the skids of this vehicle
    assert len(key) == len({text.text for text in side.iter(f"{SVG}text")} & set(NAMES))


def test_wind_is_clear_of_the_pad():
    _, above, _ = views(landed())
    pad = next(one for one in above.iter(f"{SVG}rect") if one.get("class") == "pad")
    words = next(one for one in above.iter(f"{SVG}text") if one.get("class") == "windtext")
    arrow = next(one for one in above.iter(f"{SVG}g") if one.find(f"{SVG}path[@class='wind']") is not None)
    assert float(words.get("y")) + 4.0 < float(pad.get("y"))
    assert floats(arrow.get("transform"))[1] + 15.0 < float(pad.get("y"))  # half its length below its middle


def test_the_heading_of_the_side_view_is_below_a_whole_turn():
    record = landed()
    truth = record.tables["truth"]
    half = np.radians(-0.2) / 2.0
    truth |= {"qw": np.full(len(truth["t_s"]), np.cos(half)), "qz": np.full(len(truth["t_s"]), np.sin(half))}
    truth |= {name: np.zeros(len(truth["t_s"])) for name in ("qx", "qy")}
    title = next(one.text for one in views(record)[0].iter(f"{SVG}text") if one.get("class") == "title")
    assert title.endswith("heading 0°")


def test_many_flights_give_the_ring_and_their_dots():
    assert not [one for view in views(landed()) for one in view.iter() if one.get("class") == "ring"]
    many = {"flights": 48, "r95_m": 0.5, "north_m": [0.1, 0.2, -0.3], "east_m": [0.0, 0.1, 0.2]}
    close = views(landed(many=many))[2]
    ring = next(one for one in close.iter(f"{SVG}circle") if one.get("class") == "ring")
    dots = [one for one in close.iter(f"{SVG}circle") if one.get("class") == "other"]
    centre = np.array([float(ring.get("cx")), float(ring.get("cy"))])
    at = np.array([[float(dot.get("cx")), float(dot.get("cy"))] for dot in dots]) - centre
    assert 0.5 * at / float(ring.get("r")) == pytest.approx(np.array([[0.0, -0.1], [0.1, -0.2], [0.2, 0.3]]), abs=0.003)
    assert "R95 0.500 m of 48 flights" in "".join(close.itertext())


def test_the_page_begins_with_it_and_does_without_where_nothing_landed():
    page = render(landed())
    assert page.index('class="landing"') < page.index('class="tiles"')
    assert landing_picture(flight("takeoff")) is None
    assert "The path from above" in render(flight("takeoff"))
    for contact in ({}, {"t_s": 20.0, "distance_m": float("nan")}, {"t_s": 20.0, "distance_m": "far"}):
        record = landed()
        record.manifest["scores"]["touchdown"]["contact"] = contact
        assert landing_picture(record) is None


def test_alone_it_brings_its_colours_and_its_quadrotor():
    record = landed()
    record.manifest["parameters"]["vehicle"] = {
        "frame.arm_m": 0.225,
        "frame.rotor_count": 4,
        "propeller.radius_m": 0.127,
    }
    picture = landing_picture(record, alone=True)
    assert "prefers-color-scheme:dark" in picture.svg
    assert "var(--truth)" in picture.svg
    assert "--truth:#" in picture.svg
    ground = next(one for one in ElementTree.fromstring(picture.svg).iter(f"{SVG}rect"))
    assert ground.get("class") == "ground"  # dark ink on a page that is light, and the other way round, is read on it
    assert ".landing .ground{fill:var(--surface)}" in picture.svg
    _, above, _ = views(record, alone=True)
    still = next(one for one in above.iter(f"{SVG}g") if one.get("class") == "still vehicle")
    assert len(still.findall(f"{SVG}circle")) == 4


def test_the_first_lines_say_whether_it_landed_where_how_sure_and_what_limited_it():
    record = landed()
    estimate = record.tables["estimate"]
    estimate |= {f"std_pos_{axis}_m": np.full(len(estimate["t_s"]), 0.01 * k) for k, axis in enumerate("ned", 2)}
    touchdown = record.manifest["scores"]["touchdown"]
    touchdown |= {"limited_by": {"estimate_m": 0.1, "guidance_m": 0.34, "pad_m": 0.0}}
    said = headline(record)
    assert said.startswith("It landed: it touched 0.370 m from the pad's centre.")
    assert "within 0.090 m" in said  # three sigma of the less certain axis, east
    assert "The largest part of that distance is due to guidance (0.340 m)" in said
    assert said in render(record).replace("&#39;", "'")
    assert headline(landed(scores={"touchdown": {"reason": "no pad in sight"}})) == "It did not land: no pad in sight."
    touchdown["broken"] = ["sinking at 2 m/s"]
    assert headline(record).startswith("It crashed 0.370 m from the pad's centre: sinking at 2 m/s.")
    assert headline(replay()) == ""
    many = {"flights": 48, "r95_m": 0.5, "north_m": [0.1] * 47, "east_m": [0.0] * 47}
    assert headline(landed(many=many, flight=6)).startswith(
        "47 of 48 flights touched the ground, 95 % within 0.500 m of the pad's centre. This is flight 6, "
    )
    assert headline(landed(many={**many, "r95_m": None})).startswith("47 of 48 flights touched the ground. ")
    assert "Filter landing" not in render(record)
    assert "Simulated" in flown_with(record)
    assert "seed" in flown_with(record)


def test_a_log_has_its_path_with_the_cut_of_gps_and_its_height_by_phase():
    record = replay()
    path, height = (view.find(f"{SVG}g") for view in ElementTree.fromstring(path_picture(record).svg))
    lines = {one.get("class"): floats(one.get("points")).reshape(-1, 2) for one in path.iter(f"{SVG}polyline")}
    assert {"way of-estimate", "cut"} <= set(lines)
    readings = next(one for one in path.iter(f"{SVG}path") if one.get("class") == "way of-gps")
    assert re.fullmatch(r"(M[-\d.]+ [-\d.]+h0)+", readings.get("d"))  # dots, which no line joins
    assert len(lines["way of-estimate"]) > 0
    spread = np.ptp(floats(readings.get("d")).reshape(-1, 3)[:, :2], axis=0)
    assert spread == pytest.approx(np.ptp(lines["way of-estimate"], axis=0), rel=0.1)
    estimate, cut = record.tables["estimate"], series.outages(record)[0]
    inside = (np.asarray(estimate["t_s"]) >= cut[0]) & (np.asarray(estimate["t_s"]) <= cut[1])
    whole, part = lines["way of-estimate"], lines["cut"]
    share = np.ptp(part[:, 0]) / np.ptp(whole[:, 0])
    assert share == pytest.approx(np.ptp(estimate["pos_e_m"][inside]) / np.ptp(estimate["pos_e_m"]), abs=0.1)
    drawn = next(one for one in height.iter(f"{SVG}polyline") if one.get("class") == "way of-estimate")
    y, height_m = floats(drawn.get("points")).reshape(-1, 2)[:, 1], -np.asarray(estimate["pos_d_m"])
    assert (y.argmin() / len(y)) == pytest.approx(height_m.argmax() / len(height_m), abs=0.02)
    assert any(one.get("class") == "band" for one in height.iter(f"{SVG}rect"))
    assert render(record).index("The path from above") < render(record).index('class="tiles"')
    assert "GPS withheld" in "".join(path.itertext())
    for name in ("estimate", "gps_position", "autopilot", "truth", "smoothed"):
        record.tables.pop(name, None)
    assert path_picture(record) is None


def test_the_dot_on_a_logs_path_flies_what_was_in_the_air_and_no_long_stand(monkeypatch):
    record, seconds = replay(), {}
    start, end = series.start_end_s(record)
    air = [("ground", start, 30.0), ("climb", 30.0, 40.0), ("hover", 40.0, 50.0), ("landed", 50.0, end)]
    for name, phases in (("flown", air), ("stood", [("ground", start, end)])):
        monkeypatch.setattr(path_module, "phases_of", lambda _, made=phases: [Phase(*one) for one in made])
        height = ElementTree.fromstring(path_picture(record).svg).findall(f"{SVG}svg")[1]
        (moved,) = height.iter(f"{SVG}animateTransform")
        x_px = floats(moved.get("values")).reshape(-1, 2)[:, 0]
        left, right = 34.0, path_module.HEIGHT_PX - 8.0
        seconds[name] = start + (x_px[[0, -1]] - left) / (right - left) * (end - start)
    assert seconds["flown"] == pytest.approx([28.0, 52.0], abs=0.2)
    assert seconds["stood"] == pytest.approx([start, end], abs=0.2)
    words = path_picture(record).words
    assert "The others are shifted so that they agree with it or with GPS on average." in words


def test_a_campaigns_picture_has_every_touchdown_and_its_rings_to_scale():
    north, east = np.array([0.1, -0.2, np.inf]), np.array([0.0, 0.3, np.inf])
    touched = Touchdowns(north, east, np.hypot(north, east), 2.0)
    cell = {
        "label": "landing",
        "figures": {"r50_m": {"value": 0.1}, "r95_m": {"value": 0.4}, "r997_m": {"value": None}},
    }
    pad, near = (view.find(f"{SVG}g") for view in ElementTree.fromstring(cloud_picture(cell, touched).svg))
    square = next(one for one in pad.iter(f"{SVG}rect") if one.get("class") == "pad")
    scale = float(square.get("width")) / 2.0
    rings = [float(one.get("r")) for one in pad.iter(f"{SVG}circle") if one.get("class") == "ring"]
    assert rings == pytest.approx([0.1 * scale, 0.4 * scale], abs=0.1)
    dots = [one for one in near.iter(f"{SVG}circle") if one.get("class") == "other"]
    ring = [float(one.get("r")) for one in near.iter(f"{SVG}circle") if one.get("class") == "ring"][1]
    apart = float(dots[1].get("cx")) - float(dots[0].get("cx")), float(dots[0].get("cy")) - float(dots[1].get("cy"))
    assert np.array(apart) * 0.4 / ring == pytest.approx([0.3, -0.3], abs=0.002)
    assert len(dots) == 2
    assert "R95 0.400 m" in "".join(near.itertext())
    assert cloud_picture(cell, Touchdowns(north[2:], east[2:], north[2:], 2.0)) is None
