"""Every injector does what it says to the readings that it may touch, and nothing to any other."""

from __future__ import annotations

import re

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from flownav.campaigns.faults.catalogue import FAULTS, FLOW, MEASURED, TEXTURE_NOISE_RAD_S, TEXTURE_SHARE, faults_named
from flownav.core.compile import announce_compilation
from flownav.core.errors import InputError
from flownav.core.measurement import COLUMNS, Sensor, Stream
from places import DOCS

RATES_HZ = {Sensor.RANGE: 10.0, Sensor.GPS_POSITION: 5.0, Sensor.GPS_VELOCITY: 5.0, Sensor.PAD: 10.0}


def a_log(length_s: float = 12.0, start_s: float = 100.0) -> dict[Sensor, Stream]:
    """Every sensor, each value a different number, NaN where a flow has no vertical velocity."""
    rng = np.random.default_rng(3)
    streams = {}
    for sensor in Sensor:
        t_s = start_s + np.arange(0.0, length_s, 1.0 / RATES_HZ.get(sensor, 50.0))
        value = rng.normal(2.0, 1.0, (len(t_s), len(COLUMNS[sensor])))
        if sensor == Sensor.FLOW_VELOCITY:
            value[:, 2] = np.nan
        quality = rng.uniform(50.0, 200.0, len(t_s))
        streams[sensor] = Stream.of(
            sensor, t_s, value, variance=np.abs(value), quality=quality, delay_s=0.01, rejected={"no_fix": 2}
        )
    return streams


LOG = a_log()
T0, T1 = 104.0, 107.0


def rows_of(stream: Stream) -> list[bytes]:
    table = np.column_stack([stream.t_s, stream.value, stream.variance, stream.quality])
    return [row.tobytes() for row in table]


def inside(stream: Stream, t0: float = T0, t1: float = T1) -> np.ndarray:
    return (stream.t_s >= t0) & (stream.t_s < t1)


def injected(name: str, sensor: Sensor, seed: int = 0) -> tuple[Stream, Stream, np.ndarray]:
    """The stream before and after, and which of its readings the fault may touch."""
    return LOG[sensor], FAULTS[name].inject(LOG, T0, T1, seed)[sensor], inside(LOG[sensor])


@pytest.mark.parametrize("name", FAULTS)
@given(t0=st.floats(99.0, 113.0), length=st.floats(0.01, 6.0), seed=st.integers(0, 2**63 - 1))
@settings(max_examples=15, deadline=None)
def test_a_fault_touches_its_sensors_inside_its_window_and_nothing_else(name, t0, length, seed):
    before = {sensor: rows_of(stream) for sensor, stream in LOG.items()}
    after = FAULTS[name].inject(LOG, t0, t0 + length, seed)
    assert list(after) == list(LOG)
    for sensor, stream in LOG.items():
        assert rows_of(stream) == before[sensor], "the log that was handed in has changed"
        result = after[sensor]
        assert (result.sensor, result.delay_s, result.rejected) == (sensor, stream.delay_s, stream.rejected)
        assert result.value.shape == result.variance.shape == (len(result), len(COLUMNS[sensor]))
        struck = inside(stream, t0, t0 + length)
        if sensor not in FAULTS[name].sensors or not struck.any():
            assert result is stream
            continue
        first, last = np.flatnonzero(struck)[[0, -1]]
        rows = rows_of(result)
        assert rows[:first] == before[sensor][:first]
        assert rows[len(rows) - (len(stream) - last - 1) :] == before[sensor][last + 1 :]


@pytest.mark.parametrize("name", FAULTS)
def test_a_fault_changes_every_one_of_its_sensors_and_repeats_itself(name):
    first, again, other = (FAULTS[name].inject(LOG, T0, T1, seed) for seed in (5, 5, 6))
    for sensor in FAULTS[name].sensors:
        assert rows_of(first[sensor]) == rows_of(again[sensor])
        assert rows_of(first[sensor]) != rows_of(LOG[sensor])
    drawn = {"gps_jump", "gps_drift", "flow_garbage", "low_texture", "low_texture_unsaid", "range_spikes"}
    changes = any(rows_of(first[sensor]) != rows_of(other[sensor]) for sensor in LOG)
    assert changes == (name in drawn | {"accel_vibration"})


