"""The navigator's refusals, counts and warnings: one run for each safeguard."""

from __future__ import annotations

import numpy as np
import pytest

from flownav.core.compile import ONE_LANE
from flownav.core.measurement import EventQueue, Sensor, Stream, merge
from flownav.estimation.gating import Reason
from flownav.estimation.states import IMU
from flownav.navigation.memory import load_imu
from flownav.navigation.rows import EventRow
from flownav.navigation.tape import COMPASS_REFUTED, EVENT_NAMES, FAULT_CLEARED, FAULT_SUSPECTED, HEADING_FOUND
from navigation_streams import Flown, Navigated, circle, fly, navigate, still

GPS = (Sensor.GPS_POSITION, Sensor.GPS_VELOCITY)


@pytest.fixture(scope="module")
def hover() -> Flown:
    return fly(still, 20.0)


def with_rows(queue: EventQueue, places: list[int], rows: EventQueue) -> EventQueue:
    """The queue with rows put in before the given places."""
    return EventQueue(*(np.insert(column, places, extra, axis=0) for column, extra in zip(queue, rows, strict=True)))


def rows_of(queue: EventQueue, places: list[int]) -> EventQueue:
    return EventQueue(*(column[places].copy() for column in queue))


def places_of(queue: EventQueue, sensor: Sensor, t0_s: float) -> np.ndarray:
    return np.flatnonzero((queue.sensor == sensor) & (queue.t_s >= t0_s))


def descending(t_s: np.ndarray) -> np.ndarray:
    """5 m, then down at 0.3 m/s from 5 s to 17 s."""
    return np.column_stack([0 * t_s, 0 * t_s, -5.0 + 0.3 * np.clip(t_s - 5.0, 0.0, 12.0)])


# -- readings that are no readings ---------------------------------------------------------------------------
FED = (Sensor.GPS_POSITION, Sensor.GPS_VELOCITY, Sensor.FLOW_RATE, Sensor.RANGE, Sensor.BARO, Sensor.MAG, Sensor.IMU)


@pytest.mark.parametrize("sensor", FED)
@pytest.mark.parametrize("how", ["twice", "backward"])
def test_a_reading_that_repeats_or_precedes_changes_nothing(hover, sensor, how):
    queue = merge(hover.streams.values())
    place = places_of(queue, sensor, 10.0)[3]
    extra = rows_of(queue, [place])
    extra.value[:] += 3.0
    if how == "backward":
        extra.t_s[:] -= 1e-3
    run, plain = navigate(hover, with_rows(queue, [place + 1], extra)), navigate(hover, queue)
    assert run.estimate.tobytes() == plain.estimate.tobytes()
    assert run.on.work.tobytes() == plain.on.work.tobytes()
    if sensor != Sensor.IMU:  # of the IMU nothing is offered
        assert run.reasons(sensor)["duplicate"] == 1


@pytest.mark.parametrize("sensor", FED)
def test_a_late_reading_changes_nothing(hover, sensor):
    """It describes 10.0 s, and comes when the filter is at 10.3 s; none of its sensor came in between."""
    flown = hover.cut(sensor, 9.99, 10.35)
    queue = merge(flown.streams.values())
    extra = rows_of(queue, [int(places_of(queue, sensor, 9.0)[0])])
    extra.t_s[:] = 10.0
    place = int(np.searchsorted(queue.t_s, 10.3))
    run, plain = navigate(flown, with_rows(queue, [place], extra)), navigate(flown, queue)
    assert run.estimate.tobytes() == plain.estimate.tobytes()
    if sensor != Sensor.IMU:
        assert run.reasons(sensor)["late"] == 1


