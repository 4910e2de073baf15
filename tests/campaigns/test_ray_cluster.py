"""Flights on a real cluster of Ray on this machine: the same bytes as local, with a node killed in mid-run, too."""

from __future__ import annotations

import numpy as np
import pytest

from flownav.campaigns.engines.engine import Part
from flownav.campaigns.engines.local import Local
from flownav.campaigns.plan import planned
from flownav.errors import InputError
from flownav.simulation.scenario import load_scenario

FLIGHTS = 64
PARTS = [Part(number, number * FLIGHTS, FLIGHTS) for number in range(12)]


@pytest.fixture(scope="module")
def cell():
    changes = {"filter.name": "paper", "flight.duration_s": 6.0}
    return planned(
        [load_scenario("landing")], {}, truth_models=["ensemble"], seed=5, flights=FLIGHTS * len(PARTS), changes=changes
    ).ready(0)


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


@pytest.mark.filterwarnings("ignore")
def test_two_nodes_fly_the_same_bytes_as_one_machine_though_one_is_killed(cell, nodes):
    from flownav.campaigns.engines.ray_cluster import RayCluster

    cluster, second = nodes
    wanted = list(Local().fly(cell, 5, PARTS))
    counted, found = [], []
    for part, rows in RayCluster(cluster.address).fly(cell, 5, PARTS, counted.append):
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
    from flownav.campaigns.engines.ray_cluster import RayCluster

    monkeypatch.setitem(__import__("sys").modules, "ray", None)
    with pytest.raises(InputError, match=r"flownav\[cluster\]"):
        RayCluster()


def test_the_rows_of_a_part_are_numbers(cell):
    ((part, rows),) = Local(1).fly(cell, 5, PARTS[3:4])
    assert part == PARTS[3]
    assert rows.shape[0] == FLIGHTS
    assert np.isfinite(rows[:, 0]).all()
