"""Replay of synthetic logs: it finds the known path through a GPS cut, and holds up when sensors misbehave."""

from __future__ import annotations

from dataclasses import replace as altered
from pathlib import Path

import numpy as np
import pytest

from flownav.core.errors import InputError
from flownav.core.measurement import Sensor
from flownav.core.record import FILTER_STATES, TABLES, TILTS, VELOCITY_NED, Record
from flownav.estimation.gating import Reason
from flownav.estimation.states import ATTITUDE, GYRO_BIAS, STATE_NAMES, STATES, VELOCITY
from flownav.logs.csv_folder import read_csv_folder
from flownav.logs.log import Log
from flownav.navigation.rows import EventRow
from flownav.navigation.settings import NavigatorSettingsFile
from flownav.replays.bundle import to_record
from flownav.replays.prepare import ReplayOptions
from flownav.replays.session import Replay, outage_summary, outage_table, replay, table_windows
from replay_logs import SyntheticLog, log_of_flight

CUT = ((20.0, 58.0),)


@pytest.fixture(scope="module")
def flight() -> SyntheticLog:
    return log_of_flight()


@pytest.fixture(scope="module")
def log(flight, tmp_path_factory) -> Log:
    return read_csv_folder(flight.write(tmp_path_factory.mktemp("log") / "flight"))


def flown(log: Log, settings=None, **options) -> Replay:
    return replay(log, ReplayOptions(**options), settings or NavigatorSettingsFile())


def error_of(run: Replay, flight: SyntheticLog) -> np.ndarray:
    """Estimate minus truth: position and NED velocity (n, 6)."""
    t_s = run.estimate_rows.t_s
    truth = np.column_stack([flight.position, flight.velocity])
    return run.estimate[:, [1, 2, 3, 17, 18, 19]] - np.column_stack([np.interp(t_s, flight.t_s, c) for c in truth.T])


def with_stream(log: Log, sensor: Sensor, **changes) -> Log:
    return altered(log, streams={**log.streams, sensor: altered(log.streams[sensor], **changes)})


def without(log: Log, *sensors: Sensor) -> Log:
    return altered(log, streams={s: stream for s, stream in log.streams.items() if s not in sensors})


def thinned(log: Log, sensor: Sensor, step: int) -> Log:
    stream = log.streams[sensor]
    return with_stream(
        log, sensor, **{name: getattr(stream, name)[::step] for name in ("t_s", "value", "variance", "quality")}
    )


def reasons(run: Replay, sensor: Sensor) -> dict[str, int]:
    return run.rejected().get(sensor.name.lower(), {})


# -- the known path ----------------------------------------------------------------------------------------
def test_the_path_is_found_to_a_centimetre_through_a_gps_cut(log, flight):
    error = np.abs(error_of(flown(log, gps_outages_s=CUT), flight))
    assert error[:, :3].max() < 0.01
    assert error[:, 3:].max() < 0.02


@pytest.mark.parametrize("rates", [
    {"sensor_gyro": False},
    {"start_s": 1000.0},
    {"start_s": -7.5},
    {"imu_hz": 200.0, "attitude_hz": 100.0, "flow_hz": 50.0, "gps_hz": 10.0, "range_hz": 50.0},
    {"imu_hz": 30.0, "attitude_hz": 12.0, "flow_hz": 9.5, "gps_hz": 1.0, "range_hz": 7.0},
    {"yaw_rate": 0.4},
])  # fmt: skip
def test_other_rates_clocks_and_sensors_find_it_too(tmp_path, rates):
    flight = log_of_flight(45.0, **rates)
    log = read_csv_folder(flight.write(tmp_path / "flight"))
    start = rates.get("start_s", 0.0)
    run = flown(log, gps_outages_s=((start + 20.0, start + 44.0),))
    error = np.abs(error_of(run, flight))
    assert error[:, :2].max() < 0.05
    assert error[:, 2].max() < 0.06
    assert error[run.estimate_rows.t_s > start + 4.0, 2].max() < 0.02  # the ground is found


