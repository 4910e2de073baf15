"""The figures' data: thinning, moments, rotations, the radius of uncertainty, colours."""

from __future__ import annotations

import re

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from hypothesis.extra.numpy import arrays

from flownav.core.measurement import Sensor
from flownav.core.record import Record
from flownav.report.chart import CROSS_POINTS, DOT_POINTS, LINE_POINTS, Chart, sliding_rms, thin, thin_dots
from flownav.report.content import summary, tiles
from flownav.report.figures_errors import close_ups, error_against_gps, flown_errors, position_error
from flownav.report.figures_filter import consistency, radius_of_uncertainty
from flownav.report.figures_innovation import innovations
from flownav.report.figures_states import attitude, ground_track, path_over_pad, paths_of, position, velocity
from flownav.report.html import render, sections
from flownav.report.page_data import Columns, paths_data
from flownav.report.panels import Panel
from flownav.report.series import Moment, Track, euler_deg, flow_velocity, gps_velocity_body, moments, readings
from flownav.report.style import COLOUR, LIGHT_TO_DARK, PALETTE
from report_records import flight, navigated, replay

VALUES = st.floats(-1e6, 1e6, width=32)


@given(
    values=st.integers(0, 700).flatmap(lambda n: arrays(float, (n, 2), elements=VALUES | st.just(float("nan")))),
    budget=st.integers(40, 200),
)
@settings(max_examples=60, deadline=None)
@pytest.mark.parametrize("thinned", [thin, thin_dots])
def test_thinning_keeps_within_its_budget_and_keeps_the_extremes_and_the_ends(thinned, values, budget) -> None:
    rows = thinned(budget, *values.T)
    assert len(rows) <= budget or len(values) <= budget
    assert np.all(np.diff(rows) > 0)
    if len(values):
        assert (rows[0], rows[-1]) == (0, len(values) - 1)
    for column in values.T:
        known = column[~np.isnan(column)]
        if len(known):
            assert np.nanmin(column[rows]) == known.min()
            assert np.nanmax(column[rows]) == known.max()


def test_a_thinned_spike_of_one_sample_is_still_drawn() -> None:
    values = np.zeros(50_000)
    values[31_234] = 9.0
    assert 31_234 in thin(LINE_POINTS, values)
    assert 31_234 in thin_dots(DOT_POINTS, values)


def test_a_thinned_cloud_keeps_its_spread() -> None:
    values = np.random.default_rng(4).normal(size=40_000)
    assert np.std(values[thin_dots(DOT_POINTS, values)]) == pytest.approx(1.0, abs=0.25)


def test_no_trace_of_a_long_replay_exceeds_its_budget() -> None:
    for section in sections(replay(400.0)):
        for panel in section.panels:
            for trace in panel.figure.data if isinstance(panel.drawing, Chart) else ():
                assert len(trace.x) <= (DOT_POINTS if trace.mode == "markers" else 2 * LINE_POINTS + 2)  # a band twice


def test_moments_come_from_the_truth() -> None:
    assert [(m.name, round(m.t_s)) for m in moments(flight("landing"))] == [("touchdown", 20)]
    assert [(m.name, round(m.t_s)) for m in moments(flight("takeoff"))] == [("lift-off", 10)]


def test_the_scored_touchdown_stands_before_any_other() -> None:
    record = flight("landing")
    record.manifest["scores"]["touchdown"]["contact"]["t_s"] = 19.5
    assert moments(record) == [Moment(19.5, "touchdown")]
    record.manifest["scores"]["touchdown"] = None
    assert moments(record) == []


def test_a_bounce_after_touchdown_is_no_lift_off() -> None:
    record = Record()
    t_s = np.arange(6.0)
    record.add("truth", {"t_s": t_s, "on_ground": np.array([0, 0, 1, 0, 1, 1])})
    record.manifest["scores"] = {"touchdown": {"contact": {"t_s": 2.0}}}
    assert moments(record) == [Moment(2.0, "touchdown")]


