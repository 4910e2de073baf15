"""`flownav fly`: a scenario flown in closed loop, scored beside the paper's tables."""

from __future__ import annotations

from contextlib import nullcontext
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any

from flownav.cli import options
from flownav.cli.options import chosen, option, out_option, switch
from flownav.cli.output import answer, figure, progress, record_place, require_between, save, say, table
from flownav.core.errors import InputError, VerdictError
from flownav.core.text import interval_words

if TYPE_CHECKING:
    from flownav.api.flying import Flights

CRASHES_ALLOWED = 0.05  # of the flights, before the exit status says that the verdict is bad


GPS = "GPS errors: white noise as in the paper, or a receiver of 2 m CEP."
ON = "What the autopilot flies on."
WIND = "Wind at 20 ft in m/s, with gusts, and where it blows from in degrees: 8:270."
PLANT = "The plant; linear is the paper's model."
CAMERA = "The pad camera; pixels renders its frames, which takes minutes a flight."
ONE_OR_MANY = "one flight matched, many an ensemble"
MAVLINK = "Then send the flight as a MAVLink autopilot would, for `flownav live`."
FAST = "How fast it is sent: 1 is real time."


def command(
    scenario: options.Scenario = "sortie",
    flights: Annotated[int, option("N", "How many flights; more than one gives medians and 5-95 %.")] = 1,
    flight: Annotated[int | None, option("K", "Fly only flight K of the seed, counted from 0.", unset="0")] = None,
    seed: options.Seed = 1,
    gps: Annotated[str | None, chosen(GPS, *options.GPS_MODELS, unset=options.SCENARIOS_OWN)] = None,
    wind: Annotated[str | None, option("SPEED[:FROM]", WIND, unset=options.SCENARIOS_OWN)] = None,
    filter_name: options.Filter = None,
    feedback: Annotated[str | None, chosen(ON, *options.FEEDBACKS, unset=options.SCENARIOS_OWN)] = None,
    truth: Annotated[str | None, chosen(PLANT, *options.PLANTS, unset=options.SCENARIOS_OWN)] = None,
    optics: Annotated[str | None, chosen(CAMERA, *options.OPTICS, unset=options.SCENARIOS_OWN)] = None,
    sensor: options.Sensor = None,
    vehicle: options.Vehicle = None,
    ensemble: Annotated[bool | None, switch(options.ENSEMBLE, "--ensemble/--matched", show_default=ONE_OR_MANY)] = None,
    out: Annotated[Path | None, out_option("The record", "out/SCENARIO.fnr")] = None,
    force: options.Force = False,
    report: options.Report = True,
    mavlink: Annotated[str | None, option("URL", MAVLINK)] = None,
    speed: Annotated[float, option("X", FAST, within=(0.01, 100.0))] = 1.0,
    signing_key: options.SigningKey = None,
    as_json: options.Json = False,
) -> None:
    """Fly a scenario: the table of errors beside Table 5 or 6, touchdown, the record and its report."""
    from flownav.core.compile import begin_beside

    if filter_name is None and flights == 1:
        begin_beside("flownav.navigation.take", "navigate_one")
    from flownav.api.calls import split
    from flownav.api.flying import MOST_FLIGHTS, fly_setup
    from flownav.api.scenario import Scenario
    from flownav.simulation.assemble import assemble

    require_between("--flights", flights, 1, MOST_FLIGHTS)
    require_between("--flight", flight or 0, 0, MOST_FLIGHTS)
    if flight is not None and flights > 1:
        raise InputError("--flight names one flight, --flights many; give one of the two")
    parts, ours, _ = split(filter_name, (), None, None)
    flow = str(sensor) if sensor else None
    chosen = Scenario.load(scenario).changed(
        gps=gps,
        wind=wind,
        filter=ours,
        autopilot=feedback,
        truth=truth,
        optics=optics,
        flow_sensor=flow,
        vehicle=vehicle,
    )
    setup = assemble(chosen.file)
    asked = out or Path("out") / f"{chosen.name}.fnr"
    record_path = record_place(asked, scenario, sensor, vehicle, signing_key, force=force, report=report)
    dispersed = flights > 1 if ensemble is None else ensemble
    many = flights > 1 or parts.any or chosen.file.optics == "pixels"
    with progress(f"Flying {chosen.name}", flights) if many else nullcontext() as advance:
        flown = fly_setup(setup, seed, flight or 0, flights, dispersed=dispersed, parts=parts, progress=advance)
    facts = flown.facts | save(flown.record, record_path, report=report)
    if mavlink is not None:
        from flownav.api.flying import tell

        facts["told"] = tell(setup, flown.record, mavlink, speed, signing_key)
    _say(facts, flown, flights, as_json)


