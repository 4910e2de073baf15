"""Scenario files: the path, vehicle, sensors, wind, filter and autopilot.

`sortie`, `takeoff`, `landing`, `gusty`, `pad_return` and `approach` ship; any TOML file of this schema flies. Positions
are those of the skids relative to the pad's centre, in the local NED frame.
"""

from itertools import pairwise
from pathlib import Path
from typing import Any, Literal

from pydantic import Field, ValidationInfo, create_model, field_validator

from flownav.core.errors import InputError
from flownav.core.guard import an_input
from flownav.core.parameter_files import Number, ParameterModel, load, shipped
from flownav.core.text import meant
from flownav.sensors.settings import FlowSettings, GpsInsSettings, PadFixSettings, RangefinderSettings
from flownav.simulation.dispersion import SHIPPED as SHIPPED_DISPERSION
from flownav.simulation.dispersion import DispersionSection
from flownav.simulation.ground import GroundSettings, RecirculationSettings
from flownav.simulation.sensor_table import sensor_rows
from flownav.simulation.wind import WindSettings
from flownav.vehicle.kinds import SHIPPED_NAMES

SHIPPED = ("sortie", "takeoff", "landing", "gusty", "pad_return", "approach")


class Knot(ParameterModel):
    """A point of the reference path; between knots the reference moves in a straight line at constant speed."""

    t_s: Number = Field(ge=0.0, le=3600.0)  # since the flight's start; later than the knot before
    north_m: Number = Field(0.0, ge=-1000.0, le=1000.0)  # of the pad's centre; negative: south
    east_m: Number = Field(0.0, ge=-1000.0, le=1000.0)  # of the pad's centre; negative: west
    height_m: Number = Field(ge=-10.0, le=120.0)  # of the skids over the pad; below 0: descends until contact


class FlightSection(ParameterModel):
    """The flight of a scenario. `start` puts the vehicle on its skids or in trimmed hover at the first knot."""

    duration_s: Number = Field(50.0, ge=0.1, le=3600.0)  # simulated time
    start: Literal["ground", "hover"]  # ground: on the skids; hover: in trim, both at the first knot
    takeoff_at_s: Number = Field(0.0, ge=0.0, le=3600.0)  # when it may leave its skids
    may_land_after_s: Number | None = Field(None, ge=0.0, le=3600.0, validate_default=True)  # none: it never lands
    path: tuple[Knot, ...] = Field(min_length=2)

    @field_validator("path")
    @classmethod
    def _in_time_order(cls, path: tuple[Knot, ...]) -> tuple[Knot, ...]:
        if any(later.t_s <= earlier.t_s for earlier, later in pairwise(path)):
            raise ValueError("the knots' t_s must increase")
        return path

    @field_validator("path")
    @classmethod
    def _starts_above_the_ground(cls, path: tuple[Knot, ...], info: ValidationInfo) -> tuple[Knot, ...]:
        if info.data.get("start") == "hover" and path[0].height_m < 0.0:
            raise ValueError("a hover starts at a height_m of 0 or more")
        return path

    @field_validator("may_land_after_s")
    @classmethod
    def _lands_after_takeoff(cls, value: float | None, info: ValidationInfo) -> float | None:
        takeoff = info.data.get("takeoff_at_s", 0.0)
        if value is not None and info.data.get("start") == "ground" and value <= takeoff:
            raise ValueError(f"more than takeoff_at_s = {takeoff:g} is needed, or it never takes off")
        return value


class PadSection(ParameterModel):
    """The landing pattern: a square about the origin, its sides north and east."""

    size_m: Number = Field(2.0, gt=0.05, le=100.0)  # length of a side


class VehicleSection(ParameterModel):
    """The vehicle file, or a shipped vehicle's name; the shipped Maxi Joker 3 unless named.

    In a scenario `vehicle = "quad-450"` is short for this section with that file.
    """

    file: str | None = None  # a TOML file or a shipped name; none: the Maxi Joker 3
    lens_above_skid_m: Number = Field(0.10, ge=0.0, le=2.0)  # of cameras and rangefinder; 0: level with the skids


class FilterSection(ParameterModel):
    """Which filter flies: the navigator's, or the paper's, which starts at the known pad or at the first GPS reading.

    handover_s: for this long a vehicle that starts in hover flies with the truth as feedback, while the navigator
    receives readings.
    """

    name: Literal["paper", "landing"] = "landing"  # landing: flownav's navigator; paper: the paper's Kalman filter
    handover_s: Number = Field(5.0, ge=0.0, le=600.0)
    start: Literal["known", "gps"] | None = None  # paper's: the true place, or the first GPS; none: as gps.model asks