def test_one_sensors_fault_does_not_depend_on_what_else_is_in_the_log():
    alone = {Sensor.IMU: LOG[Sensor.IMU]}
    fault = FAULTS["accel_vibration"]
    assert rows_of(fault.inject(alone, T0, T1, 4)[Sensor.IMU]) == rows_of(fault.inject(LOG, T0, T1, 4)[Sensor.IMU])


@pytest.mark.parametrize(
    ("name", "sensors"),
    [
        ("gps_loss", (Sensor.GPS_POSITION, Sensor.GPS_VELOCITY)),
        ("flow_loss", FLOW),
        ("silence", tuple(Sensor)),
    ],
)
def test_lost_readings_are_gone(name, sensors):
    for sensor in sensors:
        before, after, struck = injected(name, sensor)
        assert rows_of(after) == [row for row, gone in zip(rows_of(before), struck, strict=True) if not gone]


def test_gps_jumps_20_m_in_one_direction_and_keeps_its_height():
    before, after, struck = injected("gps_jump", Sensor.GPS_POSITION)
    away = after.value[struck] - before.value[struck]
    np.testing.assert_allclose(np.hypot(away[:, 0], away[:, 1]), 20.0)
    np.testing.assert_allclose(away, np.broadcast_to(away[0], away.shape), atol=1e-9)
    assert (away[:, 2] == 0.0).all()


def test_gps_drifts_at_half_a_metre_a_second():
    before, after, struck = injected("gps_drift", Sensor.GPS_POSITION)
    away = after.value[struck] - before.value[struck]
    np.testing.assert_allclose(np.hypot(away[:, 0], away[:, 1]), 0.5 * (before.t_s[struck] - T0), atol=1e-9)


@pytest.mark.parametrize("sensor", FLOW)
@pytest.mark.parametrize(
    ("name", "expected"),
    [
        ("flow_sign", lambda v: -v),
        ("flow_swapped", lambda v: v[:, ::-1]),
        ("flow_scale", lambda v: 0.7 * v),
    ],
)
def test_flow_goes_through_its_matrix_and_the_rest_of_the_reading_stays(sensor, name, expected):
    before, after, struck = injected(name, sensor)
    np.testing.assert_allclose(after.value[struck, :2], expected(before.value[struck, :2]))
    np.testing.assert_array_equal(after.value[:, 2:], before.value[:, 2:])
    np.testing.assert_array_equal(after.quality, before.quality)


@pytest.mark.parametrize("sensor", FLOW)
def test_garbage_is_even_unrelated_to_the_flow_and_of_full_quality(sensor):
    before, after, struck = injected("flow_garbage", sensor)
    drawn = after.value[struck, :2]
    assert np.abs(drawn).max() <= 2.0
    assert drawn.std() == pytest.approx(2.0 / np.sqrt(3.0), rel=0.1)
    assert abs(np.corrcoef(drawn[:, 0], before.value[struck, 0])[0, 1]) < 0.25
    assert (after.quality[struck] == 255.0).all()


@pytest.mark.parametrize("sensor", FLOW)
@pytest.mark.parametrize(("name", "quality"), [("low_texture", 40.0), ("low_texture_unsaid", 255.0)])
def test_low_texture_shrinks_flow_and_adds_noise(sensor, name, quality):
    before, after, struck = injected(name, sensor)
    left = (after.value - TEXTURE_SHARE * before.value)[struck, :2]
    if sensor == Sensor.FLOW_VELOCITY:
        ranges = LOG[Sensor.RANGE]
        rows = np.searchsorted(ranges.t_s, before.t_s[struck], side="right") - 1
        left = left / ranges.value[rows]
    assert left.std() == pytest.approx(TEXTURE_NOISE_RAD_S, rel=0.15)
    assert abs(left.mean()) < 0.02
    assert (after.quality[struck] == quality).all()


