"""The table of faults with a small navigator whose answers are known: it follows GPS and refuses what leaps."""

from __future__ import annotations

import json
from collections.abc import Mapping

import numpy as np
import pytest
import typer
from typer.testing import CliRunner

from command import printed
from flownav.campaigns.faults.catalogue import FAULTS, faults_named
from flownav.campaigns.faults.navigator import Event, Flag, Navigated, Offers
from flownav.campaigns.faults.table import fault_table, flight_at, runs, window_start
from flownav.cli import faults as faults_command
from flownav.core.errors import InputError
from flownav.core.measurement import Sensor, Stream

LEAP_M = 8.0
SILENT_S = 0.5
SIGMA_M = 3.0
FIX_S = 0.25  # a fix comes five times a second, and not quite evenly


def follow_gps(streams: Mapping[Sensor, Stream]) -> Navigated:
    """The last GPS position that is a number and no leap; silence is flagged."""
    gps = streams[Sensor.GPS_POSITION]
    t_s, position, fused, flags = [], [], [], []
    for stamp, value in zip(gps.t_s, gps.value, strict=True):
        leaps = bool(position) and not np.linalg.norm(value - position[-1]) < LEAP_M
        fused.append(not leaps and bool(np.isfinite(value).all()))
        if t_s and stamp <= t_s[-1]:
            continue
        if t_s and stamp - t_s[-1] > SILENT_S:
            flags.append(Flag(t_s[-1] + SILENT_S, float(stamp), "gps", "silent"))
        t_s.append(float(stamp))
        position.append(value if fused[-1] else position[-1])
    offers = Offers(
        np.repeat(gps.t_s, 3),
        np.full(3 * len(gps), int(Sensor.GPS_POSITION)),
        np.tile([0, 1, 2], len(gps)),
        np.repeat(fused, 3),
        np.repeat(np.where(fused, "", "leap"), 3),
    )
    return Navigated(
        np.array(t_s), np.array(position), np.full((len(t_s), 3), SIGMA_M), offers,
        (Event(t_s[0], "filter", "start"),), tuple(flags),
    )  # fmt: skip


@pytest.fixture(scope="module")
def rows():
    named = ("gps_jump", "gps_drift", "gps_loss", "nan_bursts", "duplicates", "flow_sign", "silence")
    table = fault_table(follow_gps, faults_named(named), (1.5,), (2.0,), seed=2)
    assert [row.fault for row in table] == ["none", *named]
    return {row.fault: row for row in table}


def test_a_fault_of_another_sensor_leaves_every_figure_as_it_is(rows):
    usual, flow = rows["none"].scores, rows["flow_sign"].scores
    assert flow == usual._replace(recovered_after_s=flow.recovered_after_s)
    assert (flow.detected_after_s, flow.recovered_after_s, flow.wrongly_fused) == (None, pytest.approx(0, abs=FIX_S), 0)


def test_a_leap_is_noticed_at_once_and_never_taken_in(rows):
    jump = rows["gps_jump"].scores
    assert 0.0 <= jump.detected_after_s <= FIX_S
    assert jump.wrongly_fused == 0
    assert jump.max_error_m < rows["none"].scores.max_error_m + 1.0
    assert 0.0 <= jump.recovered_after_s <= FIX_S


def test_a_drift_is_taken_in_reading_by_reading_and_shows_in_the_error(rows):
    drift = rows["gps_drift"].scores
    assert drift.detected_after_s is None
    assert drift.wrongly_fused == pytest.approx(10, abs=1)  # 2 s at 5 Hz
    assert 0.0 <= drift.recovered_after_s <= FIX_S


def test_lost_gps_is_noticed_by_its_flag_and_nothing_wrong_is_fused(rows):
    for name in ("gps_loss", "silence"):
        assert SILENT_S - FIX_S <= rows[name].scores.detected_after_s <= SILENT_S
        assert rows[name].scores.wrongly_fused == 0
    assert rows["silence"].duration_s == 5.0
    assert rows["gps_loss"].duration_s == 2.0


def test_nan_is_refused_and_duplicates_are_fused_twice(rows):
    assert rows["nan_bursts"].scores.wrongly_fused == 0
    assert 0.0 <= rows["nan_bursts"].scores.detected_after_s <= FIX_S
    assert rows["duplicates"].scores.wrongly_fused == pytest.approx(10, abs=1)