def test_without_truth_moments_come_from_events() -> None:
    record = Record()
    events = {"t_s": np.array([4.0, 800.0]), "source": np.array(["vehicle"] * 2)}
    record.add("events", {**events, "kind": np.array(["lift-off", "touchdown"])})
    assert moments(record) == [Moment(4.0, "lift-off"), Moment(800.0, "touchdown")]


def test_close_ups_show_about_fifteen_seconds_around_each_moment() -> None:
    panels = close_ups(flight("takeoff"))
    keys = ["lift-off-position-error", "lift-off-velocity-error", "lift-off-transient"]
    assert [panel.key for panel in panels] == keys
    first, last = panels[0].figure.layout.xaxis.range
    assert first < 10.0 < last
    assert last - first == pytest.approx(15.0, abs=0.1)
    assert panels[2].figure.layout.yaxis2.title.text == "thrust (N)"


def test_flow_times_range_is_the_body_velocity() -> None:
    record = replay(60.0)
    flow = flow_velocity(record)
    assert flow is not None
    estimate = record.tables["estimate"]
    speed = np.interp(flow.t_s, estimate["t_s"], estimate["vel_u_m_s"])
    assert flow.value[:, 0] == pytest.approx(speed, abs=0.3)
    assert np.abs(flow.value[:, 1]).max() < 1e-9  # the laps are flown without slip
    assert np.isnan(flow.value[:, 2]).all()


def test_readings_of_quality_zero_are_left_out_and_a_delay_is_taken_off() -> None:
    record = Record({"delays_s": {"range": 0.5}})
    record.add("range", {"t_s": [1.0, 2.0, 3.0], "range_m": [1.0, 9.0, 3.0], "quality": [255.0, 0.0, 1.0]})
    found = readings(record, Sensor.RANGE)
    assert found is not None
    assert found.t_s.tolist() == [0.5, 2.5]
    assert found.value[:, 0].tolist() == [1.0, 3.0]


def test_gps_velocity_is_turned_into_the_body_frame() -> None:
    half = np.sqrt(0.5)  # nose to the east
    record = Record()
    record.add("estimate", {"t_s": [0.0, 10.0], "qw": [half] * 2, "qx": [0.0] * 2, "qy": [0.0] * 2, "qz": [half] * 2})
    record.add("gps_velocity", {"t_s": [5.0], "vel_n_m_s": [0.0], "vel_e_m_s": [2.0], "vel_d_m_s": [-1.0]})
    turned = gps_velocity_body(record)
    assert turned is not None
    assert turned.value == pytest.approx(np.array([[2.0, 0.0, -1.0]]), abs=1e-12)


def test_attitude_is_drawn_in_degrees_and_yaw_does_not_leap() -> None:
    t_s = np.linspace(0.0, 10.0, 400)
    yaw = np.radians(100.0 * t_s)
    record = Record()
    zero = np.zeros_like(t_s)
    record.add("estimate", {"t_s": t_s, "qw": np.cos(yaw / 2), "qx": zero, "qy": zero, "qz": np.sin(yaw / 2)})
    drawn = attitude(record).figure.data[2]
    assert drawn.y[-1] - drawn.y[0] == pytest.approx(1000.0, abs=0.01)
    rolled = Track(t_s[:1], np.array([[np.cos(0.1), np.sin(0.1), 0.0, 0.0]]))
    assert euler_deg(rolled)[0] == pytest.approx([np.degrees(0.2), 0.0, 0.0])


def test_a_sliding_rms_of_a_constant_is_that_constant() -> None:
    t_s = np.sort(np.random.default_rng(1).uniform(0.0, 100.0, 500))
    assert sliding_rms(t_s, np.full(500, 4.0), 5.0) == pytest.approx(np.full(500, 2.0))


def test_the_radius_of_uncertainty_is_three_times_the_spread_of_the_errors() -> None:
    traces = {trace.name: np.array(trace.y) for trace in radius_of_uncertainty(flight(gps_sigma_m=0.3)).figure.data[:3]}
    assert np.median(traces["GPS alone"]) == pytest.approx(3 * 0.3 * np.sqrt(2), rel=0.05)
    assert np.median(traces["filter"]) == pytest.approx(3 * 0.07 * np.sqrt(2), rel=0.15)
    assert traces["stated by the filter"] == pytest.approx(3 * 0.07 * np.sqrt(2), rel=1e-5)


