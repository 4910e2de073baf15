"""Options that mean the same in every command, each written once (docs/reference/cli-grammar.md)."""

from __future__ import annotations

from pathlib import Path
from typing import Annotated, Any

import typer

from flownav.cli.choices import ENGINES, FILTERS, FIRMWARES, SCENARIOS, VEHICLES, argument, installed_filters, one_of

JsonOption = Annotated[bool, typer.Option("--json", help="Print one JSON object and nothing else.")]
ForceOption = Annotated[
    bool, typer.Option("--force", help="Replace what flownav wrote there before; without, the name is numbered.")
]
ENSEMBLE = "Draw each flight's vehicle, wind and sensors about their datasheets, or fly them as the datasheets say."
ReportOption = Annotated[bool, typer.Option("--report/--no-report", help="Write the HTML report beside the record.")]
SeedOption = Annotated[int, typer.Option("--seed", metavar="N", help="Seed of the noise; the same seed, same result.")]
SensorOption = Annotated[
    Path | None,
    typer.Option("--sensor", metavar="FILE.toml", help="A flow sensor file, as `flownav identify` writes it."),
]
SettingsOption = Annotated[
    Path | None,
    typer.Option("--settings", metavar="FILE.toml", help="Settings of the navigator, as `flownav tune` writes them."),
]
FlowInstanceOption = Annotated[
    int | None, typer.Option("--flow-instance", metavar="N", help="Which of a log's several flow sensors.")
]
TopicOption = Annotated[
    list[str] | None,
    typer.Option(
        "--topic", metavar="ROLE=TOPIC", help="Of a ROS bag: which topic serves as what. May be given several times."
    ),
]
GpsDelayOption = Annotated[
    float, typer.Option("--gps-delay", metavar="S", help="How old a GPS reading is when it arrives [s].")
]
SigningKeyOption = Annotated[
    Path | None, typer.Option("--signing-key", metavar="FILE", help="MAVLink 2 signing key: 32 bytes or 64 digits.")
]
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
