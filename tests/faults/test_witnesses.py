"""Each witness lies in turn: the effect of a lie on a stream, and its place in a flight."""

from __future__ import annotations

import numpy as np
import pytest

from flownav.core.measurement import COLUMNS, Sensor, Stream
from witnesses import (
    IN_FIVES,
    LASTS_S,
    LATE_S,
    LIES,
    NOISIER,
    SCALE,
    WITNESSES,
    Cost,
    lied,
    phases,
    table,
)

BY_NAME = {witness.name: witness for witness in WITNESSES}
BEGINS_S = 5.0


def stream_of(witness):
    rng = np.random.default_rng(3)
    t_s = (1.0 + 1e-6) * np.arange(0.0, 20.0, 0.05)  # 0.3 s ago is no tie of two readings
    width = len(COLUMNS[witness.sensor])
    value = 2.0 + np.sin(t_s)[:, None] + 0.01 * rng.standard_normal((len(t_s), width))
    return Stream.of(witness.sensor, t_s, np.round(value > 2.0) if witness.sensor == Sensor.LANDED else value)


@pytest.mark.parametrize("witness", WITNESSES, ids=lambda one: one.name.replace(" ", "_"))
@pytest.mark.parametrize("lie", LIES)
def test_a_lie_touches_its_witness_and_its_five_seconds_alone(witness, lie):
    clean = stream_of(witness)
    told = lied(clean, witness, lie, BEGINS_S, 1)
    outside = (told.t_s < BEGINS_S) | (told.t_s >= BEGINS_S + LASTS_S)
    kept = (clean.t_s < BEGINS_S) | (clean.t_s >= BEGINS_S + LASTS_S)
    assert np.array_equal(told.value[outside], clean.value[kept])
    if lie == "silent":
        assert outside.all()
        return
    changed = (told.value != clean.value).any(axis=0)
    assert not np.delete(changed, np.arange(changed.size)[witness.columns]).any()
    assert changed[witness.columns].any()


def test_each_lie_says_what_its_name_says():
    witness, inside = BY_NAME["range"], slice(100, 200)
    clean = stream_of(witness)
    said = {lie: lied(clean, witness, lie, BEGINS_S, 1).value[:, 0] for lie in LIES if lie != "silent"}
    true = clean.value[:, 0]
    assert np.allclose(said["bias"][inside], true[inside] + witness.bias[0])
    assert np.allclose(said["scale"][inside], SCALE * true[inside])
    assert np.allclose(said["sign"][inside], -true[inside])
    assert (said["stuck"][inside] == true[99]).all()
    assert np.array_equal(said["late"][inside], true[100 - round(LATE_S / 0.05) : 200 - round(LATE_S / 0.05)])
    assert np.array_equal(said["repeated"][100:105], np.full(IN_FIVES, true[100]))
    assert (said["noise"] - true)[inside].std() == pytest.approx(0.01 * NOISIER, rel=0.2)


def test_what_has_no_zero_is_scaled_about_where_it_was():
    witness = BY_NAME["barometer"]
    clean = stream_of(witness)
    told = lied(clean, witness, "sign", BEGINS_S, 1)
    assert told.value[100] == clean.value[100]
    assert told.value[150] - clean.value[100] == pytest.approx(clean.value[100] - clean.value[150])


def test_what_says_yes_or_no_says_the_other():
    witness = BY_NAME["landed"]
    clean = stream_of(witness)
    assert (lied(clean, witness, "sign", BEGINS_S, 1).value[100:200] == 1.0 - clean.value[100:200]).all()


def test_phases_are_those_of_the_flight():
    """On the ground for 10 s, up at 1 m/s to 3 m, down from 60 s on at 0.3 m/s."""
    t_s = np.arange(0.0, 100.0, 0.1)
    height_m = np.clip(np.minimum(t_s - 10.0, 3.0 - 0.3 * (t_s - 60.0)), 0.0, 3.0)
    truth = {"t_s": t_s, "pos_d_m": -height_m, "on_ground": (height_m <= 0.0).astype(float)}
    found = phases(truth)
    assert found["lift-off"] == pytest.approx(9.6, abs=0.11)
    assert found["standing"] + LASTS_S <= found["lift-off"] + 0.01
    assert 12.8 < found["hover"] - 8.0 < 13.1
    assert found["touchdown"] == pytest.approx(69.0, abs=0.2)


def test_the_table_tells_the_worst_and_what_never_came_back():
    found = [
        Cost(1, "range", "bias", "hover", 0.5, 0.0, 0.0),
        Cost(1, "range", "bias", "climb", 1.5, None, 2.0),
    ]
    row = next(line for line in table(found).splitlines() if "bias" in line)
    assert row == "| range | bias | 1.00 | 1.50 | climb | 50 | never | 2.0 |"