@pytest.mark.parametrize("bad", [np.nan, np.inf, -np.inf])
@pytest.mark.parametrize("sensor", [*FED, Sensor.PAD, Sensor.POSE, Sensor.YAW, Sensor.ATTITUDE, Sensor.LANDED])
def test_what_is_no_number_is_counted_and_never_fused(hover, sensor, bad):
    """Every second reading of one sensor is broken: what is estimated is what it is without those readings."""
    flown = hover
    if sensor in (Sensor.PAD, Sensor.POSE, Sensor.YAW, Sensor.LANDED):
        t_s = np.arange(1.0, 20.0, 0.5)
        good = {Sensor.PAD: [0.0, 0.0, 2.0], Sensor.POSE: [0.0, 0.0, -2.0], Sensor.YAW: [0.0], Sensor.LANDED: [0.0]}
        flown = hover.added(Stream.of(sensor, t_s, np.tile(good[sensor], (len(t_s), 1))))
    stream = flown.streams[sensor]
    value = stream.value.copy()
    value[1::2] = bad
    run = navigate(flown.changed(sensor, value=value))
    assert np.isfinite(run.estimate).all()
    assert np.isfinite(run.on.work[: IMU + 6]).all()  # state, covariance, the reading that moves it
    assert np.isfinite(load_imu(run.on.work, ONE_LANE, 0)).all()
    late = run.t_s > 5.0
    assert np.abs(run.error[late]).max() < 0.1
    fused = run.offers[(run.offered.sensor == sensor) & (run.offered.reason == Reason.FUSED)]
    assert np.isfinite(fused).all()
    if sensor not in (Sensor.IMU, Sensor.MAG, Sensor.ATTITUDE, Sensor.LANDED):
        assert run.reasons(sensor)["not_finite"] >= len(stream) // 2 - 1


def test_a_time_that_is_no_number_is_counted(hover):
    queue = merge(hover.streams.values())
    place = int(places_of(queue, Sensor.RANGE, 10.0)[0])
    extra = rows_of(queue, [place])
    extra.t_s[:] = np.nan
    run, plain = navigate(hover, with_rows(queue, [place + 1], extra)), navigate(hover, queue)
    assert run.estimate.tobytes() == plain.estimate.tobytes()
    assert run.reasons(Sensor.RANGE)["not_finite"] == 1


def test_the_same_queue_gives_the_same_bytes(hover):
    first, second = navigate(hover), navigate(hover)
    assert first.estimate.tobytes() == second.estimate.tobytes()
    assert first.offers.tobytes() == second.offers.tobytes()


# -- GPS -----------------------------------------------------------------------------------------------------
def jumping(hover: Flown) -> Navigated:
    stream = hover.streams[Sensor.GPS_POSITION]
    return navigate(
        hover.changed(
            Sensor.GPS_POSITION, value=stream.value + np.where(stream.t_s[:, None] >= 10.0, [20.0, 0.0, 0.0], 0.0)
        )
    )


def test_a_gps_jump_of_20_m_is_refused_while_flow_is_good_and_after_7_s_accepted_without_flow(hover):
    assert len(jumping(hover).events("gps", "reset")) == 0
    run = jumping(hover.cut(Sensor.FLOW_RATE, 8.0, 99.0))
    before = run.estimate_rows.pos_ned_m[np.searchsorted(run.t_s, 9.99), 0]
    during = run.estimate_rows.pos_ned_m[(run.t_s >= 10.0) & (run.t_s < 12.0), 0]
    assert np.abs(during - before).max() < 0.01
    reset = run.events("gps", "reset")
    assert len(reset) == 1
    assert reset[0] == pytest.approx([17.0, 20.0], abs=0.21)
    assert run.reasons(Sensor.GPS_POSITION)["innovation_gate"] == 2 * 36  # both axes of a fix
    assert run.estimate_rows.pos_ned_m[-1, 0] == pytest.approx(20.0, abs=0.5)


def blind(hover: Flown) -> Navigated:
    flown = hover.without(Sensor.FLOW_RATE)
    for sensor in GPS:
        flown = flown.cut(sensor, 5.0, 13.0)
    return navigate(flown)


def test_without_any_horizontal_aid_it_says_so_after_1_s_and_after_5_s(hover):
    run = blind(hover)
    last = 4.8
    assert run.events("filter", "dead_reckoning")[:, 0] == pytest.approx([last + 1.0], abs=0.03)
    assert run.events("filter", "position_invalid")[:, 0] == pytest.approx([last + 5.0], abs=0.03)
    assert run.events("filter", "aided") == pytest.approx(np.array([[13.0, 8.2]]), abs=0.03)


def test_flow_is_aid_enough(hover):
    flown = hover
    for sensor in GPS:
        flown = flown.cut(sensor, 5.0, 13.0)
    run = navigate(flown)
    assert len(run.events("filter", "dead_reckoning")) == 0
    assert np.abs(run.error[:, :2]).max() < 0.05


# -- range and flow ------------------------------------------------------------------------------------------
def stuck() -> Navigated:
    flown = fly(descending, 20.0)
    stream = flown.streams[Sensor.RANGE]
    held = np.where(stream.t_s[:, None] > 8.0, stream.value[np.searchsorted(stream.t_s, 8.0)], stream.value)
    return navigate(flown.changed(Sensor.RANGE, value=held))


