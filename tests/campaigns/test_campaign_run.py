"""A campaign's folder: it goes on after any kill with the same bytes, refuses what is not its own, and is complete."""

from __future__ import annotations

import json
import random
import signal
import subprocess
import sys
import time
from pathlib import Path

import numpy as np
import pytest
from typer.testing import CliRunner

from command import printed
from command import run as typed
from flownav.campaigns import run as running
from flownav.campaigns.engines import Local, Part, neighbours
from flownav.campaigns.local import fly_many
from flownav.campaigns.measures import ROW_COLUMNS
from flownav.campaigns.plan import planned
from flownav.campaigns.run import record_again, run_campaign
from flownav.campaigns.store import PART, Dataset, Store
from flownav.campaigns.summary import inputs_of, summary_of
from flownav.cli import app
from flownav.core.errors import InputError
from flownav.simulation.scenario import load_scenario

SHORT = {"filter.name": "paper", "flight.duration_s": 6.0}


def plan_of(flights, **more):
    given = {"truth_models": ["ensemble"], "seed": 5, "flights": flights, "changes": SHORT} | more
    return planned([load_scenario("landing")], given.pop("sweeps", {}), **given)


def flown(folder, plan):
    with Store(folder).opened(plan) as store:
        return run_campaign(plan, Local(), store)


def files_in(folder):
    return {
        str(path.relative_to(folder)): path.read_bytes() for path in sorted(Path(folder).rglob("*")) if path.is_file()
    }


def test_rows_are_the_flights_of_the_seed_however_they_are_stored(tmp_path):
    plan = plan_of(PART + 40)
    data = flown(tmp_path / "a", plan)
    ready = plan.ready(0)
    assert np.array_equal(data.scores(0), fly_many(ready.flight, 5, PART + 40, ensemble=ready.ensemble), equal_nan=True)
    assert [path.name for path in data.parts(0)] == ["part-00000.parquet", "part-00001.parquet"]
    assert data.column(0, "flight").tolist() == list(range(PART + 40))
    assert set(data.column(0, "verdict")) <= {"landed", "crashed", "went around", "unfinished"}
    drawn = inputs_of(data, 0)
    assert drawn["vehicle.body.mass_kg"].tolist() == ready.ensemble.values(5, 0, PART + 40)["vehicle.body.mass_kg"]


def test_a_damaged_or_missing_part_is_flown_again_with_the_same_bytes(tmp_path):
    plan = plan_of(2 * PART)
    flown(tmp_path, plan)
    whole = files_in(tmp_path)
    first, second = Dataset(tmp_path).parts(0)
    first.write_bytes(first.read_bytes()[:1000])
    second.unlink()
    (tmp_path / "flights" / "cell-000" / ".0123.9.part").write_bytes(b"half")
    flown(tmp_path, plan)
    assert files_in(tmp_path) == whole


def test_another_campaign_a_strangers_folder_and_a_flying_one_are_left_alone(tmp_path):
    flown(tmp_path / "a", plan_of(8))
    with pytest.raises(InputError, match=r"another campaign \(other flights\)"):
        flown(tmp_path / "a", plan_of(7))
    with pytest.raises(InputError, match=r"another campaign \(other seed\)"):
        flown(tmp_path / "a", plan_of(8, seed=6))
    with pytest.raises(InputError, match="sampling"):
        flown(tmp_path / "a", plan_of(9, sampling="latin"))
    (tmp_path / "b").mkdir()
    (tmp_path / "b" / "thesis.txt").write_text("mine")
    with pytest.raises(InputError, match="holds no campaign"):
        flown(tmp_path / "b", plan_of(8))
    with (
        Store(tmp_path / "c").opened(plan_of(8)),
        pytest.raises(InputError, match="another process"),
        Store(tmp_path / "c").opened(plan_of(8)),
    ):
        pass
    (tmp_path / "d").mkdir()
    (tmp_path / "d" / "campaign.json").write_text("{")
    with pytest.raises(InputError, match="cannot be read"):
        flown(tmp_path / "d", plan_of(8))


