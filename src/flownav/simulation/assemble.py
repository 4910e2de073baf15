"""From a scenario to a flight: files read, helicopter trimmed, filters and gains built, all as plain numbers."""

import math
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np

from flownav.control.design import gains_for, nominal_model
from flownav.control.gains import AutopilotGains
from flownav.control.guidance import path_through, rounded
from flownav.control.learnt_model import NominalModel
from flownav.control.margins import margins_of
from flownav.core.errors import InputError
from flownav.core.measurement import Sensor
from flownav.estimation.error_models import discretised
from flownav.estimation.paper_filter import PaperModel
from flownav.sensors.datasheet import FlowSensor, load_sensor
from flownav.simulation.dispersion import Design, Distribution, raises_wind
from flownav.simulation.ensemble import Ensemble, flown, recirculation_of
from flownav.simulation.fitting import Fitted, fitted
from flownav.simulation.ground import GroundSettings
from flownav.simulation.plan import ATTITUDE_S, Flight, FlightPlan, Happens
from flownav.simulation.plant import LinearTruth
from flownav.simulation.scenario import Scenario
from flownav.simulation.sensing import EPOCH_S, Draws, SensorSuite
from flownav.vehicle import kinds
from flownav.vehicle.corners import NOMINAL
from flownav.vehicle.linearize import ReducedModel, hover_plant, load_paper_model
from flownav.vehicle.parameters import MultirotorParameters, touchdown_limits
from flownav.vehicle.state import Controls
from flownav.vehicle.trim import Trim, parked, parked_multirotor

NEVER_S = 1e9
ONLY_OF = {"tail rotor stuck": "helicopter", "cyclic servos slow": "helicopter", "motor out": "multirotor"}
GO_AROUND = {"height_m": "go_around_height_m", "most": "go_arounds_most"}
CORNER_S = 1.5  # a corner is flown at constant acceleration for so long: take-off passes 3 m by 0.06, not by 0.29


@dataclass(frozen=True)
class Setup:
    """A scenario made ready: the numbers that the kernel takes, and their description for reports.

    fitted: the sensors that feed the navigator, and its settings; None where the paper's filter flies. file: the
    vehicle's, as it is believed to be, and described: the same with its uncertainties. dispersion: what an ensemble
    draws.
    """

    scenario: Scenario
    sensor: FlowSensor
    flight: Flight
    fitted: Fitted | None
    trim: kinds.AnyTrim
    inputs: tuple[Path, ...]
    parameters: dict[str, Any]
    file: kinds.AnyFile
    described: kinds.VehicleDescription
    dispersion: dict[str, Distribution]

    def ensemble(self, design: Design | None = None) -> Ensemble:
        """The flights of this scenario with truths of their own. InputError where its dispersion cannot be.

        design: what spreads the dispersed numbers over the flights; None: the noise counter.
        """
        sheets = self.fitted.sheets if self.fitted else None
        return Ensemble(
            self.scenario, self.flight, self.file, self.described, self.sensor, sheets, self.dispersion, design
        )


