"""Generator A, the sensors: a MEMS IMU on a vibrating frame, a mouse sensor's counts (PMW3901), a time-of-flight range.

NumPy alone.
"""

from __future__ import annotations

import numpy as np

from made.flight import GRAVITY_M_S2, Array, Made, Table, draws, truth_tables
from made.spline_flight import RATE_HZ, STEP_S, Flown, band_noise, between, fly, into_earth
from made.spline_floor import Floor, depths, floor_of
from made.spline_traits import Traits, traits_of


def make(name: str, number: int) -> Made:
    """One flight of a class of generator A."""
    traits = traits_of(name, draws(name, number, "traits"))
    flown = fly(traits, draws(name, number, "motion"))
    floor = floor_of(traits, flown, draws(name, number, "floor"))
    tables = {
        "imu": imu(traits, flown, draws(name, number, "imu")),
        "flow": flow(traits, flown, floor, draws(name, number, "flow")),
        "range": distance(traits, flown, floor, draws(name, number, "range")),
        **truth_tables(flown.truth, draws(name, number, "capture")),
    }
    if traits.baro:
        tables["baro"] = barometer(flown, draws(name, number, "baro"))
    return Made(name, number, tables, flown.truth)


# -- the IMU -----------------------------------------------------------------------------------------------------
GYRO_LSB, ACCEL_LSB = np.deg2rad(2000.0) / 32768.0, 16.0 * GRAVITY_M_S2 / 32768.0


def imu(traits: Traits, flown: Flown, random: np.random.Generator) -> Table:
    """imu.csv: what is so, turned and scaled, shaken by four rotors, through the mount and the chip's low-pass."""
    truth, motors = flown.truth, flown.motors[:-1]
    count, shaking = len(motors), between(random, traits.shaking)
    true = np.column_stack([truth.rate_frd_rad_s, truth.force_frd_m_s2])
    shaken = true + shaking * _shaking(random, motors)
    mount_hz = between(random, traits.mount_hz)
    lowest_hz = (18.0, 40.0) if traits.imu_hz < 100 else (70.0, 120.0)
    seen = _passed(shaken, mount_hz, between(random, (0.15, 0.4)), between(random, lowest_hz))
    turn = np.eye(3) + random.normal(0.0, 0.006, (3, 3))
    gyro, accel = seen[:, :3] @ turn.T, seen[:, 3:] @ (np.eye(3) + random.normal(0.0, 0.005, (3, 3))).T
    gyro = gyro * (1.0 + random.normal(0.0, 0.002, 3)) + _gyro_bias(traits, random, count)
    gyro = gyro + accel @ (2e-5 * random.standard_normal((3, 3)))
    accel = accel + random.normal(0.0, 0.04, 3) + _lie(traits, random, motors, shaking)
    each = round(RATE_HZ / traits.imu_hz)
    rows = np.arange(each - 1, count, each)
    gyro, accel = gyro[rows], accel[rows]
    gyro = gyro + 0.001 * random.standard_normal(gyro.shape)
    gyro = gyro + _spikes(traits, random, flown.motors[rows], traits.imu_hz)
    accel = accel + 0.006 * random.standard_normal(accel.shape)
    gyro, accel = np.round(gyro / GYRO_LSB) * GYRO_LSB, np.round(accel / ACCEL_LSB) * ACCEL_LSB
    names = [f"{what}_{axis}_{unit}" for what, unit in (("gyro", "rad_s"), ("accel", "m_s2")) for axis in "xyz"]
    at_s = truth.t_s[rows] + STEP_S + 0.002
    return {"t_s": at_s, **dict(zip(names, np.column_stack([gyro, accel]).T, strict=True))}


def _shaking(random: np.random.Generator, motors: Array) -> Array:
    """Vibration of a frame (n, 6) [rad/s, m/s2]: a tone a rotor, its double, and what the air adds; none at rest."""
    count = len(motors)
    shaken = np.zeros((count, 6))
    size = np.array([0.02, 0.02, 0.012, 0.9, 1.1, 0.7])
    for _ in range(4):
        hz = between(random, (110.0, 260.0)) * (0.6 + 0.4 * motors)
        hz = hz * (1.0 + 0.01 * band_noise(random, count, 0.05, 3.0))
        phase = 2.0 * np.pi * np.cumsum(hz) * STEP_S
        for axis in range(6):
            first, second = random.uniform(0.0, 2.0 * np.pi, 2)
            shaken[:, axis] += 0.5 * random.uniform(0.4, 1.6) * size[axis] * (
                np.sin(phase + first) + 0.4 * np.sin(2.0 * phase + second)
            )  # fmt: skip
    broad = random.standard_normal((count, 6))
    return (shaken + 2.2 * size * broad) * (motors**1.5)[:, None]