def test_a_plain_campaign_goes_on_to_more_flights_with_the_same_bytes(tmp_path):
    flown(tmp_path / "grown", plan_of(100))
    flown(tmp_path / "grown", plan_of(PART + 100))
    flown(tmp_path / "whole", plan_of(PART + 100))
    assert files_in(tmp_path / "grown") == files_in(tmp_path / "whole")


def test_other_code_does_not_add_to_a_campaign(tmp_path, monkeypatch):
    flown(tmp_path, plan_of(8))
    monkeypatch.setattr("flownav.campaigns.plan.code_sha256", lambda: "other")
    with pytest.raises(InputError, match="another code of flownav"):
        flown(tmp_path, plan_of(8))


def test_a_campaign_stops_when_its_interval_is_narrow(tmp_path):
    plan = plan_of(4000, until="p95_axis_m width <= 0.05")
    data = flown(tmp_path, plan)
    assert len(data.rows(0)) == 512
    figure = summary_of(plan, data)["cells"][0]["figures"]["p95_axis_m"]
    assert figure["high"] - figure["low"] <= 0.05
    assert figure["confidence"] > 0.99


def test_a_sweep_is_a_cell_for_each_value_with_the_same_noise(tmp_path):
    plan = plan_of(16, sweeps={"wind.speed_20ft_m_s": [0.0, 6.0]}, truth_models=["matched", "ensemble"])
    data = flown(tmp_path, plan)
    summary = summary_of(plan, data)
    assert [cell["label"].split()[-1] for cell in summary["cells"]] == ["matched", "ensemble"] * 2
    assert data.column(2, "set.wind.speed_20ft_m_s").tolist() == [6.0] * 16
    assert summary["flights"] == 64
    assert not inputs_of(data, 0)
    assert inputs_of(data, 1)
    json.dumps(summary, allow_nan=False)


@pytest.mark.parametrize("sampling", ["latin", "sobol"])
def test_a_design_spreads_what_is_drawn(tmp_path, sampling):
    plan = plan_of(1024, sampling=sampling)
    drawn = plan.ready(0).ensemble.values(5, 0, 1024)["wind.from_direction_deg"]
    assert sorted(np.floor(np.array(drawn) / 360.0 * 1024).astype(int)) == list(range(1024))


def test_a_flight_again_is_the_flight_of_the_dataset(tmp_path):
    plan = plan_of(40, sampling="latin")
    data = flown(tmp_path, plan)
    record = record_again(plan, 0, 37)
    assert record.manifest["scores"]["max_position_error_m"] == data.column(0, "max_position_error_m")[37]
    drawn = record.manifest["parameters"]["drawn"]
    assert drawn["vehicle.body.mass_kg"] == inputs_of(data, 0)["vehicle.body.mass_kg"][37]
    record.save(tmp_path / "a.fnr")
    record_again(plan, 0, 37).save(tmp_path / "b.fnr")
    assert (tmp_path / "a.fnr").read_bytes() == (tmp_path / "b.fnr").read_bytes()


def test_parts_that_follow_each_other_are_flown_together():
    parts = [Part(0, 0, 256), Part(1, 256, 256), Part(3, 768, 256), Part(4, 1024, 7)]
    assert [[part.number for part in run] for run in neighbours(parts)] == [[0, 1], [3, 4]]
    assert list(neighbours([])) == []


# -- a part that is being flown ---------------------------------------------------------------------------------
class Killed(Exception):
    pass


def killed_after(flights):
    """A watch that ends a campaign, as if it was killed, once this number of flights has flown."""

    def watch(progress):
        if progress.flown >= flights:
            raise Killed

    return watch


def flown_watched(folder, plan, watch):
    with Store(folder).opened(plan) as store:
        run_campaign(plan, Local(threads=1), store, watch)