def assemble(scenario: Scenario) -> Setup:
    """Read, check, trim and discretise everything a scenario names. InputError as the loaders."""
    _require_what_is_linear(scenario)
    own_file = kinds.vehicle_file(Path(scenario.vehicle.file)) if scenario.vehicle.file else None
    sensor_file = Path(scenario.flow_sensor) if scenario.flow_sensor else None
    file, sensor, paper = kinds.read_vehicle(own_file), load_sensor(sensor_file), load_paper_model()
    vehicle = flown(scenario, file)
    _require_paper_helicopter(scenario, vehicle)
    hover = kinds.hover_of(vehicle)
    gains = _gains(scenario, vehicle, hover)
    dispersion = scenario.dispersion.entries()
    plan = _plan(scenario, vehicle, hover, gains, dispersion)
    equipped = fitted(scenario, sensor, vehicle, plan.epochs) if scenario.filter.name == "landing" else None
    flight = Flight(
        plan=plan,
        vehicle=vehicle,
        rotors=kinds.rotors_of(vehicle),
        sensors=_sensors(scenario, sensor, vehicle),
        wind=scenario.wind.parameters(kinds.disc_of(vehicle).span_m),
        ground=scenario.ground.parameters(),
        recirculation=recirculation_of(scenario, scenario.recirculation, vehicle),
        path=_path(scenario, vehicle),
        gains=gains,
        paper=_paper_filter(paper) if scenario.filter.name == "paper" else None,
        onboard=equipped.onboard if equipped else None,
        table=equipped.schedule if equipped else None,
        settings=equipped.settings if equipped else np.zeros(0),
        initial_variance=_initial_variance(scenario, paper),
        linear=_linear_truth(paper, hover) if scenario.truth == "linear" and isinstance(hover, Trim) else None,
        limits=touchdown_limits(file, math.inf if scenario.pad_fix is None else 0.5 * scenario.pad.size_m),
        learns=_learns(scenario, vehicle, hover),
    )
    described = kinds.describe_vehicle(own_file)
    parameters: dict[str, Any] = {
        "scenario": scenario.model_dump(),
        "flow_sensor": sensor.model_dump(exclude={"identified_models"}),
        "vehicle": _values_of(described),
        "autopilot_gains": flight.gains._asdict(),
    }
    if scenario.truth == "nonlinear":
        parameters["autopilot_margins"] = {
            row.loop: row.margins.finite() for row in margins_of(hover_plant(vehicle, hover), gains, NOMINAL)
        }
    if equipped:
        parameters["sensors"] = equipped.sheets.model_dump(exclude={"flow_sensor"})
        parameters["filter"] = equipped.given.settings.model_dump()
        parameters["flow_noise"] = equipped.given.noise._asdict()
        parameters["gps_delay_s"] = float(equipped.ages_s[Sensor.GPS_POSITION])
        parameters["horizon_s"] = equipped.schedule.horizon_s
    inputs = tuple(path for path in (own_file, sensor_file) if path)
    return Setup(scenario, sensor, flight, equipped, hover, inputs, parameters, file, described, dispersion)


def _values_of(described: kinds.VehicleDescription) -> dict[str, Any]:
    """Value, uncertainty and source of each number of a vehicle, by its key."""
    return {
        entry.key: {"value": entry.value, "uncertainty": entry.uncertainty, "source": entry.source}
        for entry in described.entries
    }


def _require_what_is_linear(scenario: Scenario) -> None:
    """InputError where the scenario demands a part that the paper's linear truth has not."""
    if scenario.truth != "linear":
        return
    if scenario.wind.speed_20ft_m_s > 0.0:
        raise InputError(f'{scenario.name}: truth = "linear" has no air to move; remove [wind], or fly "nonlinear"')
    if scenario.ground != GroundSettings() or scenario.event:
        raise InputError(f'{scenario.name}: truth = "linear" has no ground and no engine; remove [ground], [[event]]')
    if scenario.filter.name != "paper":
        raise InputError(f'{scenario.name}: truth = "linear" has no forces for an IMU to feel; fly the "paper" filter')


def _require_paper_helicopter(scenario: Scenario, vehicle: kinds.AnyVehicle) -> None:
    """The paper's filter and its linear truth are the model of its helicopter. InputError for another kind."""
    if isinstance(vehicle, MultirotorParameters) and (scenario.filter.name == "paper" or scenario.truth == "linear"):
        raise InputError(
            f"{scenario.name}: the paper's filter and linear truth are a helicopter's; fly a multirotor with "
            'filter.name = "landing" and truth = "nonlinear"'
        )