def _passed(values: Array, mount_hz: float, damping: float, low_hz: float) -> Array:
    """Columns through a mass on springs (none: 0 Hz) and a second-order low-pass, by their responses."""
    count = len(values)
    padded = np.concatenate([values, np.repeat(values[-1:], RATE_HZ, 0), np.repeat(values[:1], RATE_HZ, 0)])
    s = 2j * np.pi * np.fft.rfftfreq(len(padded), STEP_S)
    w = 2.0 * np.pi * low_hz
    response = w * w / (s * s + np.sqrt(2.0) * w * s + w * w)
    if mount_hz > 0.0:
        m = 2.0 * np.pi * mount_hz
        response = response * (m * m + 2.0 * damping * m * s) / (s * s + 2.0 * damping * m * s + m * m)
    return np.fft.irfft(np.fft.rfft(padded, axis=0) * response[:, None], len(padded), axis=0)[:count]


def _gyro_bias(traits: Traits, random: np.random.Generator, count: int) -> Array:
    """Bias of a gyro [rad/s] (n, 3): what it has, a slow walk, and what it gets as the chip warms up."""
    fixed = traits.gyro_bias_rad_s * random.standard_normal(3)
    walk = np.column_stack([np.cumsum(random.standard_normal(count)) for _ in range(3)]) * 1.5e-5 * np.sqrt(STEP_S)
    warm = between(random, traits.warming_rad_s) * random.uniform(-1.0, 1.0, 3)
    slow_s = between(random, (15.0, 60.0))
    return fixed + walk + warm * (1.0 - np.exp(-np.arange(count) * STEP_S / slow_s))[:, None]


def _lie(traits: Traits, random: np.random.Generator, motors: Array, shaking: float) -> Array:
    """The effect of vibration on an accelerometer that is not symmetric [m/s2] (n, 3): a shift that grows with it."""
    shift = 0.04 * shaking**2 * random.standard_normal(3)
    worst, size = random.choice(3, p=[0.4, 0.4, 0.2]), between(random, traits.accel_lie_m_s2)
    shift += 0.45 * size * random.uniform(-1.0, 1.0, 3)
    shift[worst] = size * random.choice([-1.0, 1.0])
    standing = between(random, (0.3, 1.0))  # a frame on a floor may shake as much as one in the air
    level = np.interp(motors, (0.0, 0.5, 1.0), (0.0, standing, 1.0))
    level = level * (1.0 + between(random, (0.03, 0.2)) * band_noise(random, len(motors), 0.05, 1.0))
    return level[:, None] * shift


def _spikes(traits: Traits, random: np.random.Generator, motors: Array, imu_hz: int) -> Array:
    """Single gyro readings that are far off (n, 3): what knocks leave, which tip a vehicle rather than turn it."""
    each = between(random, traits.spikes_hz) / imu_hz
    struck = (random.random((len(motors), 3)) < each) & (motors > 0.0)[:, None]
    return np.where(struck, random.normal(0.0, 5.0, (len(motors), 3)), 0.0) * np.array([1.0, 1.0, 0.1])


# -- flow --------------------------------------------------------------------------------------------------------
FOOTPRINT_RAD = 0.16  # where the four points beside the middle of what it sees lie
RAYS = ((0.0, 0.0), (1.0, 0.0), (-1.0, 0.0), (0.0, 1.0), (0.0, -1.0))
NEAREST_FOCUS_M = 0.08


