"""Flights on a cluster: the same bytes as local, with a worker or a node lost in mid-run, too."""

from __future__ import annotations

import pickle
import sys
from types import SimpleNamespace

import numpy as np
import pytest

from flownav.campaigns import engines
from flownav.campaigns.engines import Local, Part
from flownav.campaigns.plan import planned
from flownav.core.errors import InputError
from flownav.simulation.scenario import load_scenario

FLIGHTS = 64
PARTS = [Part(number, number * FLIGHTS, FLIGHTS) for number in range(12)]


@pytest.fixture(scope="module")
def cell():
    changes = {"filter.name": "paper", "flight.duration_s": 6.0}
    return planned(
        [load_scenario("landing")], {}, truth_models=["ensemble"], seed=5, flights=FLIGHTS * len(PARTS), changes=changes
    ).ready(0)


class FrailCluster:
    """Stands in for Ray: a task runs when its result is asked for, and every third worker is lost and asked again."""

    def __init__(self):
        self.asked, self.most_waiting, self._waiting, self._kept = [], 0, set(), {}

    def is_initialized(self):
        return True

    def cluster_resources(self):
        return {"CPU": 2.0}

    def put(self, what):
        self._kept["told"] = pickle.dumps(what)
        return "told"

    def remote(self, **asked):
        assert asked == {"num_cpus": 1, "max_retries": -1}  # what is lost is flown again

        def remember(function):
            def task(*arguments):
                self.asked.append((function, arguments))
                self._waiting.add(len(self.asked) - 1)
                self.most_waiting = max(self.most_waiting, len(self._waiting))
                return len(self.asked) - 1

            return SimpleNamespace(remote=task)

        return remember

    def get(self, what):
        if what in self._kept:
            return pickle.loads(self._kept[what])
        self._waiting.discard(what)
        function, arguments = self.asked[what]
        if what % 3 == 0:
            function(*arguments)  # its rows are lost with its worker
            engines._cells.clear()  # the next worker knows of no cell
        return function(*arguments)


def test_the_rows_are_those_of_one_machine_in_order_though_workers_are_lost(cell, monkeypatch):
    ray, counted = FrailCluster(), []
    monkeypatch.setitem(sys.modules, "ray", ray)
    found = list(engines.RayCluster().fly(cell, 5, PARTS[:6], counted.append))
    assert [part for part, _ in found] == PARTS[:6]
    assert counted == [FLIGHTS] * 6
    assert ray.most_waiting == 2 * engines.PARTS_AHEAD
    for (_, rows), (_, expected) in zip(found, Local().fly(cell, 5, PARTS[:6]), strict=True):
        assert rows.tobytes() == expected.tobytes()


@pytest.fixture
def nodes(monkeypatch):
    """A cluster of two nodes with one core each; the second may be killed."""
    ray = pytest.importorskip("ray", reason="Ray has no wheel for this machine")
    from ray.cluster_utils import Cluster

    monkeypatch.setenv("RAY_USAGE_STATS_ENABLED", "0")
    small = {"num_cpus": 1, "object_store_memory": 80_000_000, "include_dashboard": False}
    cluster = Cluster(initialize_head=True, head_node_args=small)
    small.pop("include_dashboard")
    second = cluster.add_node(**small)
    yield cluster, second
    ray.shutdown()
    cluster.shutdown()


@pytest.mark.real_time
@pytest.mark.filterwarnings("ignore")
def test_two_nodes_fly_the_same_bytes_as_one_machine_though_one_is_killed(cell, nodes):
    cluster, second = nodes
    wanted = list(Local().fly(cell, 5, PARTS))
    counted, found = [], []
    for part, rows in engines.RayCluster(cluster.address).fly(cell, 5, PARTS, counted.append):
        found.append((part, rows))
        if len(found) == 3:
            assert len(cluster.list_all_nodes()) == 2
            cluster.remove_node(second, allow_graceful=False)
    assert [part for part, _ in found] == PARTS
    assert sum(counted) == FLIGHTS * len(PARTS)
    assert len(cluster.list_all_nodes()) == 1
    for (_, rows), (_, expected) in zip(found, wanted, strict=True):
        assert rows.tobytes() == expected.tobytes()


def test_without_ray_the_engine_says_what_to_install(monkeypatch):
    monkeypatch.setitem(sys.modules, "ray", None)
    with pytest.raises(InputError, match=r"flownav\[cluster\]"):
        engines.RayCluster()


def test_the_rows_of_a_part_are_numbers(cell):
    ((part, rows),) = Local(1).fly(cell, 5, PARTS[3:4])
    assert part == PARTS[3]
    assert rows.shape[0] == FLIGHTS
    assert np.isfinite(rows[:, 0]).all()
