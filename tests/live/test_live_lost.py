"""Recordings of real autopilots' simulators in which flownav was lost, or led its vehicle astray (shared data)."""

from __future__ import annotations

import numpy as np
import pytest

from flownav.core.measurement import Sensor
from flownav.logs.mavlink.framing import coder
from played_recordings import RAW_IMU, Played, with_others
from recorded_link import Arrival
from scaled_imu import scaled_imu_beside

OPTICAL_FLOW_RAD = 106


@pytest.fixture
def played(data_folder):
    """A recording's name, and until when; played."""

    def of(name, until_s=float("inf"), others=()):
        make = "px4-live" if name.startswith("px4") else "ardupilot-live"
        return Played(data_folder / make / name, until_s, others)

    return of


def test_a_vehicle_without_gps_is_sent_an_estimate_within_seconds(played):
    """ArduPilot tells of a receiver that it does not have; a navigator waited for its fix, and nobody could arm."""
    found = played("no-gps-never-sends", 40.0)
    assert found.t_s[0] - 17.8 < 5.0  # the vehicle's time when it is first received
    assert found.longest_gap_s(0.0) < 0.2
    assert np.abs(found.error_m).max() < 0.15
    assert not found.session.intake.gps_received


def test_flow_that_cannot_be_believed_is_said_and_its_end_is_a_counted_reset(played):
    """10 s of noise from 75.4 s: nothing was sent for 38 s, and what came back was 5 m off without a reset."""
    found = played("flow-noise-silence")
    withheld = [t_s for t_s in found.notes.when("withheld") if t_s > 75.0]
    assert withheld[0] < 76.5
    before = found.between(75.0, withheld[0])
    assert np.hypot(*found.error_m[before, :2].T).max() < 1.0
    anchored = found.notes.when("anchored")[0]  # once more later, without a gap, which is no jump
    assert anchored < 85.5 + 2.0
    after = found.between(anchored, np.inf)
    assert set(found.resets[after]) == {found.resets[before][-1] + 1}
    velocities = [now_s for now_s, message in found.sent if message.msgname == "VISION_SPEED_ESTIMATE"]
    assert len(velocities) > 20.0 * (anchored - withheld[0])
    assert found.longest_gap_s(anchored) < 0.2


def noisy_flow(since_s, until_s, noise_rad_s):
    """A recording of PX4 whose flow sensor sees noise for a while."""

    def heard(frames, truth):
        mav, chance = coder(1, 1), np.random.default_rng(3)
        for arrival in scaled_imu_beside(frames, truth):
            yield arrival if arrival.message_id != OPTICAL_FLOW_RAD else noisy(arrival, mav, chance)

    def noisy(arrival, mav, chance):
        said = mav.decode(bytearray(arrival.frame))
        if not since_s <= said.time_usec * 1e-6 < until_s:
            return arrival
        for name in ("integrated_x", "integrated_y"):
            off_rad = chance.normal(0.0, noise_rad_s) * said.integration_time_us * 1e-6
            setattr(said, name, getattr(said, name) + off_rad)
        mav.srcSystem, mav.srcComponent, mav.seq = arrival.frame[5], arrival.frame[6], arrival.frame[4]
        told = [getattr(said, name) for name in said.ordered_fieldnames]
        again = mav.optical_flow_rad_encode(**dict(zip(said.ordered_fieldnames, told, strict=True)))
        return Arrival(arrival.now_s, bytes(again.pack(mav)))

    return heard


def test_px4_too_is_told_the_velocity_alone_and_then_another_place(data_folder):
    """8 s of noise without GPS; PX4 was sent nothing any more, for good."""
    folder = data_folder / "px4-live" / "px4-indoor-liftoff-bias"
    found = Played(folder, 68.0, beside=noisy_flow(55.0, 63.0, 1.0))
    withheld = [t_s for t_s in found.notes.when("withheld") if t_s > 50.0]
    assert withheld[0] < 56.0
    before = found.between(50.0, withheld[0])
    assert np.hypot(*found.error_m[before, :2].T).max() < 1.0
    [anchored] = found.notes.when("anchored")
    assert 63.0 < anchored < 63.0 + 5.0
    places = np.isfinite(found.error_m[:, 0])
    assert not places[found.between(withheld[0] + 0.05, anchored - 0.05)].any()
    assert found.session.velocities > 20.0 * (anchored - withheld[0])
    after = found.between(anchored + 0.01, np.inf)
    assert set(found.resets[after]) == {found.resets[before][-1] + 1}
    strayed_m = found.error_m[after, :2] - found.error_m[after, :2][0]
    assert np.hypot(*strayed_m.T).max() < 0.5