def _say(facts: dict[str, Any], flown: Flights, flights: int, as_json: bool) -> None:
    """The figures of the flights. VerdictError where too many crashed or never landed."""
    answer(facts, as_json, lambda: show(facts, flown.record.manifest["paper"], flown.index))
    if int(facts["crashed"]) > CRASHES_ALLOWED * flights:
        raise VerdictError(
            f"{int(facts['crashed'])} of {flights} flights crashed (see `crashed` in docs/reference/scenarios.md)"
        )
    landing = facts["touchdown"] or {}
    if "reason" in landing:
        raise VerdictError(f"{landing['verdict']}: {landing['reason']}")
    never = landing.get("unfinished", {}).get("never touched", 0)
    if never > CRASHES_ALLOWED * flights:
        raise VerdictError(f"{never} of {flights} flights never landed")


WIDE = 92  # columns that one flight beside a published table takes
WIDEST = 132  # columns that the medians and percentiles of many flights take
STATISTICS, PRINTED = ("mean", "std", "rms", "max"), ("mean", "std")
MOTIONS = (
    ("sink_rate_m_s", "sinking at", "m/s"), ("lateral_speed_m_s", "drifting at", "m/s"), ("slide_m", "slid", "m"),
    ("tilt_deg", "tilted", "deg"), ("yaw_rate_deg_s", "turning at", "deg/s"),
)  # fmt: skip
UNITS = {"x": "m", "y": "m", "z": "m", "u": "m/s", "v": "m/s", "w": "m/s"}


def show(facts: dict[str, Any], paper: dict[str, Any] | None, median: int) -> None:
    """Errors per state beside the paper's table, largest position error, touchdown, files."""
    many = facts["flights"] > 1
    white, digits = facts["gps"] == "white", 3 if many else 4
    wide = WIDEST if many else WIDE if paper else 0
    heads = ["state", *(f"{name} error" for name in STATISTICS)]
    if paper:
        whose = "paper's filter" if white else "paper's filter,\nwhite GPS noise"
        heads += [f"{paper['title']} {statistic}\n({whose})" for statistic in PRINTED]
    errors = table(heads, title=title(facts), title_justify="left", left=1)
    for column in errors.columns[1 + len(STATISTICS) :]:
        column.style = "dim"
    for state, entry in facts["states"].items():
        cells = [_cell(entry[f"{name}_error"], digits) for name in STATISTICS]
        cells += [f"{paper['states'][state][f'{name}_error']:.4f}" for name in PRINTED] if paper else []
        errors.add_row(f"{state} [{UNITS[state]}]", *cells)
    for angle, entry in (facts["attitude_deg"] or {}).items():
        cells = [_cell(entry[f"{name}_error"], digits) for name in STATISTICS]
        errors.add_row(f"{angle} [deg]", *cells, *("" for _ in PRINTED if paper))
    beside = f"   paper: {paper['max_position_error_m']:.4f} m" if paper else ""
    beside += f" (for white GPS noise; {facts['gps']} is not white)" if paper and not white else ""
    largest = _cell(facts["max_position_error_m"], digits)
    say(errors, f"largest error of one position axis  {largest} m{beside}", wide=wide)
    if "known_exactly" in facts:
        say("errors are those of the autopilot's input, in flight after the hand-over", wide=wide)
        say(f"known exactly  {facts['known_exactly']}", wide=wide)
    if facts.get("takeoff"):
        say(*takeoff_lines(facts["takeoff"], facts["flights"]), wide=wide)
    if facts["touchdown"] is not None:
        say(*touchdown_lines(facts["touchdown"], facts.get("landed"), facts["flights"]), wide=wide)
    if "pad_frames" in facts:
        say(_pad_frames(facts["pad_frames"]), wide=wide)
    if facts.get("rmse_over_bound"):
        say(*_consistency_lines(facts), wide=wide)
    if "paper_percentile" in facts:
        say(_percentiles(facts["paper_percentile"]), wide=wide)
    which = f" (flight {median}, the one with the median largest error)" if many else ""
    say(f"record  {facts['record']}{which}", wide=wide)
    if "report" in facts:
        say(f"report  {facts['report']}", wide=wide)


def title(facts: dict[str, Any]) -> str:
    """What was flown, in a line."""
    plant = "" if facts["truth"] == "nonlinear" else ", linear truth"
    flown_on = "" if facts["feedback"] == "estimate" else ", flown on the truth"
    flies = "the paper's filter" if facts["filter"] == "paper" else "the navigator"
    told = ", an ensemble" if facts["truth_model"] == "ensemble" else ", matched"
    many = f", {facts['flights']} flights: median (5-95 %)" if facts["flights"] > 1 else ""
    return f"{facts['scenario']}: {flies}, {facts['gps']} GPS{plant}{flown_on}{told}, seed {facts['seed']}{many}"


def takeoff_lines(takeoff: dict[str, Any], flights: int) -> list[str]:
    """How far a take-off, or many, passed the commanded height, and how long there was no flow."""
    over, blind = takeoff["over_commanded_m"], takeoff["without_flow_s"]
    said = [
        f"take-off  {_cell(over, 3)} m over the commanded height",
        f"without flow above half of it  {_cell(blind, 2)} s",
    ]
    if flights == 1:
        return said
    lost = f"in {takeoff['lost_flow']} of {flights} flights"
    return [f"{said[0]}, worst {over['worst']:.3f} m", f"{said[1]}, worst {blind['worst']:.2f} s, {lost}"]