def test_without_flow_the_same_cut_is_lost(log, flight):
    """A bias that comes with the cut, which nothing has taught the filter."""
    bias = log.streams[Sensor.IMU].value.copy()
    bias[log.streams[Sensor.IMU].t_s > CUT[0][0], 4] += 0.1
    tilted = with_stream(log, Sensor.IMU, value=bias)
    blind = np.abs(error_of(flown(tilted, gps_outages_s=CUT, use_flow=False), flight))[:, :2].max()
    aided = np.abs(error_of(flown(tilted, gps_outages_s=CUT), flight))[:, :2].max()
    assert aided < 0.15
    assert blind > 5.0


@pytest.mark.parametrize(("scale", "axis"), [((1.1, 1.0), 0), ((1.0, 1.1), 1)])
def test_flow_scale_acts_on_its_axis_alone(log, scale, axis):
    """Scaling flow_x scales the sideways velocity, scaling flow_y the forward one (rotation is small here)."""
    trusting = NavigatorSettingsFile(flow_scale_sigma=0.0)
    plain_run = flown(log, trusting, gps_outages_s=CUT)
    scaled = flown(log, trusting, gps_outages_s=CUT, flow_scale=scale)
    late = plain_run.estimate_rows.t_s > 30.0
    slopes = [
        np.polyfit(plain_run.estimate[late, 4 + column], scaled.estimate[late, 4 + column], 1)[0] for column in (1, 0)
    ]
    assert slopes[axis] == pytest.approx(1.1, abs=0.015)
    assert slopes[1 - axis] == pytest.approx(1.0, abs=0.015)


def test_a_flow_scale_is_learned_while_there_is_gps(log, flight):
    """Flow 3 % too large through a cut: what GPS taught before it leaves less than a third of the error."""
    errors = []
    for sigma in (0.03, 0.0):
        run = flown(log, NavigatorSettingsFile(flow_scale_sigma=sigma), gps_outages_s=CUT, flow_scale=(1.03, 1.03))
        errors.append(np.abs(error_of(run, flight))[:, :2].max())
    assert errors[0] < 0.33 * errors[1]


def test_a_wrong_gps_delay_shows_as_speed_times_the_difference(log, flight):
    right = flown(log).scores()["velocity_rms_m_s"]
    late = flown(log, gps_delay_s=0.72).scores()["velocity_rms_m_s"]
    assert right is not None
    assert late is not None
    assert right < 0.01
    assert late > 0.2


def test_a_delayed_fix_corrects_the_instant_that_it_describes(log, flight):
    """With half a second between a fix and its arrival the path still fits to the centimetre."""
    shifted = log
    for sensor in (Sensor.GPS_POSITION, Sensor.GPS_VELOCITY):
        shifted = with_stream(shifted, sensor, t_s=log.streams[sensor].t_s + 0.5)
    assert np.abs(error_of(flown(shifted, gps_delay_s=0.72), flight))[:, :3].max() < 0.01


def test_the_same_log_gives_the_same_bytes(log):
    first, second = flown(log, gps_outages_s=CUT), flown(log, gps_outages_s=CUT)
    assert first.estimate.tobytes() == second.estimate.tobytes()
    assert first.innovation.tobytes() == second.innovation.tobytes()


# -- sensors that misbehave --------------------------------------------------------------------------------
def test_range_spikes_and_gaps_are_ridden_out(log, flight):
    stream = log.streams[Sensor.RANGE]
    random = np.random.default_rng(2)
    value, keep = stream.value.copy(), np.ones(len(stream), bool)
    spikes = random.random(len(stream)) < 0.05
    value[spikes] += random.uniform(1.5, 8.0, (np.count_nonzero(spikes), 1))
    keep[(stream.t_s > 30) & (stream.t_s < 33)] = False
    hurt = with_stream(log, Sensor.RANGE, t_s=stream.t_s[keep], value=value[keep], variance=stream.variance[keep],
                       quality=stream.quality[keep])  # fmt: skip
    run = flown(hurt, gps_outages_s=CUT)
    assert np.abs(error_of(run, flight))[:, :2].max() < 0.15
    assert np.abs(error_of(run, flight))[run.estimate_rows.t_s > 4.0, 2].max() < 0.03
    assert len(run.written.event[EventRow.of(run.written.event).kind == 2]) == 0  # no new ground
    offered = run.offered
    taken = (offered.sensor == Sensor.RANGE) & (offered.reason == Reason.FUSED)
    far, variance = (column[taken & (np.abs(offered.innovation) > 1.0)]
                     for column in (np.abs(offered.innovation), offered.innovation_variance))  # fmt: skip
    assert np.all(far < 0.6 * np.sqrt(variance))  # what is not refused weighs little