def _gains(scenario: Scenario, vehicle: kinds.AnyVehicle, hover: kinds.AnyTrim) -> AutopilotGains:
    """The vehicle's gains, the scenario's changes to them, and the last metres."""
    section = scenario.autopilot
    own_gate = scenario.filter.name != "paper" or section.go_around is not None  # the paper's landing has no gate
    precision = section.precision.model_dump() if section.precision is not None and own_gate else {}
    if precision and _may_learn(scenario, hover) and section.learning is not None:
        precision["align_radius_m"] = section.learning.align_radius_m or precision["align_radius_m"]
    around = {} if section.go_around is None else section.go_around.model_dump()
    given = {
        "position_gain": section.position_gain_1_s,
        "forward_gain": section.velocity_gain_1_s,
        "right_gain": section.velocity_gain_1_s,
        "forward_integral": section.velocity_integral_1_s2,
        "right_integral": section.velocity_integral_1_s2,
    }
    feels = scenario.filter.name == "landing"  # the paper's sensors have no accelerometer
    return gains_for(vehicle, hover, math.radians(section.idle_collective_deg), feels_gusts=feels)._replace(
        **{name: value for name, value in given.items() if value is not None},
        **precision,
        **{GO_AROUND.get(name, name): value for name, value in around.items()},
    )


def _may_learn(scenario: Scenario, hover: kinds.AnyTrim) -> bool:
    """Whether it is a helicopter with its navigator's sensors; others have no rotor on a spring."""
    return scenario.filter.name == "landing" and isinstance(hover, Trim)


def _learns(scenario: Scenario, vehicle: kinds.AnyVehicle, hover: kinds.AnyTrim) -> NominalModel | None:
    """Beliefs about a vehicle that may learn itself; None where it may not."""
    if not _may_learn(scenario, hover) or not isinstance(hover, Trim) or isinstance(vehicle, MultirotorParameters):
        return None
    learning = scenario.autopilot.learning
    return nominal_model(vehicle, hover, -1 if learning is None else round(learning.begins_s / EPOCH_S))


def _happens(scenario: Scenario, vehicle: kinds.AnyVehicle) -> Happens:
    """When what befalls the vehicle. InputError where such a vehicle has no such part."""
    other = "helicopter" if isinstance(vehicle, MultirotorParameters) else "multirotor"
    for event in scenario.event:
        if ONLY_OF.get(event.kind, "") == other:
            raise InputError(f"{scenario.name}: [[event]] {event.kind}: of a {other} only; this vehicle has none")

    def first(kind: str) -> float:
        return min((event.at_s for event in scenario.event if event.kind == kind), default=NEVER_S)

    return Happens(*(first(kind) for kind in ("engine cut", "tail rotor stuck", "cyclic servos slow", "motor out")))


def _plan(
    scenario: Scenario, vehicle: kinds.AnyVehicle, hover: kinds.AnyTrim, gains: AutopilotGains,
    dispersion: dict[str, Distribution],
) -> FlightPlan:  # fmt: skip
    """The flight plan for the loop."""
    section = scenario.flight
    linear = scenario.truth == "linear"
    on_ground = section.start == "ground" and not linear
    return FlightPlan(
        epochs=round(section.duration_s / EPOCH_S) + 1,
        start=_start(scenario, vehicle, hover, gains, on_ground, linear),
        starts_on_ground=on_ground,
        takeoff_at_s=0.0 if linear else section.takeoff_at_s,
        may_land_after_s=NEVER_S if linear or section.may_land_after_s is None else section.may_land_after_s,
        fly_on_truth=scenario.autopilot.feedback == "truth",
        along_truth=False,
        minds_faults=scenario.autopilot.go_around is not None,
        home_at_start=scenario.autopilot.home == "start",
        start_known=start_of(scenario) == "known",
        handover_s=section.takeoff_at_s if on_ground else float(scenario.filter.handover_s),
        happens=_happens(scenario, vehicle),
        draws=Draws(
            paper=scenario.filter.name == "paper",
            gps_drift=scenario.filter.name == "paper" and scenario.gps.model != "white",
            wind=scenario.wind.speed_20ft_m_s > 0.0 or raises_wind(dispersion),
            recirculation=scenario.filter.name != "paper",
        ),
    )


