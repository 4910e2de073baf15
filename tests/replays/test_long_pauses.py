"""A log that pauses for hours: every estimate is finite afterwards, and as good as before once GPS is back."""

from __future__ import annotations

import numpy as np
import pytest

from flownav.logs.open_log import open_log
from flownav.navigation.settings import NavigatorSettingsFile
from flownav.navigation.tables import estimate_table, states_table
from flownav.replays.prepare import ReplayOptions
from flownav.replays.session import Replay, replay
from replay_logs import log_of_flight


def paused(folder, gap_s: float, lacks: tuple[str, ...]) -> Replay:
    """A flight of 80 s with a pause in its middle, without these files."""
    flown = log_of_flight(80.0)
    for name in lacks:
        del flown.tables[name]
    for table in flown.tables.values():
        table["t_s"] = table["t_s"] + gap_s * (table["t_s"] > 40.0)
    log = open_log(flown.write(folder / "paused"))
    return replay(log, ReplayOptions(), NavigatorSettingsFile(), smoothed=True)


@pytest.mark.parametrize("lacks", [(), ("gps",), ("flow",), ("flow", "range"), ("gps", "range")], ids=str)
def test_nothing_is_nan_after_two_hours(tmp_path, lacks):
    flown = paused(tmp_path, 7200.0, lacks)
    for rows in (flown.estimate, flown.smoothed):
        assert rows is not None
        for name, column in {**estimate_table(rows), **states_table(rows)}.items():
            assert np.isfinite(column).all(), name
    assert np.isfinite([value for value in flown.scores()["coverage"]["imu"].values()]).all()


@pytest.mark.parametrize("gap_s", [300.0, 7200.0, 80000.0])
def test_gps_brings_all_of_it_back(tmp_path, gap_s):
    end = {name: float(column[-1]) for name, column in estimate_table(paused(tmp_path, gap_s, ()).estimate).items()}
    without = {name: float(column[-1]) for name, column in estimate_table(paused(tmp_path, 1.0, ()).estimate).items()}
    assert np.hypot(end["pos_n_m"] - without["pos_n_m"], end["pos_e_m"] - without["pos_e_m"]) < 1.0
    assert end["std_pos_n_m"] < 3.0
    assert end["std_vel_u_m_s"] < 0.1
    assert end["protection_horizontal_m"] < 15.0
