"""The table of witnesses, held against the judges, and every belief's witnesses."""

from __future__ import annotations

import inspect
from importlib import import_module

import pytest

from flownav.core.measurement import Sensor
from flownav.navigation import take
from flownav.navigation.gps import gone_to_gps
from flownav.navigation.heading import weigh_heading
from flownav.navigation.height import LEAST_AGREEING
from flownav.navigation.kernel_settings import (
    NO_HEADING,
    AttitudeSettings,
    Equipment,
    FlowSettings,
    GpsSettings,
    HeightSettings,
    PlaceSettings,
)
from flownav.navigation.memory import MEMORY
from flownav.navigation.motion_records import ImuMemory
from flownav.navigation.pad import FIXES_THAT_FIND, pad_at
from flownav.navigation.reasons import FUSED
from flownav.navigation.records import GpsMemory, HeadingMemory, WitnessMemory
from flownav.navigation.settings import NavigatorSettingsFile
from flownav.navigation.trust import OF_BARO, OF_GPS, OF_RANGE
from flownav.navigation.verdicts import Fate
from flownav.navigation.verdicts import Tested as Outcome
from flownav.navigation.vibration import doubted_imu
from flownav.navigation.witnesses import BELIEFS, WITNESSES, witness

SETTINGS = (AttitudeSettings, FlowSettings, GpsSettings, HeightSettings, PlaceSettings)
WAYS = {  # in whose module each is taken
    Sensor.GPS_POSITION: "gps", Sensor.GPS_VELOCITY: "gps", Sensor.FLOW_RATE: "flow", Sensor.FLOW_VELOCITY: "flow",
    Sensor.RANGE: "height", Sensor.BARO: "baro", Sensor.ATTITUDE: "attitude", Sensor.MAG: "heading",
    Sensor.YAW: "heading", Sensor.POSE: "place", Sensor.PAD: "pad", Sensor.LANDED: "place",
}  # fmt: skip


def test_every_sensor_but_the_one_that_moves_the_filter_is_a_witness_once():
    assert sorted(row.kind for row in WITNESSES) == sorted(set(Sensor) - {Sensor.IMU})
    with pytest.raises(KeyError):
        witness(Sensor.IMU)


@pytest.mark.parametrize("row", WITNESSES, ids=lambda row: row.kind.name)
def test_a_row_names_the_laws_that_its_way_offers_to_and_settings_that_there_are(row):
    text = inspect.getsource(import_module(f"flownav.navigation.{WAYS[row.kind]}"))
    text += inspect.getsource(import_module("flownav.navigation.heading")) if row.kind == Sensor.ATTITUDE else ""
    assert row.laws
    for law in row.laws:
        assert f"{law.__name__}(work, lanes" in text
    known = {name for record in SETTINGS for name in record._fields}
    assert row.noise
    assert set(row.noise) <= known
    assert f"Sensor.{row.kind.name}" in inspect.getsource(take.take)
    assert Sensor(row.kind) not in row.contradicted_by


def test_components_whose_noise_is_followed_have_each_a_memory():
    places = {
        Sensor.RANGE: {OF_RANGE}, Sensor.BARO: {OF_BARO}, Sensor.GPS_POSITION: {OF_GPS + i for i in range(3)},
        Sensor.GPS_VELOCITY: {OF_GPS + 3 + i for i in range(3)},
    }  # fmt: skip
    assert {row.kind: row.whiteness for row in WITNESSES if row.whiteness} == {k: len(v) for k, v in places.items()}
    assert sorted(place for each in places.values() for place in each) == list(range(8))
    assert MEMORY.row(WitnessMemory, "factor") >= 0


def states_of(resets) -> set[int]:
    return {each.state for each in resets if each.state >= 0}


def test_a_lasting_refusal_frees_the_states_that_the_row_names():
    s = NavigatorSettingsFile().settings(Equipment(True, False, NO_HEADING, False, -1.0))
    for kind, position in ((Sensor.GPS_POSITION, True), (Sensor.GPS_VELOCITY, False)):
        freed = set()
        for axis in range(3):
            freed |= states_of(gone_to_gps(1.0, 1.0, axis, position, True, False, s.gps))
        pad = states_of(pad_at(0.0, 0.0, 0.0, True)) if position else set()
        assert set(witness(kind).frees) == freed | pad
    assert set(witness(Sensor.PAD).frees) == states_of(pad_at(0.0, 0.0, 0.0, True))
    assert set(witness(Sensor.RANGE).frees) == states_of(doubted_imu(1.0, True, True, ImuMemory())[2])
    tested, m = Outcome(FUSED, 9.0, 1.0, 0.5), HeadingMemory(agreed_s=0.0, refused_s=10.0)
    doubts = weigh_heading.law(Fate(FUSED), tested, GpsMemory(), m, t_s=90.0, gate_sigma=5.0).doubts
    for kind in (Sensor.MAG, Sensor.YAW, Sensor.ATTITUDE):
        assert set(witness(kind).frees) == {each.state for each in doubts if each.variance > 0.0}


def test_a_datum_needs_as_many_readings_that_agree_as_the_row_says():
    assert witness(Sensor.RANGE).first == LEAST_AGREEING
    assert witness(Sensor.PAD).first == FIXES_THAT_FIND
    assert witness(Sensor.BARO).first == 1


@pytest.mark.parametrize("belief", BELIEFS, ids=lambda belief: belief.name)
def test_a_belief_has_two_witnesses_and_whoever_sets_it_alone_leaves_a_doubt(belief):
    assert len(set(belief.witnesses)) == len(belief.witnesses) >= 2
    assert set(belief.alone) <= set(belief.witnesses)
    assert bool(belief.alone) == bool(belief.doubt)
    if belief.doubt:
        module, _, name = belief.doubt.rpartition(".")
        doubt = getattr(import_module(f"flownav.navigation.{module}"), name) if module else None
        settings = NavigatorSettingsFile().settings(Equipment(True, False, NO_HEADING, False, -1.0))
        assert (doubt if module else getattr(settings.gps, name)) > 0.0


def test_every_witness_has_its_say_in_a_belief():
    assert {kind for belief in BELIEFS for kind in belief.witnesses} == set(Sensor)