def test_low_texture_of_a_velocity_without_a_rangefinder_is_that_of_a_metre():
    flow = LOG[Sensor.FLOW_VELOCITY]
    after = FAULTS["low_texture"].inject({Sensor.FLOW_VELOCITY: flow}, T0, T1)[Sensor.FLOW_VELOCITY]
    left = (after.value - TEXTURE_SHARE * flow.value)[inside(flow), :2]
    assert left.std() == pytest.approx(TEXTURE_NOISE_RAD_S, rel=0.15)


@pytest.mark.parametrize("sensor", FLOW)
def test_late_flow_says_what_it_said_100_ms_before(sensor):
    before, after, struck = injected("flow_late", sensor)
    rows = np.flatnonzero(struck)
    np.testing.assert_array_equal(after.value[rows], before.value[rows - 5])
    np.testing.assert_array_equal(after.t_s, before.t_s)


@pytest.mark.parametrize(("name", "sensor"), [("gps_clock", Sensor.GPS_VELOCITY), ("flow_clock", Sensor.FLOW_RATE)])
def test_a_clock_jumps_by_a_second_and_the_readings_stay(name, sensor):
    before, after, struck = injected(name, sensor)
    np.testing.assert_allclose(after.t_s - before.t_s, struck.astype(float))
    np.testing.assert_array_equal(after.value, before.value)


def test_a_stuck_range_repeats_the_last_one_before():
    before, after, struck = injected("range_stuck", Sensor.RANGE)
    assert (after.value[struck] == before.value[np.flatnonzero(struck)[0] - 1]).all()


def test_a_range_stuck_from_the_first_reading_on_repeats_that():
    before = LOG[Sensor.RANGE]
    after = FAULTS["range_stuck"].inject(LOG, 0.0, T1)[Sensor.RANGE]
    assert (after.value[inside(before, 0.0)] == before.value[0]).all()


def test_a_range_at_its_floor_says_0_3_m():
    _, after, struck = injected("range_floor", Sensor.RANGE)
    assert (after.value[struck] == 0.3).all()


def test_range_spikes_are_a_share_of_the_readings_within_the_sensors_limits():
    before = LOG[Sensor.RANGE]
    hits = []
    for seed in range(40):
        after = FAULTS["range_spikes"].inject(LOG, T0, T1, seed)[Sensor.RANGE]
        changed = after.value[:, 0] != before.value[:, 0]
        assert not (changed & ~inside(before)).any()
        assert ((after.value[changed] >= 0.3) & (after.value[changed] <= 5.0)).all()
        hits.append(changed[inside(before)].mean())
    assert np.mean(hits) == pytest.approx(0.3, abs=0.03)


def test_an_imu_bias_is_the_same_in_every_reading():
    before, after, struck = injected("imu_bias", Sensor.IMU)
    off = (after.value - before.value)[struck]
    np.testing.assert_allclose(off, np.broadcast_to([np.radians(1.0)] * 3 + [0.3] * 3, off.shape), atol=1e-12)


def test_vibration_adds_noise_to_the_accelerometers_and_a_bias_along_down():
    before, after, struck = injected("accel_vibration", Sensor.IMU)
    off = (after.value - before.value)[struck]
    assert (off[:, :3] == 0.0).all()
    np.testing.assert_allclose(off[:, 3:].std(axis=0), 4.0, rtol=0.2)
    standard_error = 4.0 / np.sqrt(len(off))
    np.testing.assert_allclose(off[:, 3:].mean(axis=0), [0.0, 0.0, 0.5], atol=3.5 * standard_error)


@pytest.mark.parametrize("sensor", MEASURED)
def test_nan_bursts_blank_a_tenth_of_a_second_twice_a_second(sensor):
    before, after, struck = injected("nan_bursts", sensor)
    since = before.t_s - before.t_s[struck][0]
    in_burst = struck & (np.mod(since, 0.5) < 0.1)
    assert np.isnan(after.value[in_burst]).all()
    np.testing.assert_array_equal(after.value[~in_burst], before.value[~in_burst])
    assert 0.0 < in_burst[struck].mean() < 1.0