def start_of(scenario: Scenario) -> str:
    """Where the filter starts: as the scenario states, else at the pad with white GPS noise and at the GPS with
    real.
    """
    return scenario.filter.start or ("known" if scenario.gps.model == "white" else "gps")


def _start(
    scenario: Scenario,
    vehicle: kinds.AnyVehicle,
    hover: kinds.AnyTrim,
    gains: AutopilotGains,
    on_ground: bool,
    linear: bool,
) -> kinds.AnyState:
    """The vehicle's first state: parked, in trimmed hover, or level for the linear truth."""
    first = scenario.flight.path[0]
    pos_d = -first.height_m - vehicle.cg_above_skid_m
    if on_ground:
        state = _parked(vehicle, hover, gains)
        return state._replace(pos_n=first.north_m, pos_e=first.east_m)
    state = hover.state._replace(pos_n=first.north_m, pos_e=first.east_m, pos_d=pos_d)
    return state._replace(qw=1.0, qx=0.0, qy=0.0, qz=0.0) if linear else state


def _parked(vehicle: kinds.AnyVehicle, hover: kinds.AnyTrim, gains: AutopilotGains) -> kinds.AnyState:
    """At rest on the ground, rotors idling."""
    if isinstance(vehicle, MultirotorParameters):
        return parked_multirotor(vehicle)
    assert isinstance(hover, Trim)
    idle = gains.idle_collective_rad
    pedal = hover.pedal_rad + gains.pedal_per_collective * (idle - hover.collective_rad)
    return parked(vehicle, Controls(hover.lon, hover.lat, idle, pedal))


def _path(scenario: Scenario, vehicle: kinds.AnyVehicle) -> Any:
    """The reference path of the centre of gravity. The linear truth has no ground: its path stops there."""
    lowest = 0.0 if scenario.truth == "linear" else -np.inf
    straight = path_through(
        [
            (knot.t_s, knot.north_m, knot.east_m, -max(knot.height_m, lowest) - vehicle.cg_above_skid_m)
            for knot in scenario.flight.path
        ]
    )
    return rounded(straight, CORNER_S)


def _sensors(scenario: Scenario, sensor: FlowSensor, vehicle: kinds.AnyVehicle) -> SensorSuite:
    """Every sensor's coefficients."""
    return SensorSuite(
        gps=scenario.gps.parameters(),
        flow=scenario.flow.parameters(sensor),
        rangefinder=scenario.rangefinder.parameters(),
        lens_below_cg_m=vehicle.cg_above_skid_m - scenario.vehicle.lens_above_skid_m,
        pad_half_size_m=0.5 * scenario.pad.size_m,
        gps_offers_velocity=scenario.gps.velocity_sigma_total_m_s > 0.0,
    )


def _paper_filter(paper: ReducedModel) -> PaperModel:
    """The printed matrices, discretised with the inputs held over an epoch."""
    transition, input_matrix = discretised(paper.a, paper.b, EPOCH_S)
    return PaperModel(transition, input_matrix, np.diag(paper.q).copy(), np.diag(paper.r).copy())


def _initial_variance(scenario: Scenario, paper: ReducedModel) -> Any:
    """P at the start: one step's process noise about a known pad, one measurement's about a first GPS reading."""
    return np.diag(paper.q if start_of(scenario) == "known" else paper.r).copy()


def _linear_truth(paper: ReducedModel, hover: Trim) -> LinearTruth:
    """The paper's linear truth over one step of the attitude loop."""
    transition, input_matrix = discretised(paper.a, paper.b, ATTITUDE_S)
    trims = np.array([hover.lon, hover.lat, hover.collective_rad, hover.pedal_rad])
    return LinearTruth(transition, input_matrix, trims, float(paper.b[4, 3]))
