"""The flight that the sample logs are of, and its log: sensors as a quadrotor carries them, with the truth beside."""

from __future__ import annotations

from dataclasses import replace
from functools import lru_cache

from flownav.campaigns.faults.table import log_of
from flownav.campaigns.local import fly_recorded
from flownav.core.parameter_files import shipped
from flownav.core.record import Record
from flownav.logs.log import Log
from flownav.simulation.assemble import assemble
from flownav.simulation.scenario import load_scenario, with_vehicle

ORIGIN_DEG_M = (25.31, 55.49, 20.0)  # Sharjah, where the shipped magnetometer's field is from
SCENARIO, SENSOR = "samples/flight.toml", "samples/flow_sensor.toml"
RECORD_SCENARIO, VEHICLE = "pad_return", "quad-450"  # of the sample record; flown by the same kernel


@lru_cache(maxsize=2)
def sample_log(seed: int) -> Log:
    """What the vehicle of the sample flight logged: streams at their arrival, the truth, the estimate it flew on."""
    setup = assemble(load_scenario(str(shipped(SCENARIO))))
    return replace(log_of(fly_recorded(setup, seed), setup), origin_deg_m=ORIGIN_DEG_M)


def sample_record(seed: int) -> Record:
    """A flight of `pad_return` by the same vehicle; it does not say when, so that a seed gives the same bytes."""
    setup = assemble(with_vehicle(load_scenario(RECORD_SCENARIO), VEHICLE))
    record = fly_recorded(setup, seed)
    record.manifest["command"] = f"flownav fly {RECORD_SCENARIO} --vehicle {VEHICLE} --seed {seed}"
    record.manifest["provenance"].pop("written_utc", None)
    return record