def test_flow_spikes_and_lost_flow_are_ridden_out(log, flight):
    stream = log.streams[Sensor.FLOW_RATE]
    random = np.random.default_rng(3)
    value, quality = stream.value.copy(), stream.quality.copy()
    spikes = random.random(len(stream)) < 0.05
    value[spikes, :2] += random.normal(0, 4.0, (np.count_nonzero(spikes), 2))
    quality[random.random(len(stream)) < 0.3] = 0.0
    run = flown(with_stream(log, Sensor.FLOW_RATE, value=value, quality=quality), gps_outages_s=CUT)
    assert np.abs(error_of(run, flight))[:, :2].max() < 0.3
    assert reasons(run, Sensor.FLOW_RATE)["no_data"] > 500


def test_quality_zero_is_no_data_and_not_zero_motion(log, flight):
    stream = log.streams[Sensor.FLOW_RATE]
    dead = (stream.t_s > 30) & (stream.t_s < 32)
    value = np.where(dead[:, None], 0.0, stream.value)
    run = flown(with_stream(log, Sensor.FLOW_RATE, value=value, quality=np.where(dead, 0.0, 255.0)), gps_outages_s=CUT)
    assert np.abs(error_of(run, flight))[:, :2].max() < 0.3


@pytest.mark.parametrize("sensor", [Sensor.FLOW_RATE, Sensor.RANGE, Sensor.GPS_VELOCITY, Sensor.BARO])
@pytest.mark.parametrize("bad", [np.nan, np.inf])
def test_what_is_not_finite_is_counted_and_never_fused(log, sensor, bad):
    value = log.streams[sensor].value.copy()
    value[50:60] = bad
    run = flown(with_stream(log, sensor, value=value))
    assert np.isfinite(run.estimate).all()
    components = {Sensor.FLOW_RATE: 2, Sensor.GPS_VELOCITY: 3}.get(sensor, 1)
    assert reasons(run, sensor)["not_finite"] == 10 * components


def test_noisy_flow_is_believed_less(log):
    """Flow ten times noisier than modelled widens its innovation variance by itself, and is not gated away."""
    stream, random = log.streams[Sensor.FLOW_RATE], np.random.default_rng(5)
    value = stream.value.copy()
    value[:, :2] += random.normal(0, 0.4, (len(stream), 2))
    clean, noisy = flown(log), flown(with_stream(log, Sensor.FLOW_RATE, value=value))

    def late_variance(run):
        late = (run.offered.sensor == Sensor.FLOW_RATE) & (run.offered.t_s > 30)
        return np.median(run.offered.innovation_variance[late])

    assert late_variance(noisy) > 10 * late_variance(clean)
    assert reasons(noisy, Sensor.FLOW_RATE).get("innovation_gate", 0) < 0.02 * 2 * len(stream)


def test_a_step_of_the_ground_becomes_a_new_datum(log, flight):
    """A 1.5 m higher roof from 30 s on: height stays, the ground moves, flow goes on, faster."""
    ranges, flow = log.streams[Sensor.RANGE], log.streams[Sensor.FLOW_RATE]
    far = np.interp(flow.t_s - 0.025, ranges.t_s, ranges.value[:, 0])[:, None]
    faster = np.where(flow.t_s[:, None] > 30.0, far / (far - 1.5), 1.0)
    seen = np.column_stack([flow.value[:, 2:] + faster * (flow.value[:, :2] - flow.value[:, 2:]), flow.value[:, 2:]])
    raised = with_stream(log, Sensor.FLOW_RATE, value=seen)
    value = np.where(ranges.t_s[:, None] > 30.0, ranges.value - 1.5, ranges.value)
    run = flown(with_stream(raised, Sensor.RANGE, value=value))
    events = run.written.event
    resets = events[(events[:, 1] == 2) & (events[:, 0] > 29)]
    assert len(resets) == 1
    assert resets[0, 0] == pytest.approx(31.5, abs=0.06)  # nine may be strays, then it is refused for a second
    assert np.abs(error_of(run, flight))[:, 2].max() < 0.15


