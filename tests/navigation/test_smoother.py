"""The smoother against dense Rauch-Tung-Striebel smoothers, and on flights whose truth is known."""

from __future__ import annotations

import json
from dataclasses import replace as altered

import numpy as np
import pytest
import typer
from typer.testing import CliRunner

from flownav.cli.replay import command
from flownav.core.compile import ONE_LANE
from flownav.core.frames import quaternion_product
from flownav.core.measurement import Sensor
from flownav.core.record import PROTECTION_LEVELS, Record
from flownav.estimation.states import ATTITUDE, BARO, CONSIDERS, FORCE, GROUND, MIDDLE, QUATERNION, STATE, STATES
from flownav.logs.csv_folder import read_csv_folder
from flownav.logs.log import Log
from flownav.navigation.entries import CORRECTED, DECAYED, FORGOTTEN, NOTED, PREDICTED
from flownav.navigation.feed import equipment_of
from flownav.navigation.loop import Running, run, start_navigator
from flownav.navigation.memory import CLOCK, ERRORS_CLOCK, load_start
from flownav.navigation.rows import EstimateRow, EventRow
from flownav.navigation.settings import NavigatorSettingsFile
from flownav.navigation.smoother import part_of, smooth
from flownav.navigation.tape import (
    BARO_FOUND,
    ENTRIES,
    ESTIMATES,
    GROUND_FOUND,
    NOTES,
    empty_tape,
    new_tape,
)
from flownav.replays.prepare import ReplayOptions, prepare, withhold
from flownav.replays.session import Replay, replay
from packed_covariance import unpack
from replay_logs import SyntheticLog, log_of_flight
from smoother_oracles import dense_decay, dense_transition, smoother_gain

UNPROTECTED = [name for name in EstimateRow._fields if name != "protection_m"]  # a smoother has no levels
SETTINGS = NavigatorSettingsFile(flow_lasting_s=0.0)  # or a correction ends with noise, which `Step` does not know
STATIONARY = SETTINGS.start_sigma(has_heading=True, compass=True)  # of the Gauss-Markov errors
CUT = ((8.0, 26.0),)


def spoiled(log: Log, seed: int, share: float = 1.0) -> Log:
    """The log with sensor errors drawn as the navigator's default settings say they are, or a share of them."""
    random, streams = np.random.default_rng(seed), dict(log.streams)

    def markov(t_s: np.ndarray, sigma: float | list[float], tau_s: float) -> np.ndarray:
        error = random.normal(0.0, sigma, (len(t_s), 3))
        factor = np.exp(-np.diff(t_s) / tau_s)
        for k in range(1, len(t_s)):
            error[k] = factor[k - 1] * error[k - 1] + np.sqrt(1.0 - factor[k - 1] ** 2) * error[k]
        return error

    def put(sensor: Sensor, error: np.ndarray) -> None:
        value = streams[sensor].value.copy()
        value[:, : error.shape[1]] += share * error
        streams[sensor] = altered(streams[sensor], value=value)

    imu, fix = streams[Sensor.IMU], streams[Sensor.GPS_POSITION].t_s
    rate = 1.0 / np.median(np.diff(imu.t_s))
    spread = np.repeat([SETTINGS.gyro_noise_rad_s_rt_hz, SETTINGS.accel_noise_m_s2_rt_hz], 3) * np.sqrt(rate)
    bias = random.normal(0.0, np.repeat([SETTINGS.gyro_bias_sigma_rad_s, SETTINGS.accel_bias_sigma_m_s2], 3))
    put(Sensor.IMU, bias + random.normal(0.0, spread, (len(imu), 6)))
    put(
        Sensor.GPS_POSITION,
        markov(fix, [1.5, 1.5, 2.5], 300.0) + markov(fix, [0.5, 0.5, 1.0], 20.0)
        + random.normal(0.0, [0.4, 0.4, 0.8], (len(fix), 3)),
    )  # fmt: skip
    put(Sensor.GPS_VELOCITY, markov(fix, 0.1, 5.0) + random.normal(0.0, [0.4, 0.4, 0.5], (len(fix), 3)))
    put(Sensor.FLOW_RATE, random.normal(0.0, 0.05, (len(streams[Sensor.FLOW_RATE]), 2)))
    put(Sensor.RANGE, random.normal(0.0, 0.05, (len(streams[Sensor.RANGE]), 1)))
    put(Sensor.BARO, random.normal(0.0, 1.0, (len(streams[Sensor.BARO]), 1)))
    del streams[Sensor.MAG]
    return altered(log, streams=streams)


@pytest.fixture(scope="module")
def flight() -> SyntheticLog:
    return log_of_flight(30.0, flow_hz=25.0, range_hz=25.0)