def flow(traits: Traits, flown: Flown, floor: Floor, random: np.random.Generator) -> Table:
    """flow.csv: counts between reads as the sensor's registers add them up, and what it thinks of them."""
    truth = flown.truth
    rows = np.arange(0, len(truth.t_s) - 1, 4)
    askew = _askew(random, np.deg2rad(between(random, traits.askew_deg)))
    lens_m = between(random, (0.02, 0.045))
    seen, texture = image_motion(flown, floor, rows, lens_m, askew)
    lost = _stretches(random, flown, traits.lost, (1.5, 3.5), truth.t_s[rows])
    texture = np.where(lost, 0.0, texture) * between(random, (0.85, 1.0))
    height = np.maximum(-truth.pos_ned_m[rows, 2] - floor.height(*truth.pos_ned_m[rows, :2].T), 0.0) + lens_m
    focus = np.clip((height / NEAREST_FOCUS_M) ** 2, 0.0, 1.0)
    fall, most = between(random, (0.02, 0.1)), between(random, (0.9, 1.0))
    speed = np.hypot(*seen.T)
    gain = np.clip(most - fall * speed, 0.6, 1.1) * np.clip(0.55 + 0.6 * texture, 0.0, 1.0) ** 0.5
    gain = np.where((height < 0.06) & (random.random() < 0.5), 0.0, gain * (0.3 + 0.7 * focus))
    step_s = 4.0 * STEP_S
    reads = _reads(random, truth.t_s[-1], traits.flow_hz)
    summed = np.concatenate([np.zeros((1, 2)), np.cumsum(seen * gain[:, None], axis=0)]) * step_s
    at_s = np.append(truth.t_s[rows], truth.t_s[rows[-1]] + step_s)
    angle = np.diff(np.column_stack([np.interp(reads, at_s, column) for column in summed.T]), axis=0)
    here = np.searchsorted(truth.t_s[rows], reads[1:] - 0.5 / traits.flow_hz)
    here = np.minimum(here, len(rows) - 1)
    counts, quality = _counted(traits, random, angle, texture[here], flown.motors[rows[here]])
    interval_s = np.diff(reads)
    rate = counts * traits.quantum_rad / interval_s[:, None]
    late_s = between(random, (0.002, 0.008))
    return {"t_s": reads[1:] + late_s, "flow_x_rad_s": rate[:, 0], "flow_y_rad_s": rate[:, 1], "quality": quality}


def image_motion(flown: Flown, floor: Floor, rows: Array, lens_m: float, askew: Array) -> tuple[Array, Array]:
    """The motion through the sensor's middle [rad/s] (n, 2) in its own axes, PX4's convention, and texture (n,).

    rows (n,): of the truth. askew (3, 3): the sensor's axes in the vehicle's, as columns. Over its aperture it is the
    mean of the motion at five points, each at its depth, weighted by their texture.
    """
    truth = flown.truth
    position, quaternion = truth.pos_ned_m[rows], truth.quaternion[rows]
    back = quaternion * np.array([1.0, -1.0, -1.0, -1.0])
    velocity = into_earth(back, truth.vel_ned_m_s[rows]) @ askew
    rate = truth.rate_frd_rad_s[rows] @ askew
    weights, nearness = np.zeros(len(rows)), np.zeros(len(rows))
    for x, y in RAYS:
        ray = np.array([FOOTPRINT_RAD * x, FOOTPRINT_RAD * y, 1.0])
        along, north, east = depths(floor, position, quaternion, lens_m, askew @ ray)  # of a ray of depth 1
        texture = floor.texture(north, east)
        weight = (2.0 if x == y == 0.0 else 1.0) * (0.05 + texture)
        weights, nearness = weights + weight, nearness + weight / np.maximum(along, 0.015)
    nearness = nearness / weights
    texture = (weights / 6.0 - 0.05).clip(0.0, 1.0)
    return np.column_stack([rate[:, 0] - velocity[:, 1] * nearness, rate[:, 1] + velocity[:, 0] * nearness]), texture


def _askew(random: np.random.Generator, angle_rad: float) -> Array:
    """A turn by an angle about an axis drawn evenly (3, 3)."""
    axis = random.standard_normal(3)
    x, y, z = axis / np.linalg.norm(axis)
    cross = np.array([[0.0, -z, y], [z, 0.0, -x], [-y, x, 0.0]])
    return np.eye(3) + np.sin(angle_rad) * cross + (1.0 - np.cos(angle_rad)) * cross @ cross


def _reads(random: np.random.Generator, end_s: float, hz: float) -> Array:
    """When the registers are read [s]: a task's period, its jitter, here and there one left out."""
    count = int(end_s * hz)
    reads = (np.arange(count) + random.random()) / hz + np.clip(random.normal(0.0, 0.02, count), -0.2, 0.2) / hz
    kept = random.random(count) > 0.002
    return reads[kept & (reads < end_s - 0.01)]


def _counted(
    traits: Traits, random: np.random.Generator, angle: Array, texture: Array, motors: Array
) -> tuple[Array, Array]:
    """Whole counts (n, 2) of the angles between reads, and quality (n,). What is left of a count stays for the next."""
    poor = np.clip(1.0 - texture, 0.0, 1.0)
    exact = angle / traits.quantum_rad
    noise = (0.35 + 0.05 * np.abs(exact) + 0.9 * poor[:, None] ** 2) * random.standard_normal(exact.shape)
    exact = exact + np.where(motors[:, None] > 0.0, noise, 0.05 * noise)
    counts = np.diff(np.round(np.cumsum(exact, axis=0)), axis=0, prepend=np.zeros((1, 2)))
    blind = texture < 0.05
    quality = np.round(np.clip(300.0 * (1.0 - 0.8 * poor) + 12.0 * random.standard_normal(len(poor)), 30.0, 255.0))
    return np.where(blind[:, None], 0.0, counts), np.where(blind, 0.0, quality)