def test_gps_that_stays_away_from_the_filter_wins_in_the_end(log):
    """A position 60 m off for good is rejected at first; after the reset time the filter goes there, and says so.

    Beside flow that nobody doubts that takes a minute, and without it 7 s.
    """
    flow = log.streams[Sensor.FLOW_RATE]
    log = with_stream(log, Sensor.FLOW_RATE, value=np.where(flow.t_s[:, None] > 28.0, np.nan, flow.value))
    stream = log.streams[Sensor.GPS_POSITION]
    value = stream.value + np.where(stream.t_s[:, None] > 30.0, [60.0, 0.0, 0.0], 0.0)
    run = flown(with_stream(log, Sensor.GPS_POSITION, value=value))
    assert 70 <= reasons(run, Sensor.GPS_POSITION)["innovation_gate"] <= 74  # both axes of a fix
    record = to_record(run, run.scores(), [])
    events = record.tables["events"]
    reset = np.flatnonzero((events["source"] == "gps") & (events["kind"] == "reset"))
    assert len(reset) == 1
    assert events["value"][reset[0]] == pytest.approx(60.0, abs=1.0)


def test_a_single_gps_glitch_is_gated(log, flight):
    stream = log.streams[Sensor.GPS_POSITION]
    value = stream.value.copy()
    value[150] += [200.0, -100.0, 50.0]
    run = flown(with_stream(log, Sensor.GPS_POSITION, value=value))
    assert reasons(run, Sensor.GPS_POSITION)["innovation_gate"] == 3
    assert np.abs(error_of(run, flight))[:, :3].max() < 0.02


@pytest.mark.parametrize("gone", [(Sensor.IMU,), (Sensor.BARO, Sensor.MAG), (Sensor.GPS_VELOCITY,)])
def test_sensors_that_are_missing_cost_little(log, flight, gone):
    run = flown(without(log, *gone), gps_outages_s=CUT)
    late = run.estimate_rows.t_s > 12.0
    assert np.abs(error_of(run, flight))[late, :2].max() < 0.25


def test_a_slow_imu_is_as_good_as_none_and_no_worse(log, flight):
    run = flown(thinned(log, Sensor.IMU, 25), gps_outages_s=CUT)
    assert np.abs(error_of(run, flight))[run.estimate_rows.t_s > 12.0, :2].max() < 0.25


def test_without_gps_the_filter_starts_with_the_flow_at_the_local_origin(log, flight):
    run = flown(without(log, Sensor.GPS_POSITION, Sensor.GPS_VELOCITY))
    assert run.estimate_rows.pos_ned_m[0, :2] == pytest.approx([0, 0], abs=0.01)
    assert np.abs(error_of(run, flight))[:, :2].max() < 0.1  # blind below 0.3 m, with a first tilt known to 2 degrees
    assert np.abs(error_of(run, flight))[run.estimate_rows.t_s > 12.0, :2].max() < 0.05
    assert run.scores()["velocity_rms_m_s"] is None
    assert run.scores()["outages"] == []


def test_a_cut_from_the_start_still_starts(log, flight):
    run = flown(log, gps_outages_s=((-1.0, 30.0),))
    assert run.estimate_rows.t_s[0] == pytest.approx(NavigatorSettingsFile().start_wait_s, abs=0.5)
    assert np.abs(error_of(run, flight))[run.estimate_rows.t_s > 50.0, :2].max() < 0.5


def test_flow_without_range_is_rejected_for_want_of_height(log):
    run = flown(without(log, Sensor.RANGE))
    assert reasons(run, Sensor.FLOW_RATE)["no_height"] > 2000


def test_nothing_to_start_from_is_an_error(log):
    with pytest.raises(InputError, match="never started"):
        flown(without(log, Sensor.GPS_POSITION, Sensor.GPS_VELOCITY), use_flow=False)


# -- which gyro --------------------------------------------------------------------------------------------
def test_a_dead_or_wrong_flow_gyro_is_replaced(log, flight):
    stream = log.streams[Sensor.FLOW_RATE]
    random = np.random.default_rng(7)
    for name, gyro in (("dead", 0.0 * stream.value[:, 2:]), ("noise", random.normal(0, 0.2, (len(stream), 2)))):
        value = np.column_stack([stream.value[:, :2], gyro])
        run = flown(with_stream(log, Sensor.FLOW_RATE, value=value), gps_outages_s=CUT)
        assert "sensor gyro," not in run.prepared.notes[0].split("(")[0], name
        assert np.abs(error_of(run, flight))[:, :2].max() < 0.05, name


