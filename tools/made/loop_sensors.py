"""Generator B, the sensors: an IMU that its driver averages, PX4FLOW's flow and gyro, a laser or a sonar, a barometer.

Written apart from generator A's: vibration is that of rotors which turn as the motors push, readings are means over
their intervals, flow is metric in its noise, and the sonar says 0.3 m below it.
"""

from __future__ import annotations

import numpy as np
from numba import njit

from made.flight import Array, Made, Table, draws, truth_tables
from made.loop_dynamics import STEP_S
from made.loop_flight import Flown, between, flown, in_body, wandering
from made.loop_traits import Traits, traits_of


def make(name: str, number: int) -> Made:
    """One flight of a class of generator B."""
    traits = traits_of(name, draws(name, number, "traits"))
    flight = flown(traits, draws(name, number, "motion"))
    turning = np.vstack([flight.truth.rate_frd_rad_s, flight.truth.rate_frd_rad_s[-1:]])
    tables = {"imu": imu(traits, flight, draws(name, number, "imu"))}
    ranges = distance(traits, flight, draws(name, number, "range"))
    seen = flow(traits, flight, turning, draws(name, number, "flow"))
    if traits.flow == "metric":
        tables["px4flow"] = metric(seen, ranges)
    else:
        tables |= {"flow": seen, "range": ranges}
    if traits.baro:
        tables["baro"] = barometer(flight, tables["imu"]["t_s"], draws(name, number, "baro"))
    tables = {
        name_: _gapped(traits, name_, table, draws(name, number, name_ + "gaps")) for name_, table in tables.items()
    }
    return Made(name, number, tables | truth_tables(flight.truth, draws(name, number, "capture")), flight.truth)


def _gapped(traits: Traits, name: str, table: Table, random: np.random.Generator) -> Table:
    """A table with silences: short ones of an IMU, long ones of others, and a row here and there."""
    count = round(between(random, traits.gaps))
    if not count:
        return table
    t_s = table["t_s"]
    kept = random.random(len(t_s)) > (0.001 if name == "imu" else 0.02)
    for _ in range(count):
        begin_s = between(random, (float(t_s[0]) + 3.0, float(t_s[-1]) - 5.0))
        length_s = between(random, (0.02, 0.12) if name == "imu" else (0.2, 1.5))
        kept &= (t_s < begin_s) | (t_s > begin_s + length_s)
    return {column: values[kept] for column, values in table.items()}


# -- the IMU -----------------------------------------------------------------------------------------------------
@njit(cache=True)
def _mounted(values, natural_hz, damping):
    """Columns (n, k) as a mass on a spring and a damper follows them."""
    found = np.empty_like(values)
    w = 2.0 * np.pi * natural_hz
    for column in range(values.shape[1]):
        state, speed = values[0, column], 0.0
        for row in range(values.shape[0]):
            speed += (w * w * (values[row, column] - state) - 2.0 * damping * w * speed) * STEP_S
            state += speed * STEP_S
            found[row, column] = state
    return found


