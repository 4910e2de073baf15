"""The output of `flownav fly` on a flight, or many: a sentence, the table of errors, the touchdown, the files."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

from flownav.cli.output import figure, plain_look, say, table
from flownav.core.text import interval_words
from flownav.scoring.headline import sentence

WIDE = NARROW = 80  # columns of a terminal, and those that one flight beside a published table takes
WIDEST = 104  # columns that the medians and percentiles of many flights take, beside a published table
STATISTICS, PRINTED = ("mean", "std", "rms", "max"), ("mean", "std")
FLIGHTS_FOR_R95 = 20  # of fewer the radius would be that of the largest
RANGED = ("rms", "max")  # of many flights with what 5 and 95 % of them are below
MOTIONS = (
    ("sink_rate_m_s", "sinking at", "m/s"), ("lateral_speed_m_s", "drifting at", "m/s"), ("slide_m", "slid", "m"),
    ("tilt_deg", "tilted", "deg"), ("yaw_rate_deg_s", "turning at", "deg/s"),
)  # fmt: skip
UNITS = {"x": "m", "y": "m", "z": "m", "u": "m/s", "v": "m/s", "w": "m/s"}
RECEIVERS = {"midg": "GPS of 2 m CEP", "white": "GPS with white noise"}
HEADING = "heading  only the compass shows it in hover; GPS corrects it in fast flight"  # what limits it
PARTS = {"estimate": "estimate", "guidance": "guidance", "pad": "pad's place"}  # of a touchdown's distance


def show(facts: dict[str, Any], manifest: Mapping[str, Any], median: int) -> None:
    """How it ended, errors per state beside the paper's table, touchdown, files."""
    many, paper, white = facts["flights"] > 1, manifest.get("paper"), facts["gps"] == "white"
    wide, digits = (WIDEST if many and paper else WIDE), 3 if many else 4
    first_line = sentence(manifest, facts)
    say(*([first_line] if first_line else []), title(facts))
    named = (f"{name} (5-95 %)" if many and name in RANGED else name for name in STATISTICS)
    heads = ["error in flight", *named, *(f"paper\n{statistic}" for statistic in PRINTED if paper)]
    errors = table(heads, left=1, fixed=1, **plain_look(edge=False))
    for column in errors.columns[1 + len(STATISTICS) :]:
        column.style = "dim"
    for state, entry in facts["states"].items():
        cells = [_statistic(entry, name, digits) for name in STATISTICS]
        cells += [f"{paper['states'][state][f'{name}_error']:.4f}" for name in PRINTED] if paper else []
        errors.add_row(f"{state} [{UNITS[state]}]", *cells)
    for angle, entry in (facts["attitude_deg"] or {}).items():
        cells = [_statistic(entry, name, digits) for name in STATISTICS]
        errors.add_row(f"{angle} [deg]", *cells, *("" for _ in PRINTED if paper))
    say(errors, wide=wide)
    if facts["filter"] != "paper" and facts["attitude_deg"]:
        say(HEADING)
    if paper:
        beside = "" if white else f"; {receiver(facts)} is not white"
        largest = _cell(facts["max_position_error_m"], digits)
        say(f"largest error of one position axis  {largest} m; paper: {paper['max_position_error_m']:.4f} m")
        say(f"the paper's are of its {paper['title']}: its own filter, with white GPS noise{beside}")
    if "known_exactly" in facts:
        say(f"known without error: {facts['known_exactly']}")
    if facts.get("takeoff"):
        say(*takeoff_lines(facts["takeoff"], facts["flights"]))
    if facts["touchdown"] is not None:
        say(*touchdown_lines(facts["touchdown"], facts.get("landed"), facts["flights"]))
    if "pad_frames" in facts:
        say(_pad_frames(facts["pad_frames"]), wide=wide)
    if facts.get("rmse_over_bound"):
        say(*_consistency_lines(facts))
    if "paper_percentile" in facts:
        say(_percentiles(facts["paper_percentile"]))
    which = f" (flight {median}, the one with the median largest error)" if many else ""
    say(*(f"Note: {note}" for note in facts["notes"]), soft=True)
    say(*file_lines(facts, which), soft=True)


def file_lines(facts: Mapping[str, Any], which: str = "") -> list[str]:
    """Where record and report lie, in one line of a terminal where both fit. which: words on the record's flight."""
    files = [f"record  {facts['record']}{which}", *([f"report  {facts['report']}"] if "report" in facts else [])]
    together = "   ".join(files)
    return [together] if len(together) <= NARROW else files


def receiver(facts: Mapping[str, Any]) -> str:
    """The GPS of a flight, in words."""
    return RECEIVERS.get(facts["gps"], f"GPS {facts['gps']}")


def title(facts: Mapping[str, Any]) -> str:
    """The flight's title, in a line."""
    flies = "the paper's filter" if facts["filter"] == "paper" else "navigator"
    plant = "" if facts["truth"] == "nonlinear" else ", linear vehicle"
    steered = "" if facts["feedback"] == "estimate" else ", steered by the truth"
    drawn = "drawn" if facts["truth_model"] == "ensemble" else "as it expects them"
    head = f"{facts['scenario']}, seed {facts['seed']}: {flies}, {receiver(facts)}{plant}{steered}"
    return f"{head}; vehicle, sensors {drawn}"


