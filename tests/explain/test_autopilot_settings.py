"""The settings of an autopilot: parameters of both dialects, new and old, as the same facts."""

from __future__ import annotations

import pytest

from flownav.studies.explain.autopilot_settings import ARDUPILOT, BARO, GPS, PX4, RANGE, UNKNOWN, settings_stated


def test_nothing_is_told_by_nothing():
    facts = settings_stated({})
    assert (facts.dialect, facts.sets, facts.takes_flow, facts.flow_delay_s) == (UNKNOWN, (), None, None)


def test_px4_of_today():
    facts = settings_stated(
        {
            "EKF2_OF_CTRL": 1,
            "EKF2_GPS_CTRL": 7,
            "EKF2_HGT_REF": 2,
            "EKF2_OF_DELAY": 20,
            "EKF2_GPS_DELAY": 110,
            "SENS_FLOW_ROT": 2,
            "SENS_FLOW_SCALE": 1.1,
            "EKF2_RNG_NOISE": 0.3,
            "EKF2_OF_QMIN": 5,
            "SENS_FLOW_MAXHGT": 8.0,
        }
    )
    one = facts.set_at(1)
    assert facts.dialect == PX4
    assert one is not None
    assert (one.flow, one.gps, one.height, one.compass) == (True, True, RANGE, True)
    assert facts.flow_delay_s == pytest.approx(0.02)
    assert facts.gps_delay_s == pytest.approx(0.11)
    assert (facts.flow_turn_deg, facts.scale_x, facts.height_noise_m, facts.least_quality) == (90.0, 1.1, 0.3, 5)
    assert facts.flow_high_m == 8.0


def test_px4_without_a_receiver_takes_no_gps():
    one = settings_stated({"EKF2_OF_CTRL": 0, "EKF2_GPS_CTRL": 7, "SYS_HAS_GPS": 0}).set_at(1)
    assert one is not None
    assert (one.flow, one.gps, one.height) == (False, False, GPS)


@pytest.mark.parametrize(
    ("mask", "flow", "gps"), [(1, False, True), (2, True, False), (3, True, True), (0, False, False)]
)
def test_px4_before_1_14(mask, flow, gps):
    one = settings_stated({"EKF2_AID_MASK": mask, "EKF2_HGT_MODE": 0}).set_at(1)
    assert one is not None
    assert (one.flow, one.gps, one.height) == (flow, gps, BARO)


def test_ardupilot_and_its_source_sets():
    facts = settings_stated(
        {
            "EK3_SRC1_POSXY": 3,
            "EK3_SRC1_VELXY": 3,
            "EK3_SRC1_POSZ": 1,
            "EK3_SRC1_YAW": 1,
            "EK3_SRC2_POSXY": 0,
            "EK3_SRC2_VELXY": 5,
            "EK3_SRC2_POSZ": 2,
            "EK3_SRC2_YAW": 0,
            "EK3_FLOW_DELAY": 30,
            "GPS1_DELAY_MS": 0,
            "FLOW_ORIENT_YAW": -9000,
            "FLOW_FXSCALER": 100,
            "FLOW_FYSCALER": -50,
            "RNGFND1_MIN_CM": 20,
            "RNGFND1_MAX_CM": 700,
            "EK3_ALT_M_NSE": 2.0,
        }
    )
    assert facts.dialect == ARDUPILOT
    assert facts.takes_flow
    first, second = facts.set_at(1), facts.set_at(2)
    assert first is not None
    assert second is not None
    assert (first.flow, first.gps, first.height, first.compass) == (False, True, BARO, True)
    assert (second.flow, second.gps, second.height, second.compass) == (True, False, RANGE, False)
    assert facts.set_at(3) is None
    assert facts.flow_delay_s == pytest.approx(0.08)  # EKF3 takes 50 ms off by itself
    assert facts.gps_delay_s is None  # 0: the driver's own
    assert facts.flow_turn_deg == pytest.approx(-90.0)
    assert (facts.scale_x, facts.scale_y) == pytest.approx((1.1, 0.95))
    assert (facts.range_low_m, facts.range_high_m) == pytest.approx((0.2, 7.0))


def test_metres_of_ardupilot_4_7_stand_above_centimetres():
    assert settings_stated({"EK3_ALT_M_NSE": 2.0, "RNGFND1_MAX": 12.0, "RNGFND1_MAX_CM": 700}).range_high_m == 12.0