def imu(traits: Traits, flight: Flown, random: np.random.Generator) -> Table:
    """imu.csv: means over the driver's interval of what moves the chip."""
    truth, thrust = flight.truth, flight.thrust[:-1]
    shaking = between(random, traits.shaking)
    moved = np.column_stack([truth.rate_frd_rad_s, truth.force_frd_m_s2]) + shaking * _vibration(random, thrust)
    mount_hz = between(random, traits.mount_hz)
    if mount_hz > 0.0:
        moved = _mounted(moved, mount_hz, between(random, (0.15, 0.4)))
    each = round(1.0 / (traits.imu_hz * STEP_S))
    count = len(moved) // each
    mean = moved[: count * each].reshape(count, each, 6).mean(axis=1)
    level = np.minimum(thrust.sum(axis=1), 1.4)[: count * each].reshape(count, each).mean(axis=1)
    gyro, accel = mean[:, :3], mean[:, 3:]
    noise = np.sqrt(traits.imu_hz) * np.array([between(random, (8e-5, 2.5e-4)), between(random, (8e-4, 2.5e-3))])
    across = random.normal(0.0, 0.004, (2, 3, 3))
    gyro = gyro + gyro @ across[0] + _gyro_bias(traits, random, count) + noise[0] * random.standard_normal((count, 3))
    accel = accel + accel @ across[1] + random.normal(0.0, 0.06, 3) + noise[1] * random.standard_normal((count, 3))
    accel += (level**3)[:, None] * _shift(traits, random, shaking)
    gyro = np.round(gyro / (np.pi / 180.0 / 16.4)) * (np.pi / 180.0 / 16.4)
    accel = np.round(accel / (9.80665 / 2048.0)) * (9.80665 / 2048.0)
    t_s = (np.arange(count) + 1) * each * STEP_S + between(random, (0.0005, 0.002))
    t_s = t_s + np.minimum(random.exponential(0.04, count), 0.8) / traits.imu_hz
    axes = zip("xyz", gyro.T, accel.T, strict=True)
    table = {"t_s": t_s}
    for axis, turning, pulling in axes:
        table |= {f"gyro_{axis}_rad_s": turning, f"accel_{axis}_m_s2": pulling}
    return table


def _vibration(random: np.random.Generator, thrust: Array) -> Array:
    """The vibration of unbalanced rotors (n, 6) [rad/s, m/s2]: a force that turns with each, as the square of its
    speed.
    """
    hover_hz = between(random, (85.0, 210.0))
    hz = hover_hz * np.sqrt(np.maximum(thrust, 0.0) / 0.25)
    phase = 2.0 * np.pi * np.cumsum(hz, axis=0) * STEP_S + random.uniform(0.0, 2.0 * np.pi, 4)
    size = np.maximum(thrust, 0.0) / 0.25 * random.uniform(0.3, 1.5, 4)
    sine, cosine = size * np.sin(phase), size * np.cos(phase)
    twice = size * np.sin(2.0 * phase)
    shaken = np.column_stack([
        0.02 * (cosine @ random.normal(0.0, 1.0, 4)), 0.02 * (sine @ random.normal(0.0, 1.0, 4)),
        0.01 * (sine @ random.normal(0.0, 1.0, 4)),
        0.8 * cosine.sum(axis=1), 0.8 * sine.sum(axis=1), 0.5 * (twice @ random.normal(0.0, 1.0, 4)),
    ])  # fmt: skip
    rush = np.sqrt(np.maximum(thrust.sum(axis=1), 0.0))[:, None] * random.standard_normal((len(thrust), 6))
    return shaken + rush * np.array([0.03, 0.03, 0.02, 1.2, 1.2, 1.0])


def _gyro_bias(traits: Traits, random: np.random.Generator, count: int) -> Array:
    """Bias (n, 3) [rad/s]: what the last calibration left, what it wanders by, what warming up adds."""
    at_s = np.arange(count) / traits.imu_hz
    left = traits.gyro_bias_rad_s * random.uniform(-1.6, 1.6, 3)
    ticks = int(at_s[-1] / 0.01) + 2
    wander = 1e-4 * np.column_stack([wandering(random, ticks, 30.0) for _ in range(3)])[(at_s / 0.01).astype(int)]
    warm = between(random, traits.warming_rad_s) * random.choice([-1.0, 1.0], 3) * random.uniform(0.3, 1.0, 3)
    return left + wander + np.outer(at_s / (at_s + between(random, (10.0, 50.0))), warm)


def _shift(traits: Traits, random: np.random.Generator, shaking: float) -> Array:
    """The shift of the accelerometer's mean at hover [m/s2] (3,)."""
    shift = 0.05 * shaking * shaking * random.standard_normal(3)
    if traits.accel_lie_m_s2[1] > 0.0:
        shift += 0.25 * random.standard_normal(3)
        shift[random.integers(3)] = random.choice([-1.0, 1.0]) * between(random, traits.accel_lie_m_s2)
    return shift


# -- flow --------------------------------------------------------------------------------------------------------
FASTEST_RAD_S = 4.0  # beyond, block matching finds nothing: four pixels a frame


