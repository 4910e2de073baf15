"""The proof that there is one navigator: a simulated flight, alone or of sixteen, replays to the same bits."""

from __future__ import annotations

import numpy as np
import pytest
from typer.testing import CliRunner

from flownav.cli import app
from flownav.core.compile import LANES, ONE_LANE
from flownav.core.record import Record
from flownav.estimation.states import MOST_SOURCES, SCRATCH
from flownav.logs.open_log import open_flight
from flownav.navigation.kernel_settings import Equipment
from flownav.navigation.loop import run, start_navigator
from flownav.navigation.memory import WORK_ROWS
from flownav.navigation.tables import estimate_table, innovation_table, states_table
from flownav.navigation.tape import empty_tape
from flownav.replays.fed import as_fed
from flownav.replays.prepare import ReplayOptions
from flownav.replays.session import replay
from flownav.simulation.assemble import assemble
from flownav.simulation.engine import buffers_of, fly_into, fly_written
from flownav.simulation.flight_record import record_of
from flownav.simulation.scenario import SHIPPED, load_scenario

SEED, FLIGHT, LANE = 7, 3, 3


def assert_same_bits(table, other, what):
    assert set(table) == set(other), what
    for name, values in table.items():
        same = np.array_equal(values, other[name], equal_nan=values.dtype.kind == "f")
        assert same, f"{what}: {name}"


@pytest.fixture(scope="module", params=SHIPPED)
def flown(request, tmp_path_factory):
    """A shipped scenario with everything written, on one lane and as one of sixteen; the file of the former."""
    setup = assemble(load_scenario(request.param))
    alone = record_of(setup, fly_written(setup.flight, SEED, FLIGHT), SEED, FLIGHT)
    sixteen = record_of(setup, fly_written(setup.flight, SEED, FLIGHT - LANE, LANES), SEED, FLIGHT, LANE)
    path = tmp_path_factory.mktemp("flown") / f"{request.param}.fnr"
    alone.save(path)
    return setup, alone, sixteen, path


def test_a_flight_with_everything_written_is_the_same_bits_alone_and_of_sixteen(flown):
    _, alone, sixteen, _ = flown
    assert alone.tables.keys() == sixteen.tables.keys()
    for name, table in alone.tables.items():
        assert_same_bits(table, sixteen.tables[name], name)


def test_its_replay_gives_the_same_estimate_covariance_and_innovations_bit_for_bit(flown):
    _, alone, _, path = flown
    log = open_flight(path)
    again = replay(log, *as_fed(log, ReplayOptions(), None))
    assert len(again.estimate) > 1000
    assert_same_bits(estimate_table(again.estimate), alone.tables["estimate"], "estimate")
    assert_same_bits(states_table(again.estimate), alone.tables["states"], "states")
    assert_same_bits(innovation_table(again.innovation), alone.tables["innovation"], "innovation")


@pytest.mark.parametrize("lanes", [ONE_LANE, LANES], ids=["alone", "of sixteen"])
def test_all_that_the_navigator_remembers_in_the_end_is_the_same_bits(flown, lanes):
    """Every state, the whole covariance and all memories; the first lane of sixteen, which keeps what lanes share."""
    setup, _, _, _ = flown
    buffers = buffers_of(setup.flight, lanes, setup.flight.plan.epochs, written=True)
    fly_into(setup.flight, SEED, FLIGHT, lanes, buffers)
    simulated = buffers.nav.reshape(WORK_ROWS, len(lanes))[:, 0]
    path = flown[3]
    log = open_flight(path)
    _, settings = as_fed(log, ReplayOptions(), None)
    (segment,) = log.fed
    noise = setup.fitted.given.noise
    running = start_navigator(Equipment(**segment.equipment), settings, empty_tape(4000, 40_000, 20_000), noise)
    run(segment.queue, running)
    remembered = np.ones(WORK_ROWS, np.bool_)
    remembered[SCRATCH : SCRATCH + MOST_SOURCES * MOST_SOURCES] = False  # what a step leaves, and the normalised error
    np.testing.assert_array_equal(running.work[remembered], simulated[remembered])


def test_the_command_replays_what_the_command_flew_to_the_same_bits(tmp_path):
    first, again = tmp_path / "first.fnr", tmp_path / "again.fnr"
    for arguments in (("fly", "pad_return", "--flight", "3"), ("replay", str(first))):
        out = again if arguments[0] == "replay" else first
        done = CliRunner().invoke(app, [*arguments, "--no-report", "--out", str(out)])
        assert done.exit_code == 0, done.output
    flown, replayed = Record.load(first), Record.load(again)
    for name in ("estimate", "states", "innovation"):
        assert_same_bits(replayed.tables[name], flown.tables[name], name)