class PrecisionSection(ParameterModel):
    """The last metres of a precision landing (as PX4's): descend slowly, align above the pad's middle, then commit."""

    land_height_m: Number = Field(3.0, gt=0.0, le=100.0)  # of the skids; below it the descent is slow
    land_speed_m_s: Number = Field(0.3, gt=0.0, le=5.0)  # fastest descent below land_height_m
    align_height_m: Number = Field(0.6, gt=0.0, le=100.0)  # of the skids; the gate: below it only while over the pad
    align_radius_m: Number = Field(0.03, gt=0.0, le=100.0)  # foreseen touchdown off the pad's centre; more: wait
    align_speed_m_s: Number = Field(1.0, gt=0.0, le=100.0)  # over the ground; faster: wait at the gate
    align_patience_s: Number = Field(15.0, gt=0.0, le=3600.0)  # waited so long, radius and speed have doubled
    commit_height_m: Number = Field(0.3, ge=0.0, le=100.0)  # of the skids; below it the gate stops nothing
    search_height_m: Number = Field(0.0, ge=0.0, le=100.0)  # no lower before a camera found the pad; 0: needs none


class GoAroundSection(ParameterModel):
    """When a landing is broken off, and to what height the vehicle then climbs over the pad.

    pad_view_m: from this height of the skids up to search_height_m the camera should see the pad; drift: below
    commit_height_m.
    """

    height_m: Number = Field(2.5, gt=0.0, le=100.0)  # of the skids over the pad, to which it climbs and waits
    most: Number = Field(2.0, ge=0.0, le=100.0)  # how often; then it lands with what it has; 0: never goes around
    pad_view_m: Number = Field(0.5, ge=0.0, le=100.0)
    pad_lost_s: Number = Field(2.0, gt=0.0, le=3600.0)  # unseen for so long in that view, the pad is lost
    landing_sigma_m: Number = Field(0.5, gt=0.0, le=100.0)  # horizontal standard deviation over the pad; more: in doubt
    doubt_s: Number = Field(2.0, ge=0.0, le=3600.0)  # so long in doubt, or suspecting a fault, it goes around
    align_wait_s: Number = Field(60.0, gt=0.0, le=3600.0)  # longest wait at the shut gate
    search_wait_s: Number = Field(30.0, gt=0.0, le=3600.0)  # longest search for the pad
    search_radius_m: Number = Field(3.0, ge=0.0, le=100.0)  # of the circle on which it looks for the pad
    drift_radius_m: Number = Field(0.5, gt=0.0, le=100.0)  # below commit_height_m, farther from the pad: go around
    drift_speed_m_s: Number = Field(0.6, gt=0.0, le=100.0)  # below commit_height_m, faster over ground: go around
    clear_s: Number = Field(3.0, ge=0.0, le=3600.0)  # all must be well for so long aloft before it descends again
    aloft_most_s: Number = Field(20.0, gt=0.0, le=3600.0)  # longest wait aloft where no camera can help


class EventSection(ParameterModel):
    """Something that befalls the vehicle, whoever flies it, from then on.

    engine cut: the motor gives nothing (all of a multirotor's). motor out: a multirotor's first motor gives nothing.
    tail rotor stuck: its blades stay as they are. cyclic servos slow: they have 0.4 of their frequency.
    """

    at_s: Number = Field(ge=0.0, le=3600.0)  # since the flight's start
    kind: Literal["engine cut", "motor out", "tail rotor stuck", "cyclic servos slow"]  # what befalls it: see above


_by_channel = sorted(sensor_rows(), key=lambda sensor: sensor.channels.reading)
_files: dict[str, Any] = {
    sensor.name: (str | None, Field(None, description="its datasheet, a TOML file; the shipped one unless named"))
    for sensor in _by_channel
}
_SheetFiles: Any = create_model("_SheetFiles", __base__=ParameterModel, **_files)


class SensorsSection(_SheetFiles):
    """The datasheets of what the vehicle carries for its navigator; the shipped ones unless named.

    `gps`, `rangefinder` and `pad_fix` of the scenario stand above the sheets. texture: whether flow finds it everywhere
    or on the pad alone.
    """

    texture: Literal["everywhere", "pad"] = "everywhere"


class LearningSection(ParameterModel):
    """The vehicle learnt in flight: 13 s in which both cyclics are stirred, and gains for what they show.

    Helicopters on the navigator only; others fly on as they are.
    """

    begins_s: Number = Field(ge=0.0, le=3600.0)  # since the flight's start; in hover or on a straight leg
    align_radius_m: Number | None = Field(None, gt=0.0, le=100.0)  # the gate's of one that learns; none: as of others