def test_a_stuck_range_is_found_within_2_s_of_a_slow_descent():
    run = stuck()
    assert 8.0 < run.events("range", "stuck")[0, 0] < 10.0
    assert run.reasons(Sensor.RANGE)["stuck"] > 100
    assert np.abs(run.error[:, 2]).max() < 0.5


def over_a_step(hover: Flown) -> Navigated:
    """A roof 1.2 m high below from 10 s on."""
    ranges = hover.streams[Sensor.RANGE]
    value = np.where(ranges.t_s[:, None] >= 10.0, ranges.value - 1.2, ranges.value)
    return navigate(hover.changed(Sensor.RANGE, value=value))


def test_a_step_of_the_ground_is_accepted_after_1_s(hover):
    """Its first readings may be strays, until nine more agree: from then on it is refused, for a second."""
    run = over_a_step(hover)
    resets = run.events("range", "reset")
    assert len(resets) == 1
    assert resets[0] == pytest.approx([11.45, -1.2], abs=0.06)
    assert np.abs(run.error[:, 2]).max() < 0.1
    assert np.count_nonzero(run.offered.reason[run.offered.sensor == Sensor.RANGE] == Reason.INNOVATION_GATE) < 25


def test_flow_is_not_fused_below_its_least_height():
    run = navigate(fly(lambda t: 0.02 * still(t), 10.0))  # 4 cm
    assert set(run.reasons(Sensor.FLOW_RATE)) <= {"near_ground", "no_height"}
    assert run.reasons(Sensor.FLOW_RATE)["near_ground"] > 300
    low = fly(lambda t: 0.03 * still(t), 10.0)  # 6 cm
    assert navigate(low).reasons(Sensor.FLOW_RATE)["fused"] > 300
    assert "fused" not in navigate(low, flow_min_height_m=0.1).reasons(Sensor.FLOW_RATE)


def test_flow_and_range_are_not_taken_at_a_steep_tilt(hover):
    """The attitude says 57 degrees from 10 s on, the gyro that it went there."""
    imu = hover.streams[Sensor.IMU]
    turning = (imu.t_s >= 10.0) & (imu.t_s < 11.0)
    value = imu.value + np.where(turning[:, None], [1.0, 0, 0, 0, 0, 0], 0.0)
    run = navigate(hover.changed(Sensor.IMU, value=value).only(Sensor.IMU, Sensor.FLOW_RATE, Sensor.RANGE))
    assert run.reasons(Sensor.RANGE)["tilted"] > 150
    for sensor, instead in ((Sensor.FLOW_RATE, {"tilted", "no_height"}), (Sensor.RANGE, {"tilted"})):
        late = run.offered.reason[(run.offered.sensor == sensor) & (run.offered.t_s >= 11.0)].astype(int)
        assert Reason(late[0]).label == "tilted"
        assert {Reason(code).label for code in late} == instead  # without a range the height is lost in the end


def test_flow_without_a_range_waits_for_a_height(hover):
    run = navigate(hover.without(Sensor.RANGE))
    assert set(run.reasons(Sensor.FLOW_RATE)) == {"no_height"}


def test_an_echo_is_not_believed_where_the_range_alone_tells_the_height(hover):
    """Six readings of twice the height: they may be strays to their end, and weigh next to nothing."""
    flown = hover.without(Sensor.BARO, *GPS)
    stream = flown.streams[Sensor.RANGE]
    echo = (stream.t_s >= 10.0) & (stream.t_s < 10.3)
    run = navigate(flown.changed(Sensor.RANGE, value=np.where(echo[:, None], 2.0 * stream.value, stream.value)))
    rows = run.offers[run.offered.sensor == Sensor.RANGE]
    heard = (rows[:, 0] >= 10.0 - 1e-6) & (rows[:, 0] < 10.3 - 1e-6)
    assert np.count_nonzero(heard) == 6
    assert np.sqrt(rows[heard, 6]).min() > 5.0  # metres
    assert np.ptp(run.estimate_rows.pos_ned_m[run.t_s > 9.0, 2]) < 0.02
    assert len(run.events("imu", "doubted")) == len(run.events("range", "reset")) == 0