def test_what_has_flown_of_a_part_is_saved_and_gone_on_with_to_the_same_bytes(tmp_path, monkeypatch):
    plan, told = plan_of(PART + 100), []
    monkeypatch.setattr(running, "SAVE_S", 0.0)
    for flights in (100, 60, 160):  # twice in the first part, once in the second
        with pytest.raises(Killed):
            flown_watched(tmp_path / "killed", plan, killed_after(flights))
        (begun,) = (tmp_path / "killed").rglob("begun-*.parquet")
        told.append((begun.name, Dataset(tmp_path / "killed").parts(0)))
    assert [name for name, _ in told] == ["begun-00000.parquet", "begun-00000.parquet", "begun-00001.parquet"]
    assert [len(parts) for _, parts in told] == [0, 0, 1]
    seen = []
    flown_watched(tmp_path / "killed", plan, seen.append)
    assert seen[-1].have == PART + 100
    assert seen[-1].flown <= PART + 100 - (100 - 32) - (60 - 32) - (160 - 32)  # but for two blocks each, all were kept
    monkeypatch.undo()
    flown(tmp_path / "whole", plan)
    assert files_in(tmp_path / "killed") == files_in(tmp_path / "whole")


@pytest.mark.parametrize("harm", [b"", b"PAR1 and more", None], ids=["empty", "no Parquet", "of other flights"])
def test_what_was_saved_and_is_damaged_is_told_of_and_flown_again(tmp_path, monkeypatch, harm):
    plan, seen = plan_of(64), []
    monkeypatch.setattr(running, "SAVE_S", 0.0)
    for seed in (5, 6):
        with pytest.raises(Killed):
            flown_watched(tmp_path / str(seed), plan_of(64, seed=seed), killed_after(48))
    (begun,), (strange,) = ((tmp_path / name).rglob("begun-*.parquet") for name in ("5", "6"))
    begun.write_bytes(strange.read_bytes() if harm is None else harm)
    flown_watched(tmp_path / "5", plan, seen.append)
    assert seen[-1].flown == 64
    assert [str(begun) in one for one in seen[-1].damaged] == ([] if harm is None else [True])
    flown(tmp_path / "whole", plan)
    assert files_in(tmp_path / "5") == files_in(tmp_path / "whole")