def test_a_stuck_accelerometer_is_not_flown_on(played):
    """From 68.6 to 74.6 s it says 3 m/s2 on all axes: down was wrong by 553 m, with quality 41 to 71."""
    found = played("accel-stuck", 85.0)
    assert ("imu", "stuck") in [(source, kind) for _, source, kind, _ in found.notes.all]
    assert np.abs(found.error_m[found.between(60.0, 85.0)]).max() < 0.5
    during = found.between(69.2, 74.5)
    assert not during.any()
    again = found.t_s[found.t_s > 74.5]
    assert again[0] < 74.6 + 2.0
    assert found.session.reason == ""


@pytest.mark.parametrize("others", [("SCALED_IMU2",), ("SCALED_IMU2", "SCALED_IMU3")])
def test_another_accelerometer_flies_on_while_one_is_stuck(played, others):
    """The same recording of a vehicle with more than one of them."""
    found = played("accel-stuck", 85.0, others)
    assert "imu" in [source for _, source, _, _ in found.notes.all]
    assert np.abs(found.error_m[found.between(60.0, 85.0)]).max() < 0.5
    assert found.longest_gap_s(60.0) < 0.3
    assert found.session.reason == ""


GYRO_FAULT_S = 55.0, 64.0  # the stuck accelerometer follows at 68.6 s
GYRO_FAULT_MRAD_S, STUCK_S = 50, 6.0


def after_a_gyro_fault(others):
    """The recording of a stuck accelerometer whose first gyro was off before; other IMUs were not."""

    def heard(frames, truth):
        mav = coder(1, 1)
        for arrival in with_others(frames, truth, others):
            yield arrival if arrival.message_id != RAW_IMU else turned(arrival, mav)

    def turned(arrival, mav):
        raw = mav.decode(bytearray(arrival.frame))
        if not GYRO_FAULT_S[0] <= raw.time_usec * 1e-6 < GYRO_FAULT_S[1]:
            return arrival
        told = {name: getattr(raw, name) for name in raw.ordered_fieldnames}
        told["zgyro"] += GYRO_FAULT_MRAD_S
        mav.srcSystem, mav.srcComponent, mav.seq = arrival.frame[5], arrival.frame[6], arrival.frame[4]
        return Arrival(arrival.now_s, bytes(mav.raw_imu_encode(**told).pack(mav)))

    return heard


@pytest.mark.parametrize(
    ("others", "longest_gap_s"), [((), STUCK_S + 2.0), (("SCALED_IMU2",), 0.3)], ids=["alone", "with another"]
)
def test_a_gyro_fault_before_it_does_not_make_a_stuck_accelerometer_believed(data_folder, others, longest_gap_s):
    """It was sent 26.7 m down within 2 s, and then nothing to the end."""
    found = Played(data_folder / "ardupilot-live" / "accel-stuck", 88.0, beside=after_a_gyro_fault(others))
    assert "imu" in [source for _, source, _, _ in found.notes.all]
    assert np.abs(found.error_m[found.between(GYRO_FAULT_S[0], 88.0)]).max() < 0.5
    assert found.longest_gap_s(50.0) < longest_gap_s
    assert found.t_s[-1] > 88.0
    assert found.session.reason == ""


def test_the_heading_holds_without_gps(played):
    """A turn of 1.5 deg/s at lift-off was learnt as the gyro's bias, and the heading ran away by that ever since."""
    found = played("px4-no-gps-heading")
    flying = found.t_s > 39.0
    off_rad = np.remainder(found.yaw_rad - found.true_yaw_rad + np.pi, 2.0 * np.pi) - np.pi
    assert np.degrees(np.abs(off_rad[flying])).max() < 8.0  # the field that PX4 tells has EKF2's own bias taken off
    assert np.hypot(*found.error_m[flying, :2].T).max() < 1.0
    assert found.longest_gap_s(0.0) < 0.3
    assert found.session.dropped["link: lost"] < 10  # frames of messages that nobody knows are not lost
    assert found.session.intake.readings[Sensor.MAG] > 500
