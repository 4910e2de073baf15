"""Options that mean the same in every command, each written once (docs/reference/cli-grammar.md)."""

from __future__ import annotations

from pathlib import Path
from typing import Annotated, Any

import typer

from flownav.cli.choices import (
    ENGINES,
    FILTERS,
    FIRMWARES,
    SCENARIOS,
    VEHICLES,
    argument,
    installed_filters,
    one_of,
    option,
)

JsonOption = Annotated[bool, typer.Option("--json", help="Print one JSON object and nothing else.")]
ForceOption = Annotated[
    bool, typer.Option("--force", help="Replace what flownav wrote there before; without, the name is numbered.")
]
KEPT = "flights that are there are kept"
ENSEMBLE = "Draw each flight's vehicle, wind and sensors about their datasheets, or fly them as the datasheets say."
EnsembleOption = Annotated[bool, typer.Option("--ensemble/--matched", help=ENSEMBLE)]
ReportOption = Annotated[bool, typer.Option("--report/--no-report", help="Write the HTML report beside the record.")]
SEED = ("N", "Seed of the noise; the same seed, same result.", "--seed")
SeedOption = Annotated[int, option(*SEED, within=(0, 2**63 - 1))]
RigSeedOption = Annotated[int, option(*SEED, within=(0, 2**31 - 1))]  # the rig draws from 32 bits
SensorOption = Annotated[
    Path | None, option("FILE.toml", "A flow sensor file, as `flownav identify` writes it.", "--sensor")
]
SettingsOption = Annotated[
    Path | None, option("FILE.toml", "Settings of the navigator, as `flownav tune` writes them.", "--settings")
]
FlowInstanceOption = Annotated[int | None, option("N", "Which of a log's several flow sensors.", "--flow-instance")]
TopicOption = Annotated[
    list[str] | None,
    option("ROLE=TOPIC", "Of a ROS bag: which topic serves as what. May be given several times.", "--topic"),
]
GpsDelayOption = Annotated[float, option("S", "How old a GPS reading is when it arrives [s].", "--gps-delay")]
SigningKeyOption = Annotated[
    Path | None, option("FILE", "MAVLink 2 signing key: 32 bytes or 64 digits.", "--signing-key")
]
RecordsOption = Annotated[int, option("N", "Write records and reports of so many of the worst flights.", "--records")]
VehicleOption = Annotated[
    str | None, typer.Option("--vehicle", help="The vehicle that flies.", **one_of(*VEHICLES, beside="FILE.toml"))
]
SCENARIOS_OWN = "as the scenario says"
FilterOption = Annotated[
    str | None,
    typer.Option(
        "--filter",
        help="The navigator's filter, the paper's, an installed one's name, or your own class.",
        show_default=SCENARIOS_OWN,
        **one_of(*FILTERS, beside="FILE.py:CLASS", also=installed_filters),
    ),
]
EngineOption = Annotated[
    str, typer.Option("--engine", help="This machine's cores, a cluster (Ray), a GPU.", **one_of(*ENGINES))
]
LOG_KINDS = "a CSV folder, .ulg, .bin, .tlog, or a record (.fnr)"
LogArgument = Annotated[Path, typer.Argument(metavar="LOG", help=f"A log: {LOG_KINDS}.", show_default=False)]
LogsArgument = Annotated[list[Path], typer.Argument(metavar="LOG", help=f"Logs, each {LOG_KINDS}.", show_default=False)]
RecordArgument = Annotated[
    Path,
    typer.Argument(metavar="RECORD.fnr", help="A record, as fly, replay and live write it.", show_default=False),
]
ScenarioArgument = Annotated[str, argument("SCENARIO", "What is flown", *SCENARIOS, beside="a scenario's FILE.toml")]


FirmwareOption = Annotated[
    str,
    typer.Option(
        "--firmware",
        help="A version of the PX4FLOW's firmware, with switches where wanted: 2013-09,-gyro-scale.",
        **one_of(*FIRMWARES, beside="VERSION,SWITCH"),
    ),
]


def out_option(what: str, default: str = "") -> Any:
    """The option `--out`: what it writes, and where it writes that if it is not given ("": nowhere)."""
    return typer.Option("--out", metavar="PATH", help=f"{what}.", show_default=default or "none is written")