def test_without_truth_the_radius_is_what_filter_and_gps_state() -> None:
    traces = {trace.name: np.array(trace.y) for trace in radius_of_uncertainty(replay(60.0)).figure.data[:2]}
    assert np.median(traces["stated for GPS alone"]) == pytest.approx(3 * 0.5 * np.sqrt(2), rel=1e-5)
    assert np.median(traces["stated by the filter"]) == pytest.approx(3 * 0.2 * np.sqrt(2), rel=1e-5)


def test_the_distance_from_gps_compares_at_the_instant_that_gps_describes() -> None:
    t_s = np.arange(0.0, 60.0, 0.1)
    place = {"pos_e_m": 0 * t_s, "pos_d_m": 0 * t_s}
    record = Record({"delays_s": {"gps_position": 0.5}})
    record.add("estimate", {"t_s": t_s, "pos_n_m": 3.0 * t_s, **place})
    record.add("gps_position", {"t_s": t_s + 0.5, "pos_n_m": 3.0 * t_s, **place, "quality": 255.0 + 0 * t_s})
    distance = next(trace.y for trace in error_against_gps(record).figure.data if trace.mode == "lines")
    assert np.max(np.abs(distance)) < 1e-5


def test_innovations_accept_numbers_or_names_for_sensor_and_component() -> None:
    named = flight()
    numbered = flight()
    table = numbered.tables["innovation"]
    table["component"] = np.array([("pos_n_m", "pos_e_m", "pos_d_m", "vel_u_m_s", "vel_v_m_s").index(str(name)) % 3
                                   for name in table["component"]])  # fmt: skip
    table["sensor"] = np.where(table["sensor"] == "gps_position", 1, 4)

    def shown(record: Record) -> list[tuple[str, list[str]]]:
        return [
            (panel.title, [panel.figure.layout[f"yaxis{row}"].title.text for row in (2, 3)])
            for panel in innovations(record)
        ]

    assert shown(named) == shown(numbered)
    assert shown(named)[0] == ("Innovations: GPS position", ["y, east (m)", "z, down (m)"])


def test_values_that_were_not_fused_are_crosses_and_counted() -> None:
    record = flight()
    table = record.tables["innovation"]
    refused = int(np.sum(~table["fused"] & (table["sensor"] == "gps_position")))
    panel = innovations(record)[0]
    assert f"7500 values offered, {refused} not fused." in panel.caption
    crosses = [trace for trace in panel.figure.data if trace.name == "not fused"]
    assert crosses
    assert all(trace.marker.symbol == "x-thin" and len(trace.x) <= CROSS_POINTS for trace in crosses)


def test_paths_hold_the_pad_in_its_size_and_the_truth_last() -> None:
    paths = paths_of(flight())
    assert paths is not None
    assert paths.pad is not None
    assert np.ptp(paths.pad.corners(), axis=0) == pytest.approx([1.0, 1.0, 0.0])
    assert paths.main()[1] == "truth"
    assert paths.names() == ["pad", "GPS", "estimate", "truth", "touchdown"]
    assert paths.touch == pytest.approx([0.0, 0.0, 0.0], abs=0.2)
    assert paths_of(Record()) is None


def test_the_page_leaves_the_pad_out_where_it_is_unknown() -> None:
    record = flight()
    assert paths_data(paths_of(record), Columns())["pad_m"] == 1.0
    del record.manifest["pad_size_m"]
    assert "pad_m" not in paths_data(paths_of(record), Columns())
    assert path_over_pad(record).title == "Path in space"


def test_z_is_drawn_upside_down_so_that_up_is_up() -> None:
    layout = position(flight()).figure.layout
    assert layout.yaxis3.autorange == "reversed"
    assert layout.yaxis3.title.text == "z, down (m)"
    assert layout.yaxis.autorange is None