@pytest.mark.parametrize("sensor", MEASURED)
def test_duplicates_stand_beside_their_originals(sensor):
    before, after, struck = injected("duplicates", sensor)
    expected = [row for row, twice in zip(rows_of(before), struck, strict=True) for _ in range(1 + twice)]
    assert rows_of(after) == expected


@pytest.mark.parametrize("sensor", MEASURED)
def test_out_of_order_readings_are_all_there_with_their_own_times(sensor):
    before, after, struck = injected("out_of_order", sensor)
    assert sorted(rows_of(after)) == sorted(rows_of(before))
    rows = np.flatnonzero(struck)
    np.testing.assert_array_equal(after.t_s[rows[:5]], before.t_s[rows[:5]][::-1])
    assert (np.diff(after.t_s) < 0.0).sum() >= len(rows) // 2


def test_pixels_agree_with_what_low_texture_is_taken_to_be():
    """Block matching over the pad's texture at 2 % of its contrast: the share of flow and the noise that are left."""
    from flownav.lab.optics.camera import Camera, effective_focal_px
    from flownav.lab.optics.flow import flow_of_frames
    from flownav.lab.optics.pad import Pad, texture
    from flownav.lab.optics.projection import pose_looking_down
    from flownav.lab.optics.render import film

    height_m, speed_m_s, frames, fps = 1.5, 1.0, 250, 250.0
    camera, full = Camera(focus_m=height_m), texture(5)
    faint = Pad("faint", (0.5 + 0.02 * (full.reflectance - 0.5)).astype(np.float32), full.texel_m)
    poses = [pose_looking_down(speed_m_s * (k / fps - 0.5), 0.0, height_m) for k in range(frames)]
    with announce_compilation("optics"):
        pictures = film(faint, poses, camera=camera, seed=3)
        flow = flow_of_frames(pictures, fps, range_m=height_m, focal_px=effective_focal_px(camera))
    published = flow.velocity_m_s[: len(flow.velocity_m_s) // 5 * 5].reshape(-1, 5, 2).mean(axis=1)
    assert published[:, 0].mean() / speed_m_s == pytest.approx(TEXTURE_SHARE, abs=0.1)
    assert published.std(axis=0).mean() / height_m == pytest.approx(TEXTURE_NOISE_RAD_S, rel=0.5)
    assert flow.quality.mean() > 200  # the camera's noise passes for texture


def test_faults_are_found_by_name_in_the_order_asked_for():
    assert [fault.name for fault in faults_named(["silence", "gps_jump"])] == ["silence", "gps_jump"]
    assert all(fault.what.endswith(".") and fault.name == name for name, fault in FAULTS.items())


def test_the_page_names_every_fault_and_no_other():
    page = (DOCS / "explanation" / "faults.md").read_text(encoding="utf-8")
    table = page.split("## The faults")[1].split("\n## ")[0]
    assert re.findall(r"^\| `(\w+)` \|", table, re.M) == list(FAULTS)


def test_an_unknown_fault_is_refused_with_the_names_there_are():
    with pytest.raises(InputError, match=r"faults gremlin: no such fault; there are gps_loss, .*silence"):
        faults_named(["gps_loss", "gremlin"])


def test_a_fault_of_a_sensor_that_the_log_lacks_is_refused():
    with pytest.raises(InputError, match="flow_sign: the log has no flow_rate or flow_velocity; leave this fault out"):
        FAULTS["flow_sign"].inject({Sensor.RANGE: LOG[Sensor.RANGE]}, T0, T1)


def test_a_window_that_ends_before_it_starts_is_refused():
    with pytest.raises(ValueError, match="the end must come after the start"):
        FAULTS["gps_loss"].inject(LOG, 5.0, 5.0)
