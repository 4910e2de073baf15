"""The table that `flownav fly` prints for people."""

from __future__ import annotations

from typing import Any

from rich.console import Console
from rich.table import Table

WIDE = 92  # columns that one flight beside a published table takes
WIDEST = 132  # columns that the medians and percentiles of many flights take
UNITS = {"x": "m", "y": "m", "z": "m", "u": "m/s", "v": "m/s", "w": "m/s"}


def show(facts: dict[str, Any], paper: dict[str, Any] | None, median: int) -> None:
    """Errors per state beside the paper's table, largest position error, touchdown, files."""
    many = facts["flights"] > 1
    console = Console(markup=False, highlight=False)
    console.width = max(console.width, WIDEST if many else WIDE)
    plant = "" if facts["truth"] == "nonlinear" else ", linear truth"
    flown_on = "" if facts["feedback"] == "estimate" else ", flown on the truth"
    flies = "the paper's filter" if facts["filter"] == "paper" else "the navigator"
    told = ", an ensemble" if facts["truth_model"] == "ensemble" else ", matched"
    title = f"{facts['scenario']}: {flies}, {facts['gps']} GPS{plant}{flown_on}{told}, seed {facts['seed']}"
    table = Table(
        title=title + (f", {facts['flights']} flights: median (5-95 %)" if many else ""), title_justify="left"
    )
    table.add_column("state")
    for name in ("mean error", "std error", "rms error", "max error"):
        table.add_column(name, justify="right")
    white = facts["gps"] == "white"
    if paper:
        whose = "paper's filter" if white else "paper's filter,\nwhite GPS noise"
        for statistic in ("mean", "std"):
            table.add_column(f"{paper['title']} {statistic}\n({whose})", justify="right", style="dim")
    for state, entry in facts["states"].items():
        cells = [_cell(entry[key], 3 if many else 4) for key in ("mean_error", "std_error", "rms_error", "max_error")]
        if paper:
            cells += [f"{paper['states'][state][key]:.4f}" for key in ("mean_error", "std_error")]
        table.add_row(f"{state} [{UNITS[state]}]", *cells)
    console.print(table)
    beside = ""
    if paper:
        beside = f"   paper: {paper['max_position_error_m']:.4f} m"
        beside += "" if white else f" (for white GPS noise; {facts['gps']} is not white)"
    largest = _cell(facts["max_position_error_m"], 3 if many else 4)
    console.print(f"largest error of one position axis  {largest} m{beside}", highlight=False)
    if "known_exactly" in facts:
        console.print("errors are those of what was flown on, in flight after the hand-over", highlight=False)
        console.print(f"known exactly  {facts['known_exactly']}", highlight=False)
    if facts.get("takeoff"):
        for line in takeoff_lines(facts["takeoff"], facts["flights"]):
            console.print(line, highlight=False)
    _show_touchdown(console, facts)
    if "pad_frames" in facts:
        _show_pad_frames(console, facts["pad_frames"])
    if facts.get("rmse_over_bound"):
        _show_consistency(console, facts)
    if "paper_percentile" in facts:
        _show_percentiles(console, facts["paper_percentile"])
    which = f" (flight {median}, the one with the median largest error)" if many else ""
    console.print(f"record  {facts['record']}{which}", highlight=False)
    if "report" in facts:
        console.print(f"report  {facts['report']}", highlight=False)


def _show_touchdown(console: Console, facts: dict[str, Any]) -> None:
    """Contact, rest, success, what limits them, and what was broken."""
    landing = facts["touchdown"]
    if landing is None:
        return
    for line in touchdown_lines(landing, facts.get("landed"), facts["flights"]):
        console.print(line, highlight=False)


def takeoff_lines(takeoff: dict[str, Any], flights: int) -> list[str]:
    """How far a take-off, or many, passed the commanded height, and how long there was no flow."""
    over, blind = takeoff["over_commanded_m"], takeoff["without_flow_s"]
    said = [
        f"take-off  {_cell(over, 3)} m over the commanded height",
        f"without flow above half of it  {_cell(blind, 2)} s",
    ]
    if flights == 1:
        return said
    return [
        f"{said[0]}, worst {over['worst']:.3f} m",
        f"{said[1]}, worst {blind['worst']:.2f} s, in {takeoff['lost_flow']} of {flights} flights",
    ]


