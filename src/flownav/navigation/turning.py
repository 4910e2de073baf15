"""The vehicle's turning over a flow reading's exposure, from the readings that wait and those that were fed.

As `logs.log.mean_over` and `attitude_rates` have it of a log's columns: rates are linear between readings, outside them
the nearest holds; of attitudes it is the rotation from the exposure's start to its end.
"""

from typing import NamedTuple

import numpy as np

from flownav.core.compile import ONE_LANE, Work, arctan2, equation, larger, procedure, replacing, smaller
from flownav.navigation.packed import load_equipment
from flownav.navigation.waiting import (
    attitude_row,
    load_inertial,
    load_own_gyro,
    load_queue,
    load_sizes,
    load_stated_attitude,
    ring_row,
    store_own_gyro,
    taken_out,
)
from flownav.navigation.waiting_records import FLOW_RATE, Arrival, Inertial, OwnGyro, Queue, Sizes, StatedAttitude

MOST_OWN = 300.0  # readings over which a flow sensor's own gyro is compared, 30 s of 10 Hz: chosen
LEAST_SINE = 1e-12  # of half a turn: less is as its own sine

with_turned = replacing(Arrival, "value_2", "value_3", "value_4", "value_5")
Rates = tuple[float, float]  # about body forward and right [rad/s]


@procedure
def next_reading(r: Work, p: Work, place: int) -> Arrival:
    """The reading at a place of `waiting.due` as it goes to the navigator: a flow with the turning meanwhile."""
    a = taken_out(r, place)
    if a.sensor == FLOW_RATE and a.exposure_s > 0.0:
        return with_turning(r, p, a)
    return a


@equation
def with_turning(r: Work, p: Work, a: Arrival) -> Arrival:
    """A flow reading with the mean rates over its exposure beside its own gyro's, or in their place where it has none.

    They are those of the inertial readings; else of the external attitude, which stands in the sensor's place only.
    Where the sensor's own gyro was taken for dead its readings are followed all the same (`beside`).
    """
    s, q = load_sizes(r, ONE_LANE, 0), load_queue(r, ONE_LANE, 0)
    begin_s = a.end_s - a.exposure_s
    unknown = np.nan
    turning, spare = (unknown, unknown), (unknown, unknown)
    first, kept = since(r, s, q, a.end_s - 2.0 * a.exposure_s)
    if kept > 1:
        turning = mean_rates(r, s, q, first, begin_s, a.end_s)
        spare = turning
    elif q.attitudes > 1.0:
        spare = rates_by_attitude(r, s, q, begin_s, a.end_s)
    if load_equipment(p).flow_gyro_is_imu:
        gyro, turning = beside(load_own_gyro(r, ONE_LANE, 0), a.value_2, a.value_3, turning)
        store_own_gyro(r, ONE_LANE, 0, gyro)
    return with_turned(
        a,
        value_2=a.value_2 if np.isfinite(a.value_2) else spare[0],
        value_3=a.value_3 if np.isfinite(a.value_3) else spare[1],
        value_4=turning[0],
        value_5=turning[1],
    )


@equation
def beside(m: OwnGyro, x: float, y: float, turning: Rates) -> tuple[OwnGyro, Rates]:
    """The memory of a sensor's own gyro after it read x and y, and the turning: its own less its bias, or that by the
    inertial unit while it has only repeated one value.

    It looks when the flow looks, so that it serves better than the mean of an inertial unit over a guessed exposure. It
    was taken for dead because the vehicle stood still while it was tested.
    """
    if not (np.isfinite(x) and np.isfinite(y)):
        return m, turning
    same = np.isnan(m.first_x) or (x == m.first_x and y == m.first_y)
    first_x, first_y = x if same else np.inf, y if same else np.inf
    if not (np.isfinite(turning[0]) and np.isfinite(turning[1])):
        return OwnGyro(first_x, first_y, m.readings, m.bias_x, m.bias_y), (x, y)
    readings = smaller(m.readings + 1.0, MOST_OWN)
    bias_x = m.bias_x + (x - turning[0] - m.bias_x) / readings
    bias_y = m.bias_y + (y - turning[1] - m.bias_y) / readings
    found = turning if same else (x - bias_x, y - bias_y)
    return OwnGyro(first_x, first_y, readings, bias_x, bias_y), found


# -- by inertial readings -----------------------------------------------------------------------------------
@equation
def since(r: Work, s: Sizes, q: Queue, t_s: float) -> tuple[int, int]:
    """The first of the readings from an instant on and the one before it, and how many these are; without spikes."""
    first, kept = int(q.count), 0
    for back in range(int(q.count)):
        place = int(q.count) - 1 - back
        one = load_inertial(r, ONE_LANE, ring_row(s, q.first, place), 0)
        if one.order > 0.0:
            first, kept = place, kept + 1
            if one.t_s <= t_s:
                break
    return first, kept


class Integral(NamedTuple):
    """The integral of two rates up to the newest reading that was added [rad], and the same up to an instant."""

    x: float
    y: float
    at_x: float
    at_y: float


@equation
def integral_at(at_s: float, one: Inertial, then: Inertial, before: Integral, x: float, y: float) -> Integral:
    """With one reading more; x and y: the integrals up to it. Between both the integral is taken for linear."""
    here = one.t_s <= at_s and at_s < then.t_s
    share_s = at_s - one.t_s
    step_s = then.t_s - one.t_s
    within_x, within_y = (x - before.x) / step_s * share_s + before.x, (y - before.y) / step_s * share_s + before.y
    there_x, there_y = before.x if share_s == 0.0 else within_x, before.y if share_s == 0.0 else within_y
    at_x, at_y = there_x if here else before.at_x, there_y if here else before.at_y
    return Integral(x, y, x if at_s >= then.t_s else at_x, y if at_s >= then.t_s else at_y)