@pytest.fixture(scope="module")
def clean(flight, tmp_path_factory) -> Log:
    return read_csv_folder(flight.write(tmp_path_factory.mktemp("log") / "flight"))


@pytest.fixture(scope="module")
def log(clean) -> Log:
    return spoiled(clean, 1)


@pytest.fixture(scope="module")
def flown(log) -> Replay:
    return replay(log, ReplayOptions(gps_outages_s=CUT), SETTINGS, smoothed=True)


def queue_of(log: Log, until_s: float, outages=(), since_s: float = -np.inf):
    """A log's streams and their events between two instants, on a grid of microseconds, the IMU first at each."""
    options = ReplayOptions(gps_outages_s=outages)
    prepared = prepare(log, options)
    queue = withhold(log, prepared.queue, options)
    instants = np.round(queue.t_s, 6)
    order = np.lexsort((queue.sensor != Sensor.IMU, instants))
    order = order[(instants[order] >= since_s) & (instants[order] <= until_s)]
    return prepared, queue._replace(t_s=instants)._replace(
        **{name: column[order] for name, column in queue._replace(t_s=instants)._asdict().items()}
    )


def navigator(prepared, queue) -> Running:
    fitted = equipment_of(prepared.streams, float(queue.t_s[0]), prepared.flow_gyro_is_imu, SETTINGS)
    running = start_navigator(fitted, SETTINGS, new_tape(queue))
    running.work[CONSIDERS] = 0.0  # as the smoother's own run
    return running


# -- against a dense smoother ----------------------------------------------------------------------------------
class Step:
    """The navigator's error state over one event: before, after, and what lay between."""

    def __init__(self, before: np.ndarray, on: Running, reset: list[int]) -> None:
        self.covariance, after = unpack(before, ONE_LANE, 0, STATES), unpack(on.work, ONE_LANE, 0, STATES)
        decayed_s = float(on.work[ERRORS_CLOCK] - before[ERRORS_CLOCK])
        decay = dense_decay(decayed_s, on.given.filter) if 0.0 < decayed_s < np.inf else np.eye(STATES)
        if on.clock_s > before[CLOCK]:
            middle, force = on.work[MIDDLE : MIDDLE + 9], on.work[FORCE : FORCE + 3]
            self.transition = decay @ dense_transition(on.clock_s - before[CLOCK], middle, force)
            self.predicted, self.change = after, np.zeros(STATES)
            return
        self.transition = decay.copy()
        self.transition[reset, reset] = 0.0
        self.predicted = self.transition @ self.covariance @ self.transition
        kept = STATIONARY**2 * (1.0 - np.diag(decay) ** 2)
        self.predicted += np.diag(kept)
        self.predicted[reset, reset] = 1e4
        state = slice(STATE, STATE + STATES)
        self.change = on.work[state] - np.diag(decay) * before[state]
        w, x, y, z = before[QUATERNION : QUATERNION + 4]
        turn = quaternion_product(tuple(on.work[QUATERNION : QUATERNION + 4]), (w, -x, -y, -z))
        self.change[ATTITUDE : ATTITUDE + 3] = 2.0 * np.array(turn[1:]) / turn[0]


def steps_of(prepared, queue) -> tuple[list[Step], np.ndarray, list[int]]:
    """Every event after the start, taken one by one; the filter's last covariance; how many estimates each wrote."""
    on, steps, written = navigator(prepared, queue), [], []
    for k in range(len(queue.t_s)):
        started, events = load_start(on.work, ONE_LANE, 0).started, len(on.tape.events())
        before, estimates = on.work.copy(), int(on.tape.used[ESTIMATES])
        run(part_of(queue, k, k + 1), on)
        happened = EventRow.of(on.tape.events()).kind[events:]
        if started:
            assert on.clock_s == before[CLOCK] or queue.sensor[k] == Sensor.IMU
            reset = [state for kind, state in ((GROUND_FOUND, GROUND), (BARO_FOUND, BARO)) if kind in happened]
            steps.append(Step(before, on, reset))
            written.append(int(on.tape.used[ESTIMATES]) - estimates)
    return steps, unpack(on.work, ONE_LANE, 0, STATES), written


