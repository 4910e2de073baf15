"""The parameters that a make's simulator is given for a flight, and its possible faults: data/sitl/*.toml."""

from typing import Literal

from pydantic import Field

from flownav.core.parameter_files import ParameterModel, load, shipped

Parameters = dict[str, float]


class Eyes(ParameterModel):
    """Faults of the sensors that flownav itself simulates.

    gyro_rad_s: of the flow sensor's own gyro about x. gps_north_m: offset of a second receiver.
    """

    flow_noise_rad_s: float | None = None
    flow_sign: float = 1.0
    flow_scale: float = 1.0
    flow_stuck: bool = False
    flow_late_s: float = 0.0
    gyro_rad_s: float = 0.0
    flow: bool = True
    gps_north_m: float | None = None


class Fault(ParameterModel):
    """A fault: parameters while it is on and once it is off, and the faults of the line, the machine or our own
    sensors.

    lasts_s: unless `--fault` gives another. gps: whether it needs one. loss: share of frames lost each way;
    freeze_s: the simulator stands still for so long; restart: flownav is killed and started again.
    """

    says: str
    lasts_s: float = 10.0
    gps: bool = False
    on: Parameters = Field(default_factory=dict)
    off: Parameters = Field(default_factory=dict)
    loss: float = 0.0
    freeze_s: float = 0.0
    restart: bool = False
    eyes: Eyes | None = None

    def parameters(self, *, on: bool) -> Parameters:
        """The parameters to set when the fault begins or ends; parameters without an end value are set back to 0."""
        return self.on if on else {name: self.off.get(name, 0.0) for name in self.on}


class Cases(ParameterModel):
    """Parameters by the use of GPS, by vehicle, and for a landing on a pad; `all` in every flight."""

    all: Parameters
    heli: Parameters = Field(default_factory=dict)
    on: Parameters = Field(default_factory=dict)
    cut: Parameters = Field(default_factory=dict)
    never: Parameters = Field(default_factory=dict)
    pad: Parameters = Field(default_factory=dict)


class Table(ParameterModel):
    """A make's file."""

    schema_version: Literal[1]
    parameters: Cases
    fault: dict[str, Fault]


def table_of(make: str) -> Table:
    """The file of `ardupilot` or `px4`."""
    return load(shipped(f"sitl/{make}.toml"), Table)


def parameters_of(make: str, vehicle: str, gps: str, *, pad: bool = False) -> Parameters:
    """The parameters that a flight's simulator is started with."""
    cases = table_of(make).parameters
    return {**cases.all, **getattr(cases, vehicle, {}), **getattr(cases, gps), **(cases.pad if pad else {})}


def faults_of(make: str) -> dict[str, Fault]:
    """The faults that a make's simulator can have, by name."""
    return table_of(make).fault