def test_an_axis_that_hardly_moves_does_not_magnify_rounding() -> None:
    yaw = attitude(flight()).figure.layout.yaxis3
    assert yaw.range[1] - yaw.range[0] == pytest.approx(2.0)


def every_panel() -> list[Panel]:
    records = (flight("landing"), flight("takeoff"), navigated(), replay(60.0))
    shown = [panel for record in records for section in sections(record) for panel in section.panels]
    return [panel for panel in shown if isinstance(panel.drawing, Chart)]


def test_a_role_has_one_colour_in_all_figures() -> None:
    for panel in every_panel():
        for trace in panel.figure.data:
            if trace.name in ("truth", "estimate", "autopilot") and trace.mode == "lines":
                assert trace.line.color == COLOUR[trace.name], panel.key
            if trace.name == "GPS":
                assert trace.marker.color == COLOUR["gps"], panel.key


def test_every_colour_of_every_figure_has_its_dark_twin() -> None:
    for panel in every_panel():
        colours = set(re.findall(r'"(#[0-9a-fA-F]{3,8}|rgba?\([^"]*\))"', panel.figure.to_json()))
        assert colours - {"rgba(0,0,0,0)"} <= set(LIGHT_TO_DARK), panel.key


def luminance(colour: str) -> float:
    channels = (int(colour[i : i + 2], 16) / 255 for i in (1, 3, 5))
    red, green, blue = (c / 12.92 if c <= 0.04045 else ((c + 0.055) / 1.055) ** 2.4 for c in channels)
    return 0.2126 * red + 0.7152 * green + 0.0722 * blue


@pytest.mark.parametrize("theme", [0, 1], ids=["light", "dark"])
def test_colours_contrast_as_wcag_asks(theme: int) -> None:
    def contrast(role: str, ground: str) -> float:
        pair = sorted((luminance(PALETTE[role][theme]), luminance(PALETTE[ground][theme])))
        return (pair[1] + 0.05) / (pair[0] + 0.05)

    for ground in ("page", "surface"):
        for words in ("ink", "muted", "estimate"):  # links take the estimate's colour
            assert contrast(words, ground) >= 4.5
        for line in ("truth", "estimate", "gps", "flow", "autopilot", "alert", "pad"):
            assert contrast(line, ground) >= 3.0


def test_axes_carry_their_units() -> None:
    for panel in every_panel():
        if panel.key == "nis":  # sensors' names beside a ratio
            continue
        for axis in panel.figure.select_yaxes():
            assert re.search(r"\((m|m/s|m/s²|rad/s|°|°/s|N)\)$|^test ratio$|^NEES$", axis.title.text), panel.key


def test_velocity_says_that_the_flow_sensor_gives_no_w_or_that_there_is_no_flow() -> None:
    assert "does not measure w" in velocity(flight()).caption
    assert "no valid flow readings" in velocity(replay(60.0, flow=False)).caption


def test_errors_are_drawn_inside_the_filters_own_band() -> None:
    record = flight()
    traces = position_error(record).figure.data
    band, error = traces[0], traces[1]
    assert (np.nanmin(band.y), np.nanmax(band.y)) == pytest.approx((-0.21, 0.21), abs=1e-6)
    truth, estimate = record.tables["truth"]["pos_n_m"], record.tables["estimate"]["pos_n_m"]
    assert max(error.y) == pytest.approx(np.max(estimate - truth), abs=1e-6)


def test_a_band_is_open_where_nothing_was_measured() -> None:
    record = flight()
    table = record.tables["innovation"]
    paused = (table["t_s"] > 20.0) & (table["t_s"] < 30.0)
    record.add("innovation", {name: column[~paused] for name, column in table.items()})
    band = innovations(record)[0].figure.data[0]
    assert band.fill == "toself"
    assert np.isnan(band.y).sum() == 2  # two areas, each closed
    assert not np.any((np.array(band.x) > 20.0) & (np.array(band.x) < 30.0))