def takeoff_lines(takeoff: dict[str, Any], flights: int) -> list[str]:
    """How far a take-off, or many, passed the commanded height, and how long there was no flow."""
    over, blind = takeoff["over_commanded_m"], takeoff["without_flow_s"]
    if flights == 1:
        seen = f"no flow for {blind:.2f} s of its upper half" if blind else "flow all the way"
        return [f"take-off  {over:.3f} m over the commanded height, {seen}"]
    lost = f"in {takeoff['lost_flow']} of {flights} flights"
    return [
        f"take-off  {_cell(over, 3)} m over the commanded height, worst {over['worst']:.3f} m",
        f"no flow in the upper half of the climb  {_cell(blind, 2)} s, worst {blind['worst']:.2f} s, {lost}",
    ]


def touchdown_lines(landing: dict[str, Any], landed: int | None, flights: int) -> list[str]:
    """The touchdown of one flight or of many, a sentence a line."""
    lines = _one_lines(landing) if landed is None else _many_lines(landing, flights)
    return [*lines, *([] if landed is None else _landed_lines(landing, landed, flights))]


def _one_lines(landing: dict[str, Any]) -> list[str]:
    """The touchdown of one flight; the rest of its figures is in the report."""
    contact, rest, limited = (landing[name] or {} for name in ("contact", "rest", "limited_by"))
    lines = []
    if contact.get("distance_m") is not None:
        moves = [f"{words} {contact[key]:.2f} {unit}" for key, words, unit in MOTIONS[:2]]
        lines.append(f"touchdown  {contact['distance_m']:.3f} m off at {contact['t_s']:.2f} s, {', '.join(moves)}")
    if rest.get("distance_m") is not None:
        parts = [f"{words} {figure(limited.get(f'{name}_m'), '.3f')}" for name, words in PARTS.items()]
        lines.append(f"at rest  {rest['distance_m']:.3f} m off: {', '.join(parts)} m")
    return lines


def _many_lines(landing: dict[str, Any], flights: int) -> list[str]:
    """The touchdowns of many flights."""
    lines = []
    for name, group in (("touchdown", landing["contact"]), ("at rest", landing["rest"])):
        if group is None or group["distance_m"] is None:
            continue
        parts = [f"{_cell(group['distance_m'], 3)} m from the pad's centre, at {_cell(group['t_s'], 2)} s"]
        parts += [f"{words} {_cell(group[key], 3)} {unit}" for key, words, unit in MOTIONS if key in group]
        lines.append(f"{name}  {', '.join(parts)}")
        if flights < FLIGHTS_FOR_R95:
            lines.append(f"95 % of the flights, {name}  needs {FLIGHTS_FOR_R95} flights")
        elif group.get("r95_m") is not None:
            ends = interval_words(*group["r95_interval_m"])
            lines.append(f"95 % of the flights, {name}  within {group['r95_m']:.3f} m (95 % interval {ends})")
    limited = landing["limited_by"]
    if limited is not None and flights >= FLIGHTS_FOR_R95:
        parts = [f"{words} {figure(limited[f'{name}_m'], '.3f')} m" for name, words in PARTS.items()]
        lines.append(f"parts of the distance (they add as vectors), in 95 % of the flights at most  {', '.join(parts)}")
    return lines


def _landed_lines(landing: dict[str, Any], landed: int, flights: int) -> list[str]:
    """Number of landings, and the outcomes of the other flights."""
    rate, around = landing["success"], landing["went_around"]
    share = f"(95 % interval {100.0 * rate['low']:.1f}..{100.0 * rate['high']:.1f} %)"
    lines = [f"landed  {landed} of {flights} flights, {100.0 * rate['rate']:.1f} % {share}"]
    late = [f"{name} {count}" for name, count in landing["unfinished"].items() if count]
    lines += [f"not landed in time  {', '.join(late)}"] if late else []
    if around["flights"]:
        lines.append(f"went around  {around['flights']}, of which {around['landed']} landed after all")
    if beside := landing["verdicts"].get("beside the pad", 0):
        lines.append(f"at rest beside the pad  {beside}")
    if landing["broken"]:
        lines.append("crashes by  " + ", ".join(f"{name} {count}" for name, count in landing["broken"].items()))
    return lines


def _consistency_lines(facts: dict[str, Any]) -> list[str]:
    """How consistent the navigator is with its own model, of many flights."""
    bound, stated = (
        ", ".join(f"{state} {figure(ratio)}" for state, ratio in facts[key].items())
        for key in ("rmse_over_bound", "error_over_stated")
    )
    lines = [f"RMSE over the bound of the filter's own model, in flight  {bound}"]
    lines.append(f"RMS of the error over what is stated of it  {stated}")
    inside = facts["anees_inside_fraction"]
    if inside is not None:
        lines.append(f"ANEES inside its 95 % band  on {100.0 * inside:.1f} % of the steps in flight")
    return lines


def _pad_frames(bands: list[dict[str, Any]]) -> Any:
    """The table of detections in rendered frames, by height, next to the values of the pad camera's datasheet for the
    same frames.
    """

    def beside(row: dict[str, Any], key: str, expected_key: str, scale: float) -> str:
        return f"{figure(row[key], scale=scale)} ({figure(row[expected_key], scale=scale)})"

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
    return f"% of our flights that err less than the paper's: largest error {largest}; std {std}; |mean| {mean}"


def _cell(number: Any, digits: int) -> str:
    """A figure of one flight, or of many with what 5 and 95 % of them are below."""
    if isinstance(number, dict):
        return f"{number['median']:.{digits}f} ({number['p05']:.{digits}f}..{number['p95']:.{digits}f})"
    return figure(number, f".{digits}f")


def _statistic(entry: Mapping[str, Any], name: str, digits: int) -> str:
    """A statistic of an error; of many flights the means and spreads are medians alone."""
    number = entry[f"{name}_error"]
    alone = isinstance(number, Mapping) and name not in RANGED
    return _cell(number["median"] if alone else number, digits)
