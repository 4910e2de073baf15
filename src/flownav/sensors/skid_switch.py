"""A switch under the skids: closed under load, debounced, and perhaps stuck.

The load that it sees is the skids' with noise (rocking, vibration). It opens and closes at two loads, and the report
follows once the contact has been the same for as many readings as the debounce takes (Ganssle, A Guide to Debouncing,
2004). A switch may be stuck open or closed for a whole flight.
"""

import math
from typing import ClassVar, NamedTuple

from pydantic import Field, ValidationInfo, field_validator

from flownav.core.compile import equation
from flownav.core.parameter_files import Number
from flownav.sensors.processes import level_of
from flownav.sensors.sheet import SensorSheet


class SkidSwitchParameters(NamedTuple):
    """Loads and chances. `stuck_open_above`, `stuck_closed_below`: levels of one normal."""

    closing_load_n: float
    opening_load_n: float
    sigma_n: float
    debounce_readings: float
    stuck_open_above: float
    stuck_closed_below: float


class SkidSwitchUnit(NamedTuple):
    """1 where it is stuck open, 1 where it is stuck closed. As normals: the first decides, the other is to spare."""

    stuck_open: float
    stuck_closed: float


class SkidSwitchNormals(NamedTuple):
    """Standard normals of one reading."""

    load: float
    spare: float


class SkidSwitchState(NamedTuple):
    """The contact, the reported state (1 closed, 0 open), and for how many readings the contact has differed from
    it.
    """

    contact: float
    reported: float
    otherwise: float


class SkidSwitchReading(NamedTuple):
    """1 on the ground, 0 in flight; quality is 255 and a reading always arrives (the switch is wired)."""

    landed: float
    quality: float
    arrived: float


@equation
def draw_skid_switch(n: SkidSwitchUnit, p: SkidSwitchParameters) -> SkidSwitchUnit:
    """Whether it works on this flight."""
    return SkidSwitchUnit(
        1.0 if n.stuck_open > p.stuck_open_above else 0.0,
        1.0 if n.stuck_open < p.stuck_closed_below else 0.0,
    )


@equation
def start_skid_switch(load_n: float, p: SkidSwitchParameters) -> SkidSwitchState:
    """Settled on the load of the first moment."""
    closed = 1.0 if load_n >= p.closing_load_n else 0.0
    return SkidSwitchState(closed, closed, 0.0)


@equation
def step_skid_switch(
    state: SkidSwitchState, unit: SkidSwitchUnit, load_n: float, n: SkidSwitchNormals, p: SkidSwitchParameters
) -> tuple[SkidSwitchState, SkidSwitchReading]:
    """One reading under the skids' load [N, positive where they carry weight]."""
    seen_n = load_n + p.sigma_n * n.load
    threshold_n = p.opening_load_n if state.contact > 0.5 else p.closing_load_n
    loaded = 1.0 if seen_n >= threshold_n else 0.0
    working = 0.0 if unit.stuck_open > 0.5 else loaded
    contact = 1.0 if unit.stuck_closed > 0.5 else working
    otherwise = state.otherwise + 1.0 if contact != state.reported else 0.0
    follows = otherwise >= p.debounce_readings
    reported = contact if follows else state.reported
    after = SkidSwitchState(contact, reported, 0.0 if follows else otherwise)
    return after, SkidSwitchReading(reported, 255.0, 1.0)


class SkidSwitchSheet(SensorSheet):
    """A switch. Loads are shares of the vehicle's weight; stuck shares are of flights."""

    shipped_file: ClassVar[str] = "skid_switch.toml"

    rate_hz: Number = Field(ge=1.0, le=1000.0)  # readings a second
    closing_share: Number = Field(gt=0.0, le=1.0)  # load over weight at which it closes: on the ground
    opening_share: Number = Field(gt=0.0, le=1.0)  # load over weight at which it opens: in flight
    sigma_share: Number = Field(0.0, ge=0.0, le=1.0)  # noise of the load over weight, standard deviation
    debounce_s: Number = Field(ge=0.0, le=5.0)  # so long the contact must stay before it is believed
    stuck_open_share: Number = Field(0.0, ge=0.0, le=0.5)  # of flights, on which it never closes
    stuck_closed_share: Number = Field(0.0, ge=0.0, le=0.5)  # of flights, on which it never opens

    @field_validator("opening_share")
    @classmethod
    def _below(cls, value: float, info: ValidationInfo) -> float:
        if value > info.data.get("closing_share", 1.0):
            raise ValueError(f"at most closing_share = {info.data['closing_share']:g} is needed")
        return value

    def parameters(self, weight_n: float) -> SkidSwitchParameters:
        """Coefficients of one reading on a vehicle of this weight."""
        return SkidSwitchParameters(
            closing_load_n=self.closing_share * weight_n,
            opening_load_n=self.opening_share * weight_n,
            sigma_n=self.sigma_share * weight_n,
            debounce_readings=max(1.0, float(math.ceil(self.debounce_s * self.rate_hz - 1e-9))),
            stuck_open_above=level_of(self.stuck_open_share),
            stuck_closed_below=-level_of(self.stuck_closed_share),
        )