def below(flight: Flown, place: Array, ray: Array) -> Array:
    """How far along a ray (n, 3), earth's axes, the floor or the table is from a place (n, 3) [m] (n,)."""
    slope = np.maximum(ray[:, 2], 0.3)
    found = (flight.ground_m - place[:, 2]) / slope
    for north_0, north_1, east_0, east_1, top in flight.boxes:
        along = (top - place[:, 2]) / slope
        hit = place[:, :2] + along[:, None] * ray[:, :2]
        inside = (hit[:, 0] > north_0) & (hit[:, 0] < north_1) & (hit[:, 1] > east_0) & (hit[:, 1] < east_1)
        found = np.where(inside & (along > -0.02), np.minimum(found, np.maximum(along, 0.0)), found)
    return found


def tilted(quaternion: Array, forward: float, right: float) -> Array:
    """A direction beside the body's z, in the earth's axes (n, 3) of unit length."""
    w, x, y, z = quaternion.T
    columns = np.array([
        [1 - 2 * (y * y + z * z), 2 * (x * y - w * z), 2 * (x * z + w * y)],
        [2 * (x * y + w * z), 1 - 2 * (x * x + z * z), 2 * (y * z - w * x)],
        [2 * (x * z - w * y), 2 * (y * z + w * x), 1 - 2 * (x * x + y * y)],
    ])  # fmt: skip
    ray = np.einsum("ijn,j->ni", columns, np.array([forward, right, 1.0]))
    return ray / np.linalg.norm(ray, axis=1)[:, None]


def seen_rate(flight: Flown, turning: Array, rows: Array, lever_frd_m: Array) -> Array:
    """Flow [rad/s] (n, 2), PX4's convention, of a lens beside the IMU that looks along the body's z."""
    truth = flight.truth
    rate, quaternion = turning[rows], truth.quaternion[rows]
    velocity = in_body(quaternion, truth.vel_ned_m_s[rows]) + np.cross(rate, lever_frd_m)
    place = truth.pos_ned_m[rows] + _carried(quaternion, lever_frd_m)
    along = np.maximum(below(flight, place, tilted(quaternion, 0.0, 0.0)), 0.015)
    return np.column_stack([rate[:, 0] - velocity[:, 1] / along, rate[:, 1] + velocity[:, 0] / along])


def _carried(quaternion: Array, lever_frd_m: Array) -> Array:
    """A point of the body (3,) as the earth has it (n, 3)."""
    back = quaternion * np.array([1.0, -1.0, -1.0, -1.0])
    return in_body(back, np.broadcast_to(lever_frd_m, (len(back), 3)))