def test_a_whole_run_of_the_navigator_is_smoothed_as_by_dense_rts(clean):
    """Event by event, with resets of ground and barometer, through a cut: C = P F' P_predicted^-1 in NumPy.

    With a hundredth of the sensors' errors: rotations add up to second order only.
    """
    in_flight_s = 5.0  # on the ground an inertial reading ends with what standing teaches, which is no prediction
    prepared, queue = queue_of(spoiled(clean, 1, 0.01), 18.0, ((9.0, 15.0),), in_flight_s)
    steps, last, written = steps_of(prepared, queue)
    on = navigator(prepared, queue)
    path = smooth(queue, on)
    filtered = on.tape.estimates()
    deviation, covariance = np.zeros(STATES), last
    found = []
    for step, wrote in zip(steps[::-1], written[::-1], strict=True):
        if wrote:
            found.append((deviation, covariance))
        gain = smoother_gain(step.covariance, step.transition, step.predicted)
        deviation = gain @ (deviation + step.change)
        covariance = step.covariance + gain @ (covariance - step.predicted) @ gain.T
    early = len(path) - len(found)  # that of the start
    assert early <= 1 < 300 < len(path)
    largest = 0.0
    for row, (wanted, spread) in enumerate(found[::-1], early):
        own, better = (EstimateRow(*(column[row] for column in EstimateRow.of(rows))) for rows in (filtered, path))
        sigma = np.sqrt(np.diag(spread))
        scale = np.maximum(sigma, 1e-6)
        w, x, y, z = own.quaternion
        turn = quaternion_product(tuple(better.quaternion), (w, -x, -y, -z))
        shift = np.concatenate([
            better.pos_ned_m - own.pos_ned_m, better.vel_ned_m_s - own.vel_ned_m_s,
            2.0 * np.array(turn[1:]) / turn[0], better.states - own.states,
        ])  # fmt: skip
        assert (np.abs(shift - wanted) < 1e-5 * scale).all()
        largest = max(largest, float(np.abs(shift / scale).max()))
        said = np.concatenate([better.std_pos_ned_m, better.std_tilt_ned_rad, better.std_states])
        assert said == pytest.approx(np.concatenate([sigma[:3], sigma[6:9], sigma[9:]]), rel=1e-9)
    assert largest > 0.01


def test_pieces_of_any_length_give_the_same_bytes_and_leave_the_filter_as_it_was(log):
    prepared, queue = queue_of(log, 12.0)
    alone = navigator(prepared, queue)
    run(queue, alone)
    paths = []
    for chunk in (10**6, 333):
        on = navigator(prepared, queue)
        paths.append(smooth(queue, on, chunk))
        assert on.work.tobytes() == alone.work.tobytes()
        assert on.tape.estimates().tobytes() == alone.tape.estimates().tobytes()
        assert on.tape.used.tolist() == alone.tape.used.tolist()
    assert paths[0].tobytes() == paths[1].tobytes()


def test_a_journal_of_no_rows_counts_and_one_of_as_many_holds_all(log):
    prepared, queue = queue_of(log, 5.0)
    first = navigator(prepared, queue)
    run(queue, first)
    entries, estimates = (int(first.tape.used[place]) for place in (ENTRIES, NOTES))
    assert entries > len(queue.t_s)
    assert estimates == first.tape.used[ESTIMATES]
    again = navigator(prepared, queue)
    again = again._replace(tape=empty_tape(estimates, 0, 0, journal=(entries, estimates)))
    run(queue, again)
    assert [int(again.tape.used[place]) for place in (ENTRIES, NOTES)] == [entries, estimates]
    assert set(again.tape.journal.entry[:, 0]) == {PREDICTED, CORRECTED, FORGOTTEN, NOTED, DECAYED}
    for estimate in again.tape.journal.covariance:
        assert np.linalg.eigvalsh(estimate).min() > -1e-12 * np.trace(estimate)


# -- what it is for ------------------------------------------------------------------------------------------
def test_with_nothing_after_it_the_last_estimate_is_the_filters(log):
    prepared, queue = queue_of(log, 6.0)
    on = navigator(prepared, queue)
    run(queue, on)
    filtered = EstimateRow.of(on.tape.estimates())
    last_s = filtered.t_s[-1]
    written = np.flatnonzero(queue.t_s == last_s)[0] + 1
    cut = part_of(queue, 0, written)
    on = navigator(prepared, cut)
    path = smooth(cut, on)
    smoothed = EstimateRow.of(path)
    assert smoothed.t_s[-1] == last_s
    for name in UNPROTECTED:
        assert getattr(smoothed, name)[-1] == pytest.approx(getattr(filtered, name)[-1], rel=1e-12, abs=1e-15)


def errors(path: np.ndarray, flight: SyntheticLog) -> np.ndarray:
    """Position and NED velocity less the truth, (n, 6)."""
    truth = np.column_stack([flight.position, flight.velocity])
    said = EstimateRow.of(path)
    wanted = np.column_stack([np.interp(said.t_s, flight.t_s, c) for c in truth.T])
    return np.column_stack([said.pos_ned_m, said.vel_ned_m_s]) - wanted