# -- every reason and every event ----------------------------------------------------------------------------
def test_every_reason_has_its_case(hover):
    """But for `not_needed` and `ahead`, which are given to readings before they reach the navigator, and `no_heading`
    (tests/replays/test_unknown_heading.py).
    """
    seen: set[str] = set()

    def look(run: Navigated) -> None:
        for sensor in Sensor:
            seen.update(run.reasons(sensor))

    look(jumping(hover))
    look(stuck())
    look(navigate(fly(lambda t: 0.02 * still(t), 3.0)))
    look(navigate(hover.without(Sensor.RANGE)))
    look(navigate(fly(circle, 10.0).without(Sensor.ATTITUDE, Sensor.MAG)))
    look(navigate(fly(still, 3.0).without(Sensor.IMU, Sensor.ATTITUDE)))
    imu = hover.streams[Sensor.IMU]
    rolled = imu.value + np.where((imu.t_s >= 10.0)[:, None] & (imu.t_s < 11.0)[:, None], [1.0, 0, 0, 0, 0, 0], 0.0)
    look(navigate(hover.changed(Sensor.IMU, value=rolled).only(Sensor.IMU, Sensor.FLOW_RATE, Sensor.RANGE)))
    ranges, flow = hover.streams[Sensor.RANGE], hover.streams[Sensor.FLOW_RATE]
    far, lost = ranges.value.copy(), flow.quality.copy()
    far[100], far[101] = 300.0, np.nan
    lost[100] = 0.0
    hurt = hover.changed(Sensor.RANGE, value=far).changed(Sensor.FLOW_RATE, quality=lost)
    queue = merge(hurt.streams.values())
    queue.withheld[places_of(queue, Sensor.FLOW_RATE, 11.0)[0]] = 1.0
    again = places_of(queue, Sensor.BARO, 10.0)[:1].tolist()
    run = navigate(hurt, with_rows(queue, [again[0] + 1], rows_of(queue, again)))
    look(run)
    assert run.reasons(Sensor.RANGE) == {"datum": 2, "fused": 396, "out_of_range": 1, "not_finite": 1}
    t_s = np.arange(1.0, 20.0, 0.1)
    look(navigate(hover.added(Stream.of(Sensor.PAD, t_s, np.tile([0.0, 0.0, 2.0], (len(t_s), 1))))))
    flown = hover.cut(Sensor.BARO, 9.99, 10.35)
    queue = merge(flown.streams.values())
    late = rows_of(queue, places_of(queue, Sensor.BARO, 9.0)[:1].tolist())
    late.t_s[:] = 10.0
    look(navigate(flown, with_rows(queue, [int(np.searchsorted(queue.t_s, 10.3))], late)))
    assert seen == {reason.label for reason in Reason} - {"not_needed", "ahead"}


def test_every_event_has_its_case(hover):
    seen: set[int] = set()
    t_s = np.arange(1.0, 20.0, 0.1)
    pad = hover.added(Stream.of(Sensor.PAD, t_s, np.tile([0.0, 0.0, 2.0], (len(t_s), 1))))
    imu = hover.streams[Sensor.IMU]
    lying = imu.value + np.where(imu.t_s[:, None] > 5.0, [0, 0, 0, 0, 0, 3.0], 0.0)
    alone = hover.without(Sensor.BARO, *GPS).changed(Sensor.IMU, value=lying)
    hit = imu.value.copy()
    hit[500, 0] += 30.0
    spiked = navigate(hover.changed(Sensor.IMU, value=hit))
    standing = navigate(fly(lambda t: 0.02 * still(t), 3.0))
    unseen = jumping(hover.cut(Sensor.FLOW_RATE, 8.0, 99.0))
    runs = (spiked, standing, unseen, blind(hover), stuck(), over_a_step(hover), navigate(pad), navigate(alone),
            navigate(fly(circle, 10.0).cut(Sensor.IMU, 5.0, 6.0)),
            navigate(fly(circle, 10.0).without(Sensor.ATTITUDE, Sensor.MAG)))  # fmt: skip
    for run in runs:
        seen.update(EventRow.of(run.on.tape.events()).kind.astype(int).tolist())
    flow = {k for k, (source, _, _) in enumerate(EVENT_NAMES) if source == "flow"}  # tests/test_faults_navigator.py
    heading = {int(HEADING_FOUND), int(COMPASS_REFUTED)}  # tests/replays/test_unknown_heading.py
    faults = {int(FAULT_SUSPECTED), int(FAULT_CLEARED)}  # tests/navigation/test_protection.py
    assert seen | flow | heading | faults == set(range(len(EVENT_NAMES)))
