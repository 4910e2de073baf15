"""The CUDA engine in Numba's simulator of a device: the flights of the CPU, in a process of its own."""

from __future__ import annotations

import json
import os
import subprocess
import sys

import numpy as np
import pyarrow.parquet as pq
import pytest

import device_cases
from command import run
from flownav.campaigns.measures import ROW_COLUMNS

SIMULATED = os.environ | {"NUMBA_ENABLE_CUDASIM": "1", "PYTHONWARNINGS": "ignore"}


@pytest.fixture(scope="module")
def simulated(tmp_path_factory):
    """Rows of the short cases and noise, as the simulator has them."""
    file = tmp_path_factory.mktemp("simulated") / "rows.npz"
    done = subprocess.run(
        [sys.executable, device_cases.__file__, file], env=SIMULATED, capture_output=True, text=True, timeout=600
    )
    assert done.returncode == 0, done.stderr[-2000:]
    return np.load(file)


def test_threefry_gives_the_same_words_and_normals_to_their_last_bit(simulated):
    words, normals = device_cases.noise_on_cpu()
    assert np.array_equal(simulated["words"], words)
    assert np.all(np.abs(simulated["normals"] - normals) <= np.spacing(np.abs(normals)))


@pytest.mark.parametrize("case", device_cases.SHORT)
def test_flights_agree_with_the_cpu_to_a_billionth(simulated, case):
    scenario, sections, flights, drawn = device_cases.SHORT[case]
    told = device_cases.on_cpu(device_cases.ready(scenario, sections), flights, drawn)
    assert simulated[case].shape == (flights, len(ROW_COLUMNS)) == told.shape
    assert np.array_equal(np.isnan(simulated[case]), np.isnan(told))
    assert np.allclose(simulated[case], told, rtol=1e-9, atol=1e-9, equal_nan=True)
    moved = np.abs(told[:, ROW_COLUMNS.index("x.rms_error")])
    assert np.all(moved > 0.0)
    assert len(set(moved)) == flights


def test_a_campaign_flies_there_and_keeps_the_rows_of_the_local_engine(tmp_path):
    asked = ["landing", "--flights", "2", "--truth-model", "matched", "--records", "0", "--json",
             "--set", "filter.name=paper", "--set", "flight.duration_s=0.4"]  # fmt: skip
    there = subprocess.run(
        [sys.executable, "-m", "flownav", "campaign", *asked, "--engine", "cuda", "--out", tmp_path / "cuda"],
        env=SIMULATED, capture_output=True, text=True, timeout=600,
    )  # fmt: skip
    assert there.returncode == 0, there.stderr[-2000:]
    here = run("campaign", *asked, "--engine", "local", "--out", tmp_path / "local", cwd=tmp_path)
    assert here.returncode == 0, here.stderr[-2000:]
    rows = {}
    for engine, said in (("cuda", there.stdout), ("local", here.stdout)):
        assert json.loads(said)["flights"] == 2
        (part,) = (tmp_path / engine / "flights").rglob("*.parquet")
        rows[engine] = pq.read_table(part)
    assert rows["cuda"].column_names == rows["local"].column_names
    for name in ROW_COLUMNS:
        ours, theirs = (rows[engine][name].to_numpy() for engine in ("cuda", "local"))
        assert np.allclose(ours, theirs, rtol=1e-9, atol=1e-9, equal_nan=True), name
