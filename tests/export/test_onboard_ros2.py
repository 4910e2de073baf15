"""The ROS 2 node of examples/ros2, compiled against ROS's own message definitions: it says what Python says.

Where there is no ROS 2, rclcpp is a stand-in (tests/helpers/ros2) that reads and writes messages as lines; the
messages' definitions are those that rosbags has.
"""

from __future__ import annotations

import shutil
import subprocess
from pathlib import Path

import numpy as np
import pymap3d
import pytest

from flownav.core.measurement import Sensor
from flownav.export.onboard.board import Board
from flownav.export.onboard.package import Asked, build
from flownav.logs.log import frd, ned, ned_from_frd
from flownav.navigation import progress
from flownav.navigation.rings import Given, numbers_of
from navigation_streams import circle, fly
from onboard_readings import EXPOSURE_S, RATES, arriving, flight_of, settings_of
from places import PROJECT
from ros2_headers import write_headers

ROS2 = PROJECT / "examples" / "ros2"
MESSAGES = ["sensor_msgs/msg/Imu", "sensor_msgs/msg/Range", "sensor_msgs/msg/NavSatFix", "nav_msgs/msg/Odometry",
            "mavros_msgs/msg/OpticalFlowRad", "diagnostic_msgs/msg/DiagnosticArray"]  # fmt: skip
FLOWN = fly(circle, 12.0, 0.2).only(Sensor.IMU, Sensor.FLOW_RATE, Sensor.RANGE, Sensor.GPS_POSITION)
READINGS = arriving(FLOWN)
HOME, BEGIN_S, GPS_DELAY_S = (47.4, 8.5, 480.0), 1_700_000_000, 0.22
NANO = 1_000_000_000

pytestmark = pytest.mark.skipif(shutil.which("c++") is None, reason="no C++ compiler here: Debian's g++")


@pytest.fixture(scope="module")
def program(tmp_path_factory) -> Path:
    folder = tmp_path_factory.mktemp("ros2")
    build(Asked(rates=RATES), flight_of(FLOWN), folder / "flownav")
    headers = folder / "include"
    headers.mkdir()
    write_headers(headers, MESSAGES)
    settings, library = folder / "flownav" / "flownav_settings.c", folder / "flownav" / "libflownav.a"
    include = [f"-I{headers}", f"-I{folder / 'flownav'}"]
    subprocess.run(["cc", "-c", *include, settings, "-o", folder / "settings.o"], check=True)
    flags = ["-std=c++17", "-O1", "-Wall", "-Wextra", "-Werror"]
    made = folder / "flownav_node"
    subprocess.run(
        ["c++", *flags, *include, ROS2 / "src" / "node.cpp", folder / "settings.o", library, "-o", made], check=True
    )
    return made


# -- messages ---------------------------------------------------------------------------------------------------
def stamp_ns(given: Given) -> int:
    return BEGIN_S * NANO + round(given.t_s * NANO)


def header(given: Given) -> list[object]:
    sec, nanosec = divmod(stamp_ns(given), NANO)
    return [sec, nanosec, '"base_link"']


def integrals(given: Given) -> np.ndarray:
    return np.float32(given.numbers[:2] * EXPOSURE_S)


def line_of(given: Given) -> str:
    """A reading as a message of ROS: ENU and FLU."""
    value, none = given.numbers[:6], [0.0] * 9
    words: list[object] = []
    if given.sensor == Sensor.IMU:
        rates, force = value[:3] * (1, -1, -1), value[3:] * (1, -1, -1)
        words = ["imu", *header(given), 0, 0, 0, 1, *none, *rates, *none, *force, *none]
    elif given.sensor == Sensor.RANGE:
        words = ["range", *header(given), 0, 0.1, 0.01, 30.0, repr(float(np.float32(value[0])))]
    elif given.sensor == Sensor.FLOW_RATE:
        x, y = (float(each) for each in integrals(given))
        micro = round(EXPOSURE_S * 1e6)
        words = ["flow", *header(given), micro, x, -y, 0.0, 0.0, 0.0, 0, int(given.numbers[9]), 0, 0.0]
    elif given.sensor == Sensor.GPS_POSITION:
        place = pymap3d.ned2geodetic(*value[:3], *HOME)
        n, e, d = given.numbers[6:9]
        known = np.isfinite([n, e, d]).all()
        covariance = [e, 0, 0, 0, n, 0, 0, 0, d] if known else none
        words = ["fix", *header(given), 0, 1, *map(float, place), *covariance, 2 if known else 0]
    return " ".join(word if isinstance(word, str) else repr(float(word)) if isinstance(word, float) else str(word)
                    for word in words)  # fmt: skip