def test_over_many_flights_it_errs_less_than_the_filter_and_as_much_as_it_says(clean, flight):
    """Sensors that err as the settings say; GPS cut in the middle. Normalised by the stated deviations, both are 1."""
    squares = {"filtered": [], "smoothed": []}
    normalised = {"filtered": [], "smoothed": []}
    for seed in range(24):
        flown = replay(spoiled(clean, 100 + seed), ReplayOptions(gps_outages_s=CUT), SETTINGS, smoothed=True)
        assert flown.smoothed is not None
        for name, path in (("filtered", flown.estimate), ("smoothed", flown.smoothed)):
            rows = np.searchsorted(EstimateRow.of(path).t_s, np.arange(2.0, 28.0, 2.0))
            off = errors(path, flight)[rows]
            squares[name].append(off**2)
            normalised[name].append(off[:, :3] ** 2 / EstimateRow.of(path[rows]).std_pos_ned_m ** 2)
    filtered, smoothed = (np.mean(squares[name], axis=(0, 1)) for name in ("filtered", "smoothed"))
    assert (smoothed[:3] < filtered[:3]).all()
    assert (smoothed[3:] < 0.6 * filtered[3:]).all()
    for name, values in normalised.items():
        assert 0.5 < np.mean(values) < 1.5, name


def test_it_never_says_that_it_knows_less_than_the_filter(flown):
    assert flown.smoothed is not None
    smoothed, filtered = EstimateRow.of(flown.smoothed), flown.estimate_rows
    assert (smoothed.t_s == filtered.t_s).all()
    assert all(np.isfinite(getattr(smoothed, name)).all() for name in UNPROTECTED)
    assert (smoothed.std_pos_ned_m <= filtered.std_pos_ned_m * (1.0 + 1e-9)).all()
    whole = 1e-3  # of a run back that counts every innovation whole, where the filter counts it as two sigma at most
    assert (smoothed.std_tilt_ned_rad <= filtered.std_tilt_ned_rad * (1.0 + whole)).all()
    assert np.linalg.norm(smoothed.quaternion, axis=1) == pytest.approx(1.0, abs=1e-12)


def test_the_middle_of_an_outage_is_known_from_both_sides(flown):
    """Without flow the filter's spread grows to the end of the cut; the smoothed one's is largest inside it."""
    alone = replay(flown.log, ReplayOptions(gps_outages_s=CUT, use_flow=False), SETTINGS, smoothed=True)
    assert alone.smoothed is not None
    inside = (alone.attitude.t_s > 8.0) & (alone.attitude.t_s < 25.5)
    before, after = (EstimateRow.of(rows[inside]).std_pos_ned_m[:, 0] for rows in (alone.estimate, alone.smoothed))
    assert before.argmax() > 0.98 * len(before)
    assert 0.2 * len(after) < after.argmax() < 0.8 * len(after)
    assert after.max() < 0.5 * before.max()


def test_on_the_outdoor_flight_it_drifts_less_through_an_outage(data_folder):
    outdoor = read_csv_folder(data_folder / "quad-px4flow-outdoor")
    scores = replay(outdoor, ReplayOptions(gps_outages_s=((200.0, 260.0),)), SETTINGS, smoothed=True).scores()
    smoothed, filtered = scores["smoothed"]["outages"][0], scores["outages"][0]
    assert smoothed["horizontal_rms_m"] < filtered["horizontal_rms_m"]
    assert smoothed["horizontal_max_m"] < filtered["horizontal_max_m"]


# -- the command ---------------------------------------------------------------------------------------------
def test_the_command_adds_a_table_and_scores_beside_the_filters(flight, tmp_path):
    folder, out = flight.write(tmp_path / "flight"), tmp_path / "flight.fnr"
    arguments = [str(folder), "--gps-outage", "8:26", "--out", str(out)]
    app = typer.Typer()
    app.command()(command)
    plain = CliRunner().invoke(app, [*arguments, "--no-report", "--json"])
    assert "smoothed" not in json.loads(plain.stdout)
    assert "smoothed" not in Record.load(out).tables
    answer = CliRunner().invoke(app, [*arguments, "--smooth", "--json", "--force"])
    scores = json.loads(answer.stdout)
    assert set(scores["smoothed"]) == {"outages", "velocity_rms_m_s"}
    assert scores["smoothed"]["outages"][0]["t1"] == 26.0
    record = Record.load(out)
    assert [*record.tables["smoothed"], *PROTECTION_LEVELS] == list(record.tables["estimate"])
    assert "smoothed" in out.with_suffix(".html").read_text(encoding="utf-8")
    people = CliRunner().invoke(app, [*arguments, "--smooth", "--no-report"])
    assert "Smoothed over the whole flight: GPS cut 8 to 26 s: " in people.stdout