class AutopilotSection(ParameterModel):
    """The autopilot's feedback, where it takes the pad to be, its gains where the vehicle's do not serve, and the
    collective on the skids.

    home: "start" puts the pad where the estimate first puts the start of the path (a vehicle that returns to where
    it was), "origin" at the filter's origin (a vehicle that comes from elsewhere).
    """

    feedback: Literal["estimate", "truth"] = "estimate"  # its feedback: the filter's estimate, or the truth
    home: Literal["start", "origin"] = "start"
    position_gain_1_s: Number | None = Field(None, gt=0.0, le=5.0)  # speed per position error; none: the vehicle's
    velocity_gain_1_s: Number | None = Field(None, gt=0.0, le=10.0)  # acceleration per speed error; none: the vehicle's
    velocity_integral_1_s2: Number | None = Field(None, ge=0.0, le=10.0)  # per position error; none: the vehicle's
    precision: PrecisionSection | None = None
    go_around: GoAroundSection | None = None
    learning: LearningSection | None = None

    @field_validator("go_around")
    @classmethod
    def _with_a_landing(cls, value: GoAroundSection | None, info: ValidationInfo) -> GoAroundSection | None:
        if value is not None and info.data.get("precision") is None:
            raise ValueError("needs [autopilot.precision], the landing that is broken off")
        return value

    idle_collective_deg: Number = Field(0.0, ge=-10.0, le=10.0)  # on the skids, rotor turning; helicopters only


class Scenario(ParameterModel):
    """A scenario file."""

    schema_version: Literal[1]  # of this kind of file; 1
    name: str = Field(pattern=r"^[A-Za-z0-9][A-Za-z0-9._-]{0,63}$")  # of the results: letters, digits, . _ and -
    description: str = ""  # one sentence, shown in lists and reports
    paper_table: Literal[5, 6] | None = None  # the published table that the flight's errors are set beside
    truth: Literal["nonlinear", "linear"] = "nonlinear"  # the vehicle's equations, or the paper's linear model
    optics: Literal["model", "pixels"] = "model"  # of the pad camera, for `flownav fly`
    flight: FlightSection
    pad: PadSection = PadSection()
    vehicle: VehicleSection = VehicleSection()
    gps: GpsInsSettings = GpsInsSettings(model="white")
    flow: FlowSettings = FlowSettings()
    flow_sensor: str | None = None  # its file, as `flownav identify` writes; none: the paper's PX4FLOW
    rangefinder: RangefinderSettings = RangefinderSettings()
    sensors: SensorsSection = SensorsSection()
    pad_fix: PadFixSettings | None = None
    wind: WindSettings = WindSettings()
    ground: GroundSettings = GroundSettings()
    recirculation: RecirculationSettings = RecirculationSettings()
    event: tuple[EventSection, ...] = ()
    filter: FilterSection = FilterSection()
    autopilot: AutopilotSection = AutopilotSection()
    dispersion: DispersionSection = DispersionSection()

    @field_validator("vehicle", mode="before")
    @classmethod
    def _named(cls, given: Any) -> Any:
        return {"file": given} if isinstance(given, str) else given


def load_scenario(name: str) -> Scenario:
    """A shipped scenario by name, or a file. InputError where neither exists or the file is wrong."""
    if name in SHIPPED:
        return load(shipped(f"{name}.toml"), Scenario)
    path = Path(name)
    if not path.suffix and not an_input(path).exists():
        raise InputError(
            f"{name}: no such scenario; shipped: {', '.join(SHIPPED)}, or give a TOML file{meant(name, SHIPPED)}"
        )
    scenario = load(path, Scenario)
    return scenario.model_copy(
        update={
            "vehicle": scenario.vehicle.model_copy(update={"file": _beside(path, scenario.vehicle.file)}),
            "flow_sensor": _beside(path, scenario.flow_sensor),
            "dispersion": _dispersion_beside(path, scenario.dispersion),
            "sensors": scenario.sensors.model_copy(
                update={
                    name: _beside(path, getattr(scenario.sensors, name))
                    for name in type(scenario.sensors).model_fields
                    if name != "texture"
                }
            ),
        }
    )


def with_vehicle(scenario: Scenario, vehicle: str | None) -> Scenario:
    """The scenario flown by another vehicle: a shipped one's name, or a file; None leaves the scenario's own."""
    if vehicle is None:
        return scenario
    return scenario.model_copy(update={"vehicle": scenario.vehicle.model_copy(update={"file": vehicle})})


def with_filter(scenario: Scenario, name: Literal["paper", "landing"]) -> Scenario:
    """The scenario flown with another filter."""
    return scenario.model_copy(update={"filter": scenario.filter.model_copy(update={"name": name})})


def _dispersion_beside(scenario: Path, section: DispersionSection) -> DispersionSection:
    """A dispersion file that a scenario names is looked for beside the scenario, too; the shipped one is not."""
    if section.file == SHIPPED_DISPERSION:
        return section
    return section.model_copy(update={"file": str(scenario.parent / section.file)})


def _beside(scenario: Path, file: str | None) -> str | None:
    """A file that a scenario names is looked for beside the scenario; a shipped vehicle is not."""
    return file if file is None or file in SHIPPED_NAMES else str(scenario.parent / file)