def flow(traits: Traits, flight: Flown, turning: Array, random: np.random.Generator) -> Table:
    """flow.csv: means over each interval, noise that is a velocity's, a gyro on the same board, quality."""
    truth = flight.truth
    rows = np.arange(0, len(truth.t_s) - 1, 5)
    lever = random.normal(0.0, 0.015, 3) * np.array([1.0, 1.0, 0.3]) + np.array([0.0, 0.0, 0.012])
    rate = seen_rate(flight, turning, rows, lever)
    gain = between(random, (0.87, 1.02)) * (1.0 + random.normal(0.0, 0.01, 2))
    ends = _instants(random, float(truth.t_s[rows[-1]]), traits.flow_hz)
    mean = _means(truth.t_s[rows], rate, ends) * gain
    own = _means(truth.t_s[rows], turning[rows, :2], ends)
    own = (
        own * (1.0 + random.normal(0.0, 0.01, 2)) + random.normal(0.0, 0.004, 2) + random.normal(0.0, 0.006, own.shape)
    )
    at = np.minimum(np.searchsorted(truth.t_s, ends[1:]), len(truth.t_s) - 1)
    height = np.maximum(flight.ground_m - truth.pos_ned_m[at, 2], 0.02)
    texture = np.clip(0.8 + 0.18 * _patches(random, truth.pos_ned_m[at, :2]), 0.0, 1.0)
    texture = np.where(_spells(random, flight, traits.lost, (1.0, 3.0), ends[1:]), 0.0, texture)
    sharp = np.clip(height / 0.25, 0.1, 1.0)
    frames = np.sqrt(20.0 / traits.flow_hz)  # of a slow one, more are averaged
    sigma = np.hypot(between(random, (0.015, 0.04)) / height, between(random, (0.02, 0.05))) / (
        frames * sharp * (0.2 + texture)
    )
    still = flight.thrust[at].sum(axis=1) < 0.02
    noise = np.where(still, 0.1, 1.0)[:, None] * np.minimum(sigma, 1.5)[:, None] * random.standard_normal(mean.shape)
    blind = (texture < 0.1) | (np.abs(mean) > FASTEST_RAD_S).any(axis=1)
    blind |= (random.random(len(at)) < 0.02 + 0.25 * (sharp < 0.5)) & ~still
    quality = np.clip(255.0 * texture * np.sqrt(sharp) + random.normal(0.0, 15.0, len(at)), 1.0, 255.0)
    value = np.where(blind[:, None], 0.0, np.round((mean + noise) * 1e4) / 1e4)
    return {
        "t_s": ends[1:] + between(random, (0.004, 0.015)) + 0.001 * random.random(len(at)),
        "flow_x_rad_s": value[:, 0], "flow_y_rad_s": value[:, 1],
        "gyro_x_rad_s": own[:, 0], "gyro_y_rad_s": own[:, 1],
        "quality": np.where(blind, 0.0, np.round(quality)),
    }  # fmt: skip


def metric(seen: Table, ranges: Table) -> Table:
    """px4flow.csv: what the board makes of its flow, its gyro and its sonar."""
    metres = np.interp(seen["t_s"], ranges["t_s"], ranges["range_m"])
    held = seen["quality"] > 0.0
    forward = (seen["flow_y_rad_s"] - seen["gyro_y_rad_s"]) * metres
    right = -(seen["flow_x_rad_s"] - seen["gyro_x_rad_s"]) * metres
    return {
        "t_s": seen["t_s"], "flow_comp_m_x_m_s": np.where(held, forward, 0.0),
        "flow_comp_m_y_m_s": np.where(held, right, 0.0), "ground_distance_m": metres, "quality": seen["quality"],
    }  # fmt: skip


def _instants(random: np.random.Generator, end_s: float, hz: float) -> Array:
    """Ends of intervals [s]: a clock of its own, a little fast or slow, and late now and then."""
    period = (1.0 + random.normal(0.0, 0.005)) / hz
    ends = period * (np.arange(int((end_s - 0.05) / period)) + random.random())
    return ends + np.where(random.random(len(ends)) < 0.03, 0.15 * period, 0.0)


def _means(t_s: Array, values: Array, ends: Array) -> Array:
    """Means of columns between instants (n,): (n - 1, k)."""
    step = t_s[1] - t_s[0]
    summed = np.vstack([np.zeros(values.shape[1]), np.cumsum(values, axis=0) * step])
    at_s = np.append(t_s, t_s[-1] + step)
    upto = np.column_stack([np.interp(ends, at_s, column) for column in summed.T])
    return np.diff(upto, axis=0) / np.diff(ends)[:, None]


def _patches(random: np.random.Generator, place: Array) -> Array:
    """The variation of a floor's texture over north and east (n,), of about unit variance."""
    waves = random.normal(0.0, 2.5, (6, 2))
    return np.sqrt(2.0 / 6.0) * np.cos(place @ waves.T + random.uniform(0.0, 2.0 * np.pi, 6)).sum(axis=1)


def _spells(
    random: np.random.Generator, flight: Flown, howmany: tuple[float, float], length_s: tuple[float, float], t_s: Array
) -> Array:
    """Some spells in flight (n,), true within one."""
    within = np.zeros(len(t_s), bool)
    low, high = flight.truth.take_off_s + 5.0, flight.truth.landing_s - 7.0
    for begin_s in random.uniform(low, high, int(between(random, howmany))):
        within |= np.abs(t_s - begin_s) < 0.5 * between(random, length_s)
    return within


