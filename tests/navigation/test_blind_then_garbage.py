"""Flow that sees nothing for long and then garbage, without GPS: one reading sets neither velocity nor position."""

from __future__ import annotations

import numpy as np
import pytest
from test_hard_flights import noisy

from flownav.core.measurement import Sensor
from flownav.navigation import verdicts
from flownav.navigation.flow import learn
from flownav.navigation.flow_judge import BLIND_S, counted_agreement, hold_back
from flownav.navigation.kernel_settings import FlowSettings
from flownav.navigation.reasons import FUSED, SILENT
from flownav.navigation.records import (
    AGREEING,
    AidMemory,
    FlowInnovation,
    FlowMemory,
    GpsMemory,
    Look,
    Reading,
)
from navigation_streams import Flown, circle, fly, navigate

GPS = (Sensor.GPS_POSITION, Sensor.GPS_VELOCITY)
T0_S, SEES_S, SOUND_S = 8.0, 28.0, 31.0
LOOK = Look(reason=FUSED)
ALONE = AidMemory(aided_s=0.0, flag=2.0)


def without_gps() -> Flown:
    flown = noisy(fly(circle, 45.0), 3)
    for sensor in GPS:
        flown = flown.cut(sensor, T0_S, np.inf)
    return flown


def with_garbage(flown: Flown, seed: int) -> Flown:
    """Anything up to 2 rad/s at full quality, until SOUND_S."""
    flow = flown.streams[Sensor.FLOW_RATE]
    value, wrong = flow.value.copy(), flow.t_s < SOUND_S
    value[wrong, :2] = np.random.default_rng(seed).uniform(-2.0, 2.0, (np.count_nonzero(wrong), 2))
    sees = flow.t_s < T0_S
    value[sees] = flow.value[sees]
    return flown.changed(Sensor.FLOW_RATE, value=value).cut(Sensor.FLOW_RATE, T0_S, SEES_S)


@pytest.mark.parametrize("seed", range(4))
def test_garbage_after_blindness_moves_the_position_no_more_than_silence_does(seed):
    flown = without_gps()
    run = navigate(with_garbage(flown, seed))
    silent = navigate(flown.cut(Sensor.FLOW_RATE, T0_S, SOUND_S))
    error, other = np.linalg.norm(run.error[:, :2], axis=1), np.linalg.norm(silent.error[:, :2], axis=1)
    t_s = run.estimate_rows.t_s
    between = (t_s > SEES_S) & (t_s < SOUND_S)
    assert error[between].max() < other[between].max() + 0.5
    assert error[t_s > SOUND_S + 1.0].max() < other[between].max() + 0.5
    sigma_m = run.estimate_rows.std_pos_ned_m[:, :2]
    assert (np.abs(run.error[:, :2]) < 3.0 * sigma_m)[t_s > SEES_S].all()
    aided = run.events("filter", "aided")
    assert len(aided) == 1
    assert aided[0, 0] == pytest.approx(SOUND_S + 0.05 * AGREEING, abs=0.2)  # until then the position is invalid


def test_flow_that_sees_again_is_fused_once_five_readings_agree():
    flown = without_gps().cut(Sensor.FLOW_RATE, T0_S, SEES_S)
    aided = navigate(flown).events("filter", "aided")
    assert aided[:, 0] == pytest.approx([SEES_S + 0.05 * AGREEING], abs=0.11)


@pytest.mark.parametrize(
    ("look", "aid", "flow", "held", "agreed"),
    [
        (LOOK, ALONE, FlowMemory(taken_s=9.9 - BLIND_S), 1.0, 0.0),
        (LOOK, ALONE, FlowMemory(taken_s=10.1 - BLIND_S), 0.0, AGREEING),  # not for long enough
        (LOOK, AidMemory(), FlowMemory(taken_s=0.0), 0.0, AGREEING),  # something else aids
        (Look(reason=SILENT), ALONE, FlowMemory(taken_s=0.0), 0.0, AGREEING),  # it still sees nothing
        (LOOK, ALONE, FlowMemory(taken_s=9.9, agreed=4.5), 1.0, 4.5),
        (LOOK, AidMemory(), FlowMemory(taken_s=9.9, agreed=4.5), 0.0, AGREEING),
    ],
)
def test_who_waits(look, aid, flow, held, agreed):
    found = hold_back.law(look, GpsMemory(), aid, flow, t_s=10.0)
    assert (found.held.held, found.flow.agreed) == (held, agreed)
    assert found.flow._replace(agreed=flow.agreed) == flow


def test_readings_agree_within_the_noise_of_two_and_one_that_does_not_counts_against_it():
    waits = FlowMemory(agreed=2.0)
    assert counted_agreement(0.35, 0.01, waits) == 2.5  # 2.5 sigma of the noise of two is 0.354
    assert counted_agreement(-0.35, 0.01, waits) == 2.5
    assert counted_agreement(-0.36, 0.01, waits) == 1.5
    assert counted_agreement(0.36, 0.01, FlowMemory(agreed=0.0)) == 0.0
    assert counted_agreement(0.0, 0.01, FlowMemory(agreed=4.5)) == AGREEING
    assert counted_agreement(9.0, 0.01, FlowMemory()) == AGREEING  # nobody waits


def test_a_flow_that_waits_teaches_no_noise_and_one_that_does_not_wait_does():
    tested, before = verdicts.Tested(FUSED, innovation=1.0, total=0.02, variance=0.01), FlowInnovation(0.0)
    fields = dict.fromkeys(FlowSettings._fields, 0.0) | {"flow_noise_time_s": 10.0, "gate_sigma": 5.0}
    settings = FlowSettings(**fields)
    for agreed, teaches in ((0.0, False), (4.5, False), (AGREEING, True)):
        memory = FlowMemory(taken_s=9.95, agreed=agreed)
        after = learn.law(
            tested, Reading(quality=255.0), before, memory, t_s=10.0, angular=True, component=0, s=settings
        )
        assert (after.excess > memory.excess) == teaches
        assert after.ratio > memory.ratio  # it is judged all the same