def test_every_fault_can_be_flown_at_once_and_counts_its_rows():
    done: list[int] = []
    table = fault_table(follow_gps, tuple(FAULTS.values()), (0.5,), (1.0,), on_progress=done.append)
    assert len(table) == len(done) == runs(tuple(FAULTS.values()), (0.5,), (1.0,)) == len(FAULTS) + 1
    for row in table:
        assert row.scores.touchdown_error_m is not None
        json.dumps(row.entry(), allow_nan=False)


def test_another_vehicle_flies_the_same_path_and_feels_its_own_forces():
    own, quad = flight_at(1.5, 1.0, seed=1), flight_at(1.5, 1.0, seed=1, vehicle="quad-450")
    hover = window_start(1.5)
    for log in (own, quad):
        row = np.searchsorted(log.truth["t_s"], hover)
        assert log.truth["pos_d_m"][0] - log.truth["pos_d_m"][row] == pytest.approx(1.5, abs=0.2)
    standing = [-log.truth["pos_d_m"][0] for log in (own, quad)]
    assert abs(standing[0] - standing[1]) > 0.01  # its centre of gravity stands at another height


@pytest.mark.parametrize("height_m", [0.5, 3.0])
def test_the_flight_hovers_while_the_fault_lasts_and_lands_after_it(height_m):
    log = flight_at(height_m, 5.0, seed=1)
    truth, t0_s = log.truth, window_start(height_m)
    cg_on_pad_m = -truth["pos_d_m"][0]
    lasting = (truth["t_s"] >= t0_s) & (truth["t_s"] < t0_s + 5.0)
    np.testing.assert_allclose(-truth["pos_d_m"][lasting] - cg_on_pad_m, height_m, atol=0.3)
    assert (truth["on_ground"][lasting] == 0.0).all()
    assert truth["on_ground"][-1] == 1.0
    assert np.hypot(truth["pos_n_m"][-1], truth["pos_e_m"][-1]) < 0.5


# -- the command ---------------------------------------------------------------------------------------------
@pytest.fixture
def command(monkeypatch):
    monkeypatch.setattr(faults_command, "navigator", lambda vehicle: follow_gps)
    app = typer.Typer()
    app.command()(faults_command.command)
    return lambda *arguments: CliRunner().invoke(app, ["--offline", *arguments])


def test_json_is_one_object_with_a_row_for_each(command):
    done = command("--faults", "gps_jump,silence", "--heights", "0.5", "--durations", "1,2", "--seed", "3", "--json")
    assert done.exit_code == 0, done.output
    facts = json.loads(done.stdout)
    assert (facts["seed"], facts["heights_m"], facts["durations_s"]) == (3, [0.5], [1.0, 2.0])
    assert [(row["fault"], row["height_m"], row["duration_s"]) for row in facts["rows"]] == [
        ("none", 0.5, 0.0),
        ("gps_jump", 0.5, 1.0),
        ("gps_jump", 0.5, 2.0),
        ("silence", 0.5, 5.0),
    ]
    assert set(facts["rows"][0]) == {
        "fault", "height_m", "duration_s", "detected_after_s", "moved_m", "max_error_m", "recovered_after_s",
        "wrongly_fused", "touchdown_error_m", "unflagged_above_3_sigma_s",
    }  # fmt: skip


def test_the_table_names_fault_and_height(command):
    done = command("--faults", "gps_loss", "--heights", "0.5", "--durations", "1")
    assert done.exit_code == 0, done.output
    line = next(line for line in done.stdout.splitlines() if "gps_loss" in line)
    assert [cell.strip() for cell in line.strip("│ ").split("│")][:3] == ["gps_loss", "0.5", "1"]
    assert "noticed: first rejection" in done.stdout


@pytest.mark.parametrize(
    ("options", "message"),
    [
        (("--faults", "gremlin"), "--faults gremlin: no such fault"),
        (("--faults", " , "), "--faults: give one at least"),
        (("--heights", "0.1"), "--heights 0.1: must be from 0.3 to 20.0"),
        (("--heights", "low"), "--heights low: a number is needed"),
        (("--heights", "nan"), "--heights nan: must be"),
        (("--durations", "0"), "--durations 0.0: must be from 0.1 to 60.0"),
        (("--seed", "-1"), "--seed -1: must be from 0"),
    ],
)
def test_a_wrong_option_is_refused(command, options, message):
    done = command(*options)
    assert isinstance(done.exception, InputError)
    assert message in printed(done.exception)