def touchdown_lines(landing: dict[str, Any], landed: int | None, flights: int) -> list[str]:
    """The touchdown of one flight or of many, a sentence a line."""
    said = []
    for name, group in (("contact", landing["contact"]), ("at rest", landing["rest"])):
        if group is None or group["distance_m"] is None:
            continue
        parts = [f"{_cell(group['distance_m'], 3)} m from the pad's centre, at {_cell(group['t_s'], 2)} s"]
        parts += [
            f"{words} {_cell(group[key], 3)} {unit}"
            for key, words, unit in (
                ("sink_rate_m_s", "sinking at", "m/s"),
                ("lateral_speed_m_s", "drifting at", "m/s"),
                ("slide_m", "slid", "m"),
                ("tilt_deg", "tilted", "deg"),
                ("yaw_rate_deg_s", "turning at", "deg/s"),
            )
            if key in group
        ]
        said.append(f"touchdown, {name}  {', '.join(parts)}")
        if group.get("r95_m") is not None:
            low, high = (_or_dash(end, 3) for end in group["r95_interval_m"])
            said.append(f"touchdown R95, {name}  {group['r95_m']:.3f} m (95 % interval {low}..{high})")
    limited = landing["limited_by"]
    if limited is not None:
        which = "" if landed is None else "95 % of the flights within: "
        parts = [f"{name} {_or_dash(limited[f'{name}_m'], 3)} m" for name in ("estimate", "guidance", "pad")]
        said.append(f"limited by  {which}{', '.join(parts)}")
    if landed is None:
        broken = landing["broken"]
        verdict = f"crashed: {', '.join(broken)}" if broken else landing["verdict"].replace("unfinished", "not at rest")
        around = f", after {landing['go_arounds']} go-around(s)" if landing["go_arounds"] else ""
        return [*said, f"verdict  {verdict}{around}"]
    rate = landing["success"]
    said.append(
        f"landed  {landed} of {flights} flights, {100.0 * rate['rate']:.1f} % "
        f"(95 % interval {100.0 * rate['low']:.1f}..{100.0 * rate['high']:.1f} %)"
    )
    late = [f"{name} {count}" for name, count in landing["unfinished"].items() if count]
    if late:
        said.append("not landed in time  " + ", ".join(late))
    if landing["went_around"]["flights"]:
        around = landing["went_around"]
        said.append(f"went around  {around['flights']}, of which {around['landed']} landed after all")
    if landing["broken"]:
        said.append("crashes by  " + ", ".join(f"{name} {count}" for name, count in landing["broken"].items()))
    return said


def _show_consistency(console: Console, facts: dict[str, Any]) -> None:
    """How consistent the navigator is with its own model, of many flights."""
    ratios = ", ".join(f"{state} {_or_dash(ratio)}" for state, ratio in facts["rmse_over_bound"].items())
    console.print(f"RMSE over the bound of the filter's own model, in flight  {ratios}", highlight=False)
    stated = ", ".join(f"{state} {_or_dash(ratio)}" for state, ratio in facts["error_over_stated"].items())
    console.print(f"RMS of the error over what is stated of it  {stated}", highlight=False)
    inside = facts["anees_inside_fraction"]
    if inside is not None:
        console.print(f"ANEES inside its 95 % band  on {100.0 * inside:.1f} % of the steps in flight", highlight=False)


def _show_pad_frames(console: Console, bands: list[dict[str, Any]]) -> None:
    """What was seen in rendered frames, by height, beside what the pad camera's datasheet says of the same frames."""
    table = Table(title="pad in rendered frames (its datasheet)", title_justify="left")
    for name in ("height [m]", "frames", "in view", "found", "wrong", "angle rms [mrad]", "distance rms [%]"):
        table.add_column(name, justify="right")
    for row in bands:
        found = f"{row['found']} ({row['expected_found']:.1f})"
        angle, distance = (
            f"{_scaled(row[said], scale)} ({_scaled(row[told], scale)})"
            for said, told, scale in (
                ("angle_rms_rad", "expected_angle_rad", 1e3), ("distance_rms", "expected_distance", 1e2)
            )
        )  # fmt: skip
        counts = str(row["frames"]), str(row["in_view"]), found, str(row["wrong"])
        table.add_row(f"{row['from_m']:g} to {row['to_m']:g}", *counts, angle, distance)
    console.print(table)


def _scaled(number: float | None, scale: float) -> str:
    return _or_dash(None if number is None else scale * number)


def _or_dash(number: float | None, digits: int = 2) -> str:
    return "-" if number is None else f"{number:.{digits}f}"


def _show_percentiles(console: Console, percentiles: dict[str, Any]) -> None:
    """Where the paper's one flight lies among ours."""
    std = ", ".join(f"{state} {entry['std_error']:.0f}" for state, entry in percentiles["states"].items())
    mean = ", ".join(f"{state} {entry['mean_error']:.0f}" for state, entry in percentiles["states"].items())
    console.print(
        f"the paper's flight lies at our percentile: largest error {percentiles['max_position_error_m']:.0f}; "
        f"std {std}; |mean| {mean}",
        highlight=False,
    )


def _cell(number: Any, digits: int) -> str:
    if number is None:
        return "-"
    if isinstance(number, dict):
        return f"{number['median']:.{digits}f} ({number['p05']:.{digits}f}..{number['p95']:.{digits}f})"
    return f"{number:.{digits}f}"