def test_a_biased_flow_gyro_is_followed(log, flight):
    stream = log.streams[Sensor.FLOW_RATE]
    value = np.add(stream.value, [0.0, 0.0, 0.03, -0.03])
    run = flown(with_stream(log, Sensor.FLOW_RATE, value=value), gps_outages_s=CUT)
    assert np.abs(error_of(run, flight))[:, :2].max() < 0.05


# -- options and scores ------------------------------------------------------------------------------------
@pytest.mark.parametrize(("options", "said"), [
    ({"gps_outages_s": ((30.0, 20.0),)}, "the end must come after the start"),
    ({"gps_outages_s": ((300.0, 320.0),)}, "outside the log"),
    ({"gps_delay_s": 50.0}, "gps_delay_s 50"),
    ({"flow_scale": (0.0, 1.0)}, "flow_scale 0,1"),
    ({"flow_scale": (float("nan"), 1.0)}, "flow_scale nan,1"),
    ({"flow_scale": (-1.0, 1.0)}, "flow_scale -1,1"),
])  # fmt: skip
def test_options_that_cannot_be(log, options, said):
    with pytest.raises(InputError, match=r"gps_|flow_"):
        flown(log, **options)
    try:
        flown(log, **options)
    except InputError as error:
        text = str(error)
    assert said in text
    assert "\n" not in text


def test_an_outage_without_gps_in_the_log(log):
    with pytest.raises(InputError, match="no GPS to cut"):
        flown(without(log, Sensor.GPS_POSITION, Sensor.GPS_VELOCITY), gps_outages_s=CUT)


def test_a_cut_withholds_position_and_velocity_and_nothing_else(log):
    run = flown(log, gps_outages_s=((20.0, 30.0),))
    assert reasons(run, Sensor.GPS_POSITION)["outage"] == 3 * 50
    assert reasons(run, Sensor.GPS_VELOCITY)["outage"] == 3 * 50
    withheld = run.innovation[run.offered.reason == Reason.OUTAGE]
    assert withheld[:, 0].min() == pytest.approx(20.0 - 0.22)
    assert withheld[:, 0].max() < 30.0 - 0.22


def test_the_tables_last_window_is_shorter_where_the_length_does_not_fit():
    assert table_windows(60.0, 780.0, 50.0)[-2:] == [(710.0, 760.0), (760.0, 780.0)]
    assert table_windows(0.0, 0.3, 0.1)[-1][1] == pytest.approx(0.3)
    assert len(table_windows(0.0, 0.3, 0.1)) == 3


def test_the_table_is_each_window_alone(log):
    windows = table_windows(15.0, 55.0, 20.0)
    assert windows == [(15.0, 35.0), (35.0, 55.0)]
    errors = outage_table(log, ReplayOptions(), NavigatorSettingsFile(), windows)
    assert errors == [flown(log, gps_outages_s=(window,)).outage(*window) for window in windows]
    summary = outage_summary(errors)
    assert summary["outage_median_rms_m"] == pytest.approx(np.mean([e.horizontal_rms_m for e in errors]))
    assert summary["outage_worst_rms_m"] == max(e.horizontal_rms_m for e in errors)


@pytest.mark.parametrize("bad", [(10.0, 5.0, 1.0), (0.0, 10.0, 0.0), (0.0, 10.0, 20.0), (0.0, 1e9, 1e-3)])
def test_tables_that_cannot_be(bad):
    with pytest.raises(InputError, match="outage_table"):
        table_windows(*bad)