@equation
def beyond(at_s: float, first: Inertial, last: Inertial, found: Integral) -> Rates:
    """An integral up to an instant, also where that lies outside the readings."""
    before_s, after_s = smaller(at_s - first.t_s, 0.0), larger(at_s - last.t_s, 0.0)
    return (
        found.at_x + before_s * first.gyro_x + after_s * last.gyro_x,
        found.at_y + before_s * first.gyro_y + after_s * last.gyro_y,
    )


@equation
def mean_rates(r: Work, s: Sizes, q: Queue, place: int, begin_s: float, end_s: float) -> Rates:
    """Mean of the turning from begin to end, by the readings from a place of the ring on."""
    first = load_inertial(r, ONE_LANE, ring_row(s, q.first, place), 0)
    begun, ended, last = Integral(0.0, 0.0, 0.0, 0.0), Integral(0.0, 0.0, 0.0, 0.0), first
    for k in range(place + 1, int(q.count)):
        one = load_inertial(r, ONE_LANE, ring_row(s, q.first, k), 0)
        if one.order > 0.0:
            step_s = one.t_s - last.t_s
            x = begun.x + 0.5 * (one.gyro_x + last.gyro_x) * step_s
            y = begun.y + 0.5 * (one.gyro_y + last.gyro_y) * step_s
            begun = integral_at(begin_s, last, one, begun, x, y)
            ended = integral_at(end_s, last, one, ended, x, y)
            last = one
    from_x, from_y = beyond(begin_s, first, last, begun)
    to_x, to_y = beyond(end_s, first, last, ended)
    lasts_s = end_s - begin_s
    return (to_x - from_x) / lasts_s, (to_y - from_y) / lasts_s


# -- by attitudes -------------------------------------------------------------------------------------------
@equation
def attitude_between(at_s: float, one: StatedAttitude, then: StatedAttitude, before: StatedAttitude) -> StatedAttitude:
    """The attitude at an instant, linear between both, held after the later; before: what was found of those before."""
    here = one.t_s <= at_s and at_s < then.t_s
    after = at_s >= then.t_s
    share_s, step_s = at_s - one.t_s, then.t_s - one.t_s
    same = share_s == 0.0
    w, x = (then.qw - one.qw) / step_s * share_s + one.qw, (then.qx - one.qx) / step_s * share_s + one.qx
    y, z = (then.qy - one.qy) / step_s * share_s + one.qy, (then.qz - one.qz) / step_s * share_s + one.qz
    return StatedAttitude(
        at_s,
        then.qw if after else ((one.qw if same else w) if here else before.qw),
        then.qx if after else ((one.qx if same else x) if here else before.qx),
        then.qy if after else ((one.qy if same else y) if here else before.qy),
        then.qz if after else ((one.qz if same else z) if here else before.qz),
    )


@equation
def as_before(before: StatedAttitude, now: StatedAttitude) -> StatedAttitude:
    """An attitude by that quaternion of the two that it has which is nearer to the one before."""
    product = before.qw * now.qw + before.qx * now.qx + before.qy * now.qy + before.qz * now.qz
    sign = -1.0 if product < 0.0 else 1.0
    return StatedAttitude(now.t_s, sign * now.qw, sign * now.qx, sign * now.qy, sign * now.qz)


@equation
def unit(a: StatedAttitude) -> tuple[float, float, float, float]:
    """Its quaternion, of unit length."""
    size = np.sqrt(a.qw * a.qw + a.qx * a.qx + a.qy * a.qy + a.qz * a.qz)
    return a.qw / size, a.qx / size, a.qy / size, a.qz / size


@equation
def rates_by_attitude(r: Work, s: Sizes, q: Queue, begin_s: float, end_s: float) -> Rates:
    """The rates that turn the attitude at begin into that at end: free of gyro bias.

    The rotation is conj(q0) q1; its vector part is half the turn for the small turns between.
    """
    last = load_stated_attitude(r, ONE_LANE, attitude_row(s, q.attitude_first, 0), 0)
    begun, ended = last, last
    for k in range(1, int(q.attitudes)):
        now = as_before(last, load_stated_attitude(r, ONE_LANE, attitude_row(s, q.attitude_first, k), 0))
        begun = attitude_between(begin_s, last, now, begun)
        ended = attitude_between(end_s, last, now, ended)
        last = now
    w0, x0, y0, z0 = unit(begun)
    w1, x1, y1, z1 = unit(ended)
    scalar = w0 * w1 + x0 * x1 + y0 * y1 + z0 * z1
    x = w0 * x1 - x0 * w1 - y0 * z1 + z0 * y1
    y = w0 * y1 + x0 * z1 - y0 * w1 - z0 * x1
    z = w0 * z1 - x0 * y1 + y0 * x1 - z0 * w1
    sine = np.sqrt(x * x + y * y + z * z)
    half_angle = arctan2(sine, abs(scalar))
    stretch = (half_angle / sine if sine > LEAST_SINE else 1.0) * (-1.0 if scalar < 0.0 else 1.0)
    lasts_s = end_s - begin_s
    return 2.0 * x * stretch / lasts_s, 2.0 * y * stretch / lasts_s