def _stretches(
    random: np.random.Generator, flown: Flown, howmany: tuple[float, float], length_s: tuple[float, float], t_s: Array
) -> Array:
    """Some stretches of a flight (n,), true within one."""
    found = np.zeros(len(t_s), bool)
    for _ in range(int(between(random, howmany))):
        begin_s = between(random, (flown.truth.take_off_s + 4.0, flown.truth.landing_s - 6.0))
        found |= (t_s >= begin_s) & (t_s < begin_s + between(random, length_s))
    return found


# -- range and pressure ------------------------------------------------------------------------------------------
CONE_RAD = (0.0, 0.1, 0.2)
OUT_OF_SIGHT_M = 4.0


def distance(traits: Traits, flown: Flown, floor: Floor, random: np.random.Generator) -> Table:
    """range.csv: the nearer part of what lies in a cone, in millimetres; photons are few from afar."""
    truth, hz = flown.truth, between(random, traits.range_hz)
    ticks = (np.arange(int(truth.t_s[-1] * hz) - 1) + random.random()) / hz
    rows = np.minimum(np.round(ticks * RATE_HZ).astype(int), len(truth.t_s) - 1)
    position, quaternion = truth.pos_ned_m[rows], truth.quaternion[rows]
    lens_m = between(random, (0.02, 0.04))
    rays = [(0.0, 0.0)] + [(wide * x, wide * y) for wide in CONE_RAD[1:] for x, y in RAYS[1:]]
    seen = np.stack([
        depths(floor, position, quaternion, lens_m, np.array([x, y, 1.0]) / np.sqrt(1.0 + x * x + y * y))[0]
        for x, y in rays
    ])  # fmt: skip
    metres = np.quantile(seen, 0.25, axis=0)
    rough_m = 0.006 if floor.kind == "carpet" else 0.0
    noise_m = between(random, (0.003, 0.006)) + between(random, (0.003, 0.01)) * metres + rough_m
    metres = metres * (1.0 + random.normal(0.0, 0.006)) + random.normal(0.0, 0.006) + rough_m
    metres = metres + noise_m * random.standard_normal(len(rows))
    wild = (random.random(len(rows)) < traits.outliers) & (flown.motors[rows] > 0.0)
    metres = np.where(wild, random.uniform(0.0, 2.5, len(rows)), metres)
    held = _stretches(random, flown, traits.stuck, (0.5, 4.0), ticks)
    last = np.maximum.accumulate(np.where(held, 0, np.arange(len(rows))))
    metres = np.round(np.maximum(metres, 0.0)[last], 3)
    valid = np.where(metres < OUT_OF_SIGHT_M, 1.0, 0.0)
    if traits.baro:  # a sensor that says nothing from too near
        valid = np.where(metres < 0.05, 0.0, valid)
    return {"t_s": ticks + between(random, (0.01, 0.03)), "range_m": metres, "valid": valid}


BARO_HZ, REPEATED_HZ = 25.0, 950.0


def barometer(flown: Flown, random: np.random.Generator) -> Table:
    """baro.csv: a slow sensor repeated by a fast log, wrong until its own filter has settled, pushed by the rotors."""
    truth = flown.truth
    ticks = np.arange(0.0, truth.t_s[-1], 1.0 / BARO_HZ)
    rows = np.minimum(np.round(ticks * RATE_HZ).astype(int), len(truth.t_s) - 1)
    metres = between(random, (5.0, 600.0)) - truth.pos_ned_m[rows, 2]
    wrong = random.choice([-1.0, 1.0]) * between(random, (5.0, 60.0))
    metres = metres + wrong * np.exp(-ticks / between(random, (0.3, 2.5)))
    height = np.maximum(-truth.pos_ned_m[rows, 2] - flown.ground_m, 0.0)
    metres = metres - between(random, (0.2, 1.0)) * flown.motors[rows] * np.exp(-height / 0.3)
    metres = metres + 0.15 * random.standard_normal(len(rows))
    metres = metres + 0.3 * band_noise(random, len(truth.t_s), 0.02, 0.2)[rows]
    at_s = np.arange(0.0, ticks[-1], 1.0 / REPEATED_HZ) + 0.0005
    repeated = metres[np.searchsorted(ticks, at_s, side="right") - 1]
    return {"t_s": at_s, "alt_m": np.round(repeated, 2)}