# -- range and pressure ------------------------------------------------------------------------------------------
SONAR_LEAST_M, SONAR_MOST_M = 0.3, 5.0


def distance(traits: Traits, flight: Flown, random: np.random.Generator) -> Table:
    """range.csv: a laser's centimetres, or a sonar's wide cone."""
    truth, sonar = flight.truth, traits.ranging == "sonar"
    hz = between(random, (10.0, 25.0) if sonar else (25.0, 60.0))
    ends = _instants(random, float(truth.t_s[-1]), hz)
    rows = np.minimum((ends / STEP_S).astype(int), len(truth.t_s) - 1)
    quaternion = truth.quaternion[rows]
    place = truth.pos_ned_m[rows] + _carried(quaternion, np.array([0.02, 0.0, 0.01]))
    metres = below(flight, place, tilted(quaternion, 0.0, 0.0))
    if sonar:
        for forward, right in ((0.2, 0.0), (-0.2, 0.0), (0.0, 0.2), (0.0, -0.2)):
            metres = np.minimum(metres, below(flight, place, tilted(quaternion, forward, right)))
    spinning = flight.thrust[rows].sum(axis=1) > 0.02
    if sonar:
        metres = metres * between(random, (0.98, 1.02)) + 0.012 * random.standard_normal(len(rows))
        metres = np.round(np.maximum(metres, SONAR_LEAST_M), 2)
        wild = (random.random(len(rows)) < 0.01) & spinning
        metres = np.where(
            wild, np.where(random.random(len(rows)) < 0.5, SONAR_MOST_M, np.minimum(2.0 * metres, 5.0)), metres
        )
    else:
        metres = (
            metres + between(random, (0.004, 0.012)) * random.standard_normal(len(rows)) + random.normal(0.0, 0.008)
        )
        metres = np.round(np.maximum(metres, 0.0), 3)
        wild = (random.random(len(rows)) < 0.001) & spinning
        metres = np.where(wild, random.uniform(0.0, 6.0, len(rows)), metres)
    held = _spells(random, flight, traits.stuck, (0.5, 4.0), ends)
    last = np.maximum.accumulate(np.where(held, 0, np.arange(len(rows))))
    late_s = between(random, (0.02, 0.05)) if sonar else between(random, (0.003, 0.015))
    return {"t_s": ends + late_s, "range_m": metres[last], "valid": np.ones(len(rows))}


def barometer(flight: Flown, t_s: Array, random: np.random.Generator) -> Table:
    """baro.csv: a row for each of the IMU's, the same again until the chip has a new one; at first a wrong one."""
    truth = flight.truth
    chip_s = np.arange(0.0, truth.t_s[-1] + 0.1, 1.0 / between(random, (9.0, 30.0)))
    rows = np.minimum((chip_s / STEP_S).astype(int), len(truth.t_s) - 1)
    weather = 0.25 * wandering(random, int(chip_s[-1] / 0.01) + 2, 20.0)[(chip_s / 0.01).astype(int)]
    height = np.maximum(flight.ground_m - truth.pos_ned_m[rows, 2], 0.0)
    wash = between(random, (0.2, 1.2)) * np.minimum(flight.thrust[rows].sum(axis=1), 1.0) * np.exp(-height / 0.25)
    above = between(random, (-20.0, 900.0)) - truth.pos_ned_m[rows, 2] + weather - wash
    above = above + between(random, (0.05, 0.25)) * random.standard_normal(len(rows))
    begin = chip_s < between(random, (0.2, 1.5))
    wrong = between(random, (3.0, 30.0)) * random.choice([-1.0, 1.0])
    above = np.where(begin, above + wrong * (random.random() + np.linspace(1.0, 0.2, len(rows))), above)
    return {"t_s": t_s, "alt_m": np.round(above[np.maximum(np.searchsorted(chip_s, t_s, side="right") - 1, 0)], 2)}