def touchdown_lines(landing: dict[str, Any], landed: int | None, flights: int) -> list[str]:
    """The touchdown of one flight or of many, a sentence a line."""
    said = []
    for name, group in (("contact", landing["contact"]), ("at rest", landing["rest"])):
        if group is None or group["distance_m"] is None:
            continue
        parts = [f"{_cell(group['distance_m'], 3)} m from the pad's centre, at {_cell(group['t_s'], 2)} s"]
        parts += [f"{words} {_cell(group[key], 3)} {unit}" for key, words, unit in MOTIONS if key in group]
        said.append(f"touchdown, {name}  {', '.join(parts)}")
        if group.get("r95_m") is not None:
            ends = interval_words(*group["r95_interval_m"])
            said.append(f"touchdown R95, {name}  {group['r95_m']:.3f} m (95 % interval {ends})")
    limited = landing["limited_by"]
    if limited is not None:
        which = "" if landed is None else "95 % of the flights within: "
        parts = [f"{name} {figure(limited[f'{name}_m'], '.3f')} m" for name in ("estimate", "guidance", "pad")]
        said.append(f"limited by  {which}{', '.join(parts)}")
    return [*said, *(_verdict_lines(landing) if landed is None else _landed_lines(landing, landed, flights))]


def _verdict_lines(landing: dict[str, Any]) -> list[str]:
    """How one flight ended."""
    broken = landing["broken"]
    verdict = f"crashed: {', '.join(broken)}" if broken else landing["verdict"].replace("unfinished", "not at rest")
    around = f", after {landing['go_arounds']} go-around(s)" if landing["go_arounds"] else ""
    why = f": {landing['reason']}" if "reason" in landing else ""
    return [f"verdict  {verdict}{around}{why}"]


def _landed_lines(landing: dict[str, Any], landed: int, flights: int) -> list[str]:
    """How many flights landed, and what became of the others."""
    rate, around = landing["success"], landing["went_around"]
    share = f"(95 % interval {100.0 * rate['low']:.1f}..{100.0 * rate['high']:.1f} %)"
    said = [f"landed  {landed} of {flights} flights, {100.0 * rate['rate']:.1f} % {share}"]
    late = [f"{name} {count}" for name, count in landing["unfinished"].items() if count]
    said += [f"not landed in time  {', '.join(late)}"] if late else []
    if around["flights"]:
        said.append(f"went around  {around['flights']}, of which {around['landed']} landed after all")
    if landing["broken"]:
        said.append("crashes by  " + ", ".join(f"{name} {count}" for name, count in landing["broken"].items()))
    return said


def _consistency_lines(facts: dict[str, Any]) -> list[str]:
    """How consistent the navigator is with its own model, of many flights."""
    bound, stated = (
        ", ".join(f"{state} {figure(ratio)}" for state, ratio in facts[key].items())
        for key in ("rmse_over_bound", "error_over_stated")
    )
    said = [f"RMSE over the bound of the filter's own model, in flight  {bound}"]
    said.append(f"RMS of the error over what is stated of it  {stated}")
    inside = facts["anees_inside_fraction"]
    if inside is not None:
        said.append(f"ANEES inside its 95 % band  on {100.0 * inside:.1f} % of the steps in flight")
    return said


def _pad_frames(bands: list[dict[str, Any]]) -> Any:
    """What was seen in rendered frames, by height, beside what the pad camera's datasheet says of the same frames."""

    def beside(row: dict[str, Any], said: str, told: str, scale: float) -> str:
        return f"{figure(row[said], scale=scale)} ({figure(row[told], scale=scale)})"

    heads = ("height [m]", "frames", "in view", "found", "wrong", "angle rms [mrad]", "distance rms [%]")
    rows = (
        (f"{row['from_m']:g} to {row['to_m']:g}", str(row["frames"]), str(row["in_view"]),
         f"{row['found']} ({row['expected_found']:.1f})", str(row["wrong"]),
         beside(row, "angle_rms_rad", "expected_angle_rad", 1e3),
         beside(row, "distance_rms", "expected_distance", 1e2))
        for row in bands
    )  # fmt: skip
    return table(heads, rows, title="pad in rendered frames (its datasheet)", title_justify="left", left=0)


def _percentiles(percentiles: dict[str, Any]) -> str:
    """Where the paper's one flight lies among ours."""
    std, mean = (
        ", ".join(f"{state} {entry[f'{name}_error']:.0f}" for state, entry in percentiles["states"].items())
        for name in ("std", "mean")
    )
    largest = f"{percentiles['max_position_error_m']:.0f}"
    return f"the paper's flight lies at our percentile: largest error {largest}; std {std}; |mean| {mean}"


def _cell(number: Any, digits: int) -> str:
    """A figure of one flight, or of many with what 5 and 95 % of them are below."""
    if isinstance(number, dict):
        return f"{number['median']:.{digits}f} ({number['p05']:.{digits}f}..{number['p95']:.{digits}f})"
    return figure(number, f".{digits}f")