def test_consistency_is_drawn_in_the_band_of_one_flight_where_the_record_has_it() -> None:
    record = flight()
    assert consistency(record) == []
    t_s = record.tables["truth"]["t_s"]
    record.add("consistency", {"t_s": t_s, "nees": np.where(np.arange(len(t_s)) < len(t_s) // 4, 20.0, 6.0)})
    (panel,) = consistency(record)
    lines = {trace.name: np.asarray(trace.y) for trace in panel.figure.data}
    assert lines["filter"].max() == 20.0
    limits = sorted({float(trace.y[0]) for trace in panel.figure.data if trace.name == "95 % band"})
    assert limits == pytest.approx([1.237, 14.449], abs=1e-3)  # chi-square of 6 degrees of freedom
    assert "here 75 % do" in panel.caption
    shown = next(section for section in sections(record) if section.key == "filter").panels
    assert panel.key in {one.key for one in shown}


# -- a flight on the navigator -------------------------------------------------------------------------------
def test_errors_take_the_truth_at_the_estimates_own_instants() -> None:
    record = navigated()
    error = next(trace for trace in position_error(record).figure.data if "truth" in trace.name)
    assert np.asarray(error.y) == pytest.approx(2.0, abs=1e-6)
    assert set(np.float32(error.x)) <= set(np.float32(record.tables["estimate"]["t_s"]))


def test_what_was_flown_on_has_errors_of_its_own_and_a_line_beside_the_estimate() -> None:
    assert flown_errors(flight()) == []
    record = navigated()
    panels = flown_errors(record)
    assert [panel.key for panel in panels] == ["flown-position-error", "flown-velocity-error"]
    north, east, _ = panels[0].figure.data
    assert np.abs(np.asarray(north.y)[np.asarray(north.x) < 5.0]).max() == 0.0
    assert np.asarray(east.y)[-1] - np.asarray(east.y)[0] == pytest.approx(1.0, abs=0.5)
    assert "by definition" in panels[0].caption
    assert "autopilot's input" in ground_track(record).alt
    assert "autopilot's input" in path_over_pad(record).alt
    for panel in (position(record), velocity(record), attitude(record)):
        assert "autopilot's input" in {trace.name for trace in panel.figure.data}, panel.key
    keys = [panel.key for section in sections(record) if section.key == "errors" for panel in section.panels]
    assert keys == ["flown-position-error", "flown-velocity-error", "position-error", "velocity-error"]


def test_a_path_that_jumps_is_open_there_and_no_other_is() -> None:
    record = navigated()
    jumps = {track["name"]: track["jumps"] for track in paths_data(paths_of(record), Columns())["tracks"]}
    assert len(jumps["autopilot's input"]) == 1
    assert jumps["estimate"] == jumps["truth"] == []


def test_rare_peaks_do_not_flatten_an_axis_and_are_said() -> None:
    record = navigated()
    assert "rare peaks" not in position_error(record).caption
    record.tables["estimate"]["pos_n_m"][3] += 50.0
    panel = position_error(record)
    assert panel.figure.layout.yaxis.range[1] == pytest.approx(1.2 * 2.0, abs=0.05)
    assert "rare peaks" in panel.caption
    assert max(panel.figure.data[1].y) == pytest.approx(52.0, abs=0.1)


def test_ratios_far_inside_the_gate_have_no_axis_of_their_own() -> None:
    record = flight()
    table = record.tables["innovation"]
    table["test_ratio"] = np.where(table["sensor"] == "flow_velocity", 1e-4, table["test_ratio"])
    gps, flow = innovations(record)
    assert [axis.title.text for axis in gps.figure.select_yaxes()][-1] == "test ratio"
    assert "test ratio" not in [axis.title.text for axis in flow.figure.select_yaxes()]
    assert "All test ratios are below 0.01" in flow.caption


def test_the_words_say_what_was_flown_on_and_what_was_known() -> None:
    words = summary(navigated())
    assert "In flight no axis of the position that the autopilot used was off by more than" in words
    assert "Known to the vehicle without error: its position in hover for the first 5" in words
    assert "without error" not in summary(flight())
    tile = tiles(navigated())[-1]
    assert tile.label == "Flow sensor engaged"
    assert "carried to the present) against the truth, in flight" in render(navigated())