def test_the_record_holds_the_whole_replay_and_loads_again(log, tmp_path):
    run = flown(log, gps_outages_s=CUT)
    scores = run.scores()
    to_record(run, scores, ["flownav", "replay", "flight"]).save(tmp_path / "flight.fnr")
    record = Record.load(tmp_path / "flight.fnr")
    assert set(record.tables) == {
        "estimate", "states", "gps_position", "gps_velocity", "flow_rate", "range", "baro", "innovation", "events",
        "judging",
    }  # fmt: skip
    manifest = record.manifest
    assert (manifest["kind"], manifest["log"], manifest["filter"]) == ("replay", "flight", "landing")
    assert manifest["delays_s"]["gps_position"] == 0.22
    assert manifest["scores"] == scores
    assert manifest["provenance"]["inputs"]["flow.csv"]["sha256"] == log.inputs["flow.csv"]
    assert "clock_start_s" not in manifest  # a folder of CSV files does not say
    told = Replay(altered(log, clock_start_s=81.5), run.options, run.settings, run.prepared, run.written)
    assert to_record(told, scores, []).manifest["clock_start_s"] == 81.5
    table = record.tables["innovation"]
    assert set(table["sensor"]) == {"attitude", "gps_position", "gps_velocity", "flow_rate", "range", "baro", "mag"}
    fused = table["fused"]
    assert set(table["reason"][fused]) == {"fused"}
    assert "fused" not in table["reason"][~fused]
    assert np.all(table["test_ratio"][fused] <= 1.0)
    assert np.all(np.diff(record.tables["estimate"]["t_s"]) > 0)


def test_every_state_of_the_filter_is_in_the_record_with_its_deviation(log):
    """By its name, in the filter's order; those of position, body velocity and attitude stand in `estimate`."""
    assert STATE_NAMES[GYRO_BIAS:STATES] == FILTER_STATES
    assert STATE_NAMES[ATTITUDE:GYRO_BIAS] == TILTS
    assert STATE_NAMES[VELOCITY:ATTITUDE] == VELOCITY_NED
    run = flown(log)
    record = to_record(run, run.scores(), [])
    states, estimate = record.tables["states"], record.tables["estimate"]
    assert ("t_s", *TABLES["states"]) == tuple(states)
    assert (states["t_s"] == estimate["t_s"]).all()
    said, baro = run.estimate_rows, FILTER_STATES.index("baro_m")
    assert (states["baro_m"] == said.states[:, baro]).all()
    assert (states["std_baro_m"] == said.std_states[:, baro]).all()
    assert states["baro_m"][-1] == pytest.approx(12.0, abs=0.5)
    assert 0.0 < states["std_baro_m"][-1] < 4.0
    assert (states["std_heading_rad"] == said.std_tilt_ned_rad[:, 2]).all()


def test_truth_is_turned_onto_the_estimate(log, flight):
    """A truth in a frame turned by 1 rad and shifted is found again, with its yaw."""
    turn, t_s = 1.0, flight.t_s[::10]
    north, east, down = flight.position[::10].T
    truth = {"t_s": t_s, "pos_n_m": np.cos(turn) * north + np.sin(turn) * east + 5.0,
             "pos_e_m": -np.sin(turn) * north + np.cos(turn) * east - 3.0, "pos_d_m": down + 1.0}  # fmt: skip
    run = flown(altered(log, truth=truth))
    scores = run.scores()["truth"]
    assert scores is not None
    assert scores["yaw_rad"] == pytest.approx(turn, abs=1e-3)
    assert scores["horizontal_rms_m"] < 0.01
    assert scores["velocity_rms_m_s"] < 0.02
    placed = to_record(run, run.scores(), []).tables["truth"]
    assert np.abs(placed["pos_n_m"] - north).max() < 0.02
    assert "vel_u_m_s" in placed


@pytest.mark.parametrize("rows", [1, 2, 3, 7])
def test_a_handful_of_rows_is_replayed_or_refused_in_one_line(tmp_path, rows):
    flight = log_of_flight(3.0)
    for name, columns in flight.tables.items():
        flight.tables[name] = {column: values[5 : 5 + rows] for column, values in columns.items()}
    said = ""
    try:
        run = flown(read_csv_folder(flight.write(tmp_path / "short")))
        assert np.isfinite(run.estimate).all()
        to_record(run, run.scores(), [])
    except InputError as error:
        said = str(error)
    assert "\n" not in said


def test_windows_too_short_to_score_are_null(tmp_path):
    flight = log_of_flight(2.0)
    folder: Path = flight.write(tmp_path / "short")
    run = flown(read_csv_folder(folder), gps_outages_s=((0.5, 0.7),))
    assert run.scores()["outages"] == [{"t0": 0.5, "t1": 0.7, "horizontal_rms_m": None, "horizontal_max_m": None}]