@pytest.mark.parametrize(("block_s", "saved"), [(0.0, 1), (0.1, 2), (0.4, 5), (4.0, 15), (60.0, 15)])
def test_a_part_is_saved_by_time_and_not_by_flights(tmp_path, monkeypatch, block_s, saved):
    """A clock on which each block of 16 flights takes so long: a part of 16 blocks, the last of which is the part."""
    now, written = [0.0], []
    monkeypatch.setattr(running.time, "monotonic", lambda: now[0])
    monkeypatch.setattr(Store, "write_begun", lambda store, cell, part, rows, before: written.append(now[0]))

    def watch(progress):
        now[0] = block_s * (progress.flown // 16)

    flown_watched(tmp_path, plan_of(PART), watch)
    assert len(written) == saved
    assert written[0] == block_s
    assert max(np.diff([*written, now[0]])) <= running.SAVE_S + block_s


class Stalling:
    """An engine that, asked for the next piece, sees what the folder holds of those before, on a clock that has come
    `each_s` further each time.
    """

    piece = 16

    def __init__(self, now, each_s, held):
        self.now, self.each_s, self.held = now, each_s, held

    def fly(self, cell, seed, parts, on_progress):
        for part in parts:
            yield part, np.zeros((part.flights, len(ROW_COLUMNS)))
            self.held()
            self.now[0] += self.each_s


LOST = [(0.0, [0, 16, 32]), (0.7, [0, 16, 0]), (1.0, [0, 0, 0]), (90.0, [0, 0, 0])]  # flights lost as each is awaited


@pytest.mark.parametrize(("each_s", "lost"), LOST)
def test_a_kill_while_the_next_piece_is_awaited_costs_what_came_within_a_second(tmp_path, monkeypatch, each_s, lost):
    now, kept = [5.0], []
    monkeypatch.setattr(running.time, "monotonic", lambda: now[0])
    with Store(tmp_path).opened(plan_of(PART)) as store:

        def held():
            begun = store.begun(0, 0)
            kept.append(0 if begun is None else len(begun.rows))
            if len(kept) == len(lost):
                raise Killed

        with pytest.raises(Killed):
            run_campaign(plan_of(PART), Stalling(now, each_s, held), store)
    assert [16 * (k + 1) - had for k, had in enumerate(kept)] == lost


# -- kills ------------------------------------------------------------------------------------------------------------
def campaign_of(folder, flights):
    return [
        "campaign", "landing", "--set", "filter.name=paper", "--set", "flight.duration_s=6",
        "--flights", str(flights), "--records", "1", "--out", str(folder), "--json",
    ]  # fmt: skip


def command_of(folder, flights):
    return [sys.executable, "-m", "flownav", *campaign_of(folder, flights)]


# A campaign that kills itself in place of putting its so-manieth file where it belongs.
DIES = """
import os, signal, sys
from flownav.cli import main

replace, left = os.replace, int(sys.argv.pop(1))

def replace_or_die(*names):
    global left
    left -= 1
    if not left:
        os.kill(os.getpid(), signal.SIGKILL)
    replace(*names)

os.replace = replace_or_die
main()
"""


def test_killed_while_it_writes_it_goes_on_with_the_same_bytes(tmp_path):
    """At its plan, at its second part, at what it writes after the flights; half-written files lie about."""
    for file in (1, 3, 4):
        dying = [sys.executable, "-c", DIES, str(file), *campaign_of(tmp_path / "killed", 2 * PART)]
        assert subprocess.run(dying, capture_output=True).returncode == -signal.SIGKILL
        assert list((tmp_path / "killed").rglob("*.part"))
    for name in ("killed", "whole"):
        done = typed(*campaign_of(tmp_path / name, 2 * PART))
        assert json.loads(done.stdout)["flights"] == 2 * PART
    assert files_in(tmp_path / "killed") == files_in(tmp_path / "whole")


def killed_and_gone_on(folder, flights, kills, seed):
    """Run a campaign, kill it this number of times after it has written something, and let it end."""
    rng = random.Random(seed)
    for _ in range(kills):
        had = len(Dataset(folder).parts(0))
        run = subprocess.Popen(command_of(folder, flights), stdout=subprocess.DEVNULL, stderr=subprocess.DEVNULL)
        deadline = time.monotonic() + 300.0
        while len(Dataset(folder).parts(0)) <= had and run.poll() is None and time.monotonic() < deadline:
            time.sleep(0.002)
        time.sleep(rng.uniform(0.0, 0.05))
        run.kill()  # which may have ended by now
        run.wait()
    subprocess.run(command_of(folder, flights), check=True, capture_output=True)


@pytest.mark.real_time
def test_killed_twice_at_any_time_it_ends_with_the_same_bytes(tmp_path):
    killed_and_gone_on(tmp_path / "killed", 6 * PART, 2, 1)
    subprocess.run(command_of(tmp_path / "whole", 6 * PART), check=True, capture_output=True)
    assert files_in(tmp_path / "killed") == files_in(tmp_path / "whole")


@pytest.mark.slow
def test_killed_twenty_times_it_ends_with_the_same_bytes(tmp_path):
    killed_and_gone_on(tmp_path / "killed", 60 * PART, 20, 2)
    subprocess.run(command_of(tmp_path / "whole", 60 * PART), check=True, capture_output=True)
    assert files_in(tmp_path / "killed") == files_in(tmp_path / "whole")


def two_killed_and_gone_on(folder, command, kills, seed):
    """Two runs at once in one folder, both killed at any time, `kills` times; the output of those that ended by
    themselves.

    One flies and the other says so; where the first is killed, the second may have its place in the next turn.
    """
    rng, ends = random.Random(seed), []
    for _ in range(kills):
        pair = [subprocess.Popen(command, stdout=subprocess.DEVNULL, stderr=subprocess.PIPE) for _ in range(2)]
        had, deadline = len(Dataset(folder).parts(0)), time.monotonic() + 300.0
        while len(Dataset(folder).parts(0)) <= had and None in [run.poll() for run in pair]:
            assert time.monotonic() < deadline
            time.sleep(0.002)
        rng.shuffle(pair)
        for run in pair:
            time.sleep(rng.uniform(0.0, 0.3))
            run.kill()  # which may have ended by now
        ends += [(run.communicate()[1].decode(), run.returncode) for run in pair]
    return ends


@pytest.mark.slow
def test_two_runs_at_once_in_one_folder_killed_twenty_times_end_with_the_same_bytes(tmp_path):
    killed, whole = (command_of(tmp_path / name, 60 * PART) for name in ("killed", "whole"))
    ends = two_killed_and_gone_on(tmp_path / "killed", killed, 20, 3)
    assert {status for _, status in ends} <= {-signal.SIGKILL, 0, 2}
    refused = [said for said, status in ends if status == 2]
    assert refused
    assert all("another process is flying this campaign" in said for said in refused)
    assert not any("Traceback" in said for said, _ in ends)
    for command in (killed, whole):
        subprocess.run(command, check=True, capture_output=True)
    assert files_in(tmp_path / "killed") == files_in(tmp_path / "whole")


# -- the command ------------------------------------------------------------------------------------------------------
def run(*arguments):
    return CliRunner().invoke(app, ["campaign", *arguments])


def test_the_commands_json_table_and_files(tmp_path):
    given = ["landing", "--set", "filter.name=paper", "--flights", "24", "--seed", "3", "--out", str(tmp_path / "c")]
    said = json.loads(run(*given, "--json").stdout)
    assert {"flights", "scores", "verdicts", "rate_per_s", "dataset"} <= set(said)
    assert said["flights"] == 24
    assert set(said["scores"]["touchdown.horizontal_m"]) == {"p50", "p95", "low", "high"}
    assert set(said["verdicts"]) >= {"landed", "went_around", "crashed"}
    assert sum(said["verdicts"].values()) == 24
    assert Path(said["dataset"]).is_dir()
    assert all(Path(path).exists() and Path(path).with_suffix(".html").exists() for path in said["records"])
    again = run(*given)
    assert "nothing was missing" in again.stdout
    assert "worst flights" in again.stdout
    one = json.loads(run(*given, "--flight", "7", "--json").stdout)
    assert one["flight"] == 7
    assert Path(one["record"]).exists()


def test_a_flight_again_neither_locks_a_campaign_out_nor_writes_into_another(tmp_path):
    given = ["landing", "--set", "filter.name=paper", "--set", "flight.duration_s=6", "--out", str(tmp_path / "c")]
    assert run(*given, "--flight", "3").exit_code == 0
    assert run(*given, "--flights", "8", "--json").exit_code == 0
    assert run(*given, "--flight", "7").exit_code == 0  # of the folder's 8 flights
    assert "flights 0 to 7" in str(run(*given, "--flight", "8").exception)
    before = files_in(tmp_path / "c")
    assert "other seed" in str(run(*given, "--seed", "7", "--flight", "7").exception)
    assert files_in(tmp_path / "c") == before


def test_what_never_lands_has_landed_in_no_share(tmp_path):
    given = ["landing", "takeoff", "--set", "filter.name=paper", "--flights", "8", "--out", str(tmp_path)]
    said = json.loads(run(*given, "--json").stdout)
    landing, takeoff = said["cells"]
    assert "landed" in landing["figures"]
    assert "landed" not in takeoff["figures"]
    assert said["pooled_cells"] == [0]
    assert {one["cell"] for one in said["worst"]} == {0}


def test_a_stop_that_was_not_reached_is_said(tmp_path):
    given = ["landing", "--set", "filter.name=paper", "--set", "flight.duration_s=6", "--flights", "300"]
    given += ["--until", "p95_axis_m width <= 0.000001", "--out", str(tmp_path)]
    assert "were not enough for --until" in run(*given).stdout
    assert json.loads(run(*given, "--json").stdout)["cells"][0]["stopped"] is False


@pytest.mark.parametrize(
    ("arguments", "words"),
    [
        (["nowhere"], "no such scenario"),
        (["landing", "--flights", "0"], "--flights"),
        (["landing", "--sampling", "halton"], "--sampling halton: choose from plain, latin, sobol"),
        (["landing", "--truth-model", "x"], "--truth-model"),
        (["landing", "--engine", "tpu"], "--engine tpu"),
        (["landing", "--sweep", "wind.speed_20ft_m_s"], "NAME=START:STOP:STEP"),
        (["landing", "--sweep", "wind.speed_20ft_m_s=0:4:0"], "NAME=START:STOP:STEP"),
        (["landing", "--sweep", "wind.speed_20ft_m_s=0:x:1"], "NAME=START:STOP:STEP"),
        (["landing", "--sweep", "wind.speed_20ft_m_s=0:nan:1"], "NAME=START:STOP:STEP"),
        (["landing", "--set", "wind"], "NAME=VALUE"),
        (["landing", "--set", "colour=red"], "unknown key"),
        (["landing", "--until", "soon"], "--until"),
        (["takeoff", "--until", "r95_m width <= 0.01"], "never lands"),
        (["landing", "landing"], "the same name"),
        (
            [
                "landing",
                *(f"--sweep={name}=0:9000:1" for name in ("pad.size_m", "wind.speed_20ft_m_s", "filter.handover_s")),
            ],
            "729243027001 combinations; at most 10000",
        ),
        (["landing", "--set", "wind.gusts=true", "--sweep", "wind.gusts=true,false"], "is set as well"),
        (["landing", "--sweep", "pad.size_m=1,2", "--sweep", "pad.size_m=3,4"], "given twice"),
        (["landing", "--records", "11"], "--records"),
        (["takeoff", "--rare", "touchdown.rest_m > 1"], "never lands"),
        (["landing", "--rare", "crash > 5"], "crash is 0 or 1"),
        (["landing", "--rare", "crash", "--engine", "ray"], "leave out --engine ray"),
        (["landing", "--flight", "x"], "--flight x"),
        (["landing", "--flight", "3:1"], "there are cells 0 to 0"),
        (["landing", "--flight", "1000"], "flights 0 to 999"),
    ],
)
def test_mistakes_are_told_in_one_line(tmp_path, monkeypatch, arguments, words):
    monkeypatch.chdir(tmp_path)
    found = run(*arguments)
    assert isinstance(found.exception, InputError)
    assert words in printed(found.exception)
    assert "\n" not in str(found.exception)
    assert not list(tmp_path.iterdir())


@pytest.mark.parametrize("changes", [SHORT, {"flight.duration_s": 8.0}], ids=["paper", "landing"])
@pytest.mark.parametrize("truth_model", ["ensemble", "matched"])
def test_single_flights_from_anywhere_share_blocks_and_are_the_same_to_the_bit(changes, truth_model):
    ready = plan_of(100, changes=changes, truth_models=[truth_model]).ready(0)
    ((_, rows),) = Local().fly(ready, 5, [Part(0, 0, 100)])
    numbers = [97, 3, 4, 50, *range(60, 80, 3), 2, 11, 99, 31, 32, 33, 90, 12]
    told = []
    found = list(Local().fly(ready, 5, [Part(k, number, 1) for k, number in enumerate(numbers)], told.append))
    assert [part.number for part, _ in found] == list(range(len(numbers)))
    assert np.concatenate([one for _, one in found]).tobytes() == rows[numbers].tobytes()
    assert told == [16, len(numbers) - 16]