def as_heard(given: Given) -> Given:
    """The same as the node should hear it: floats are of 32 bits, seconds are counted from the first stamp's."""
    first_s = stamp_ns(READINGS[0]) // NANO
    sec, nanosec = divmod(stamp_ns(given), NANO)
    numbers = given.numbers.copy()
    if given.sensor == Sensor.FLOW_RATE:
        rates = integrals(given).astype(float) / EXPOSURE_S
        gyro = (0.0, 0.0)
        numbers = numbers_of((*rates, *gyro), (), numbers[9], delay_s=0.5 * EXPOSURE_S, exposure_s=EXPOSURE_S)
    elif given.sensor == Sensor.RANGE:
        numbers = numbers_of((float(np.float32(numbers[0])),))
    elif given.sensor == Sensor.GPS_POSITION:
        numbers[10] = GPS_DELAY_S
    else:
        numbers = numbers_of(numbers[:6])
    return Given(sec - first_s + 1e-9 * nanosec, given.sensor, numbers)


# -- the result ------------------------------------------------------------------------------------------------------
@pytest.fixture(scope="module")
def said(program) -> list[list[str]]:
    text = "\n".join(line_of(given) for given in READINGS)
    done = subprocess.run([program], input=text, capture_output=True, text=True, check=True)
    return [line.split() for line in done.stdout.splitlines()]


def test_its_odometry_is_what_python_says_of_the_same_readings(said):
    settings, lag = settings_of(flight_of(FLOWN))
    board, expected = Board(settings, RATES.sizes, lag=lag), {}
    origin = next(np.array(g.numbers[:3]) for g in READINGS if g.sensor == Sensor.GPS_POSITION)
    for given in READINGS:
        heard = as_heard(given)
        if given.sensor == Sensor.GPS_POSITION:
            heard.numbers[:3] -= origin  # the first fix is the node's origin; the earth is flat enough here
        board.take(heard)
        if given.sensor == Sensor.IMU:
            now = board.now(heard.t_s)
            if now.status == progress.STATE_GIVEN:
                expected[stamp_ns(given)] = now
    rows = [line for line in said if line[0] == "~/odometry"]
    assert len(rows) > 300
    told = {int(row[1]) * NANO + int(row[2]): np.array(row[5:], float) for row in rows}
    assert set(told) <= set(expected)
    found, here = np.array(list(told.values())), [expected[at] for at in told]
    np.testing.assert_allclose(ned(found[:, :3]), [now.pos_ned_m for now in here], atol=1e-4)
    turned = ned_from_frd(found[:, [6, 3, 4, 5]])
    known = np.array([now.quaternion for now in here])
    np.testing.assert_allclose(np.abs(np.sum(turned * known, axis=1)), 1.0, atol=1e-9)
    np.testing.assert_allclose(frd(found[:, 43:46]), [now.vel_frd_m_s for now in here], atol=1e-4)
    np.testing.assert_allclose(frd(found[:, 46:49]), [now.rate_frd_rad_s for now in here], atol=1e-6)
    pose = found[:, 7:43].reshape(-1, 6, 6)
    np.testing.assert_allclose(pose, np.swapaxes(pose, 1, 2))
    variance = np.array([now.pose_covariance for now in here])[:, [0, 6, 11, 15, 18, 20]]
    np.testing.assert_allclose(np.diagonal(pose, axis1=1, axis2=2)[:, [1, 0, 2, 3, 4, 5]], variance, rtol=1e-5)


def test_it_says_when_there_is_nothing_to_fly_on(said):
    status = [line for line in said if line[0] == "/diagnostics"]
    odometry = [line for line in said if line[0] == "~/odometry"]
    levels = [int(line[5]) for line in status]
    assert levels[0] == 2
    assert "it has not started" in " ".join(status[0])
    assert levels.count(2) == len(status) - len(odometry)


def test_cmake_says_what_it_lacks(tmp_path):
    if shutil.which("cmake") is None:
        pytest.skip("no cmake here: Debian's cmake")
    done = subprocess.run(["cmake", "-S", ROS2, "-B", tmp_path], capture_output=True, text=True, check=False)
    assert done.returncode == 1
    assert "no flownav.h there" in " ".join(done.stderr.split())
