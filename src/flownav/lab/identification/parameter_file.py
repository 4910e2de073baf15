"""One parameter of an autopilot, and the files in which ground stations load them.

PX4: QGroundControl's tab-separated .params (vehicle, component, name, value, MAVLink type: 6 a 32-bit integer, 9 a
float). ArduPilot: Mission Planner's and MAVProxy's NAME,VALUE .param. INAV: lines for its command line (`set name =
value`). In all, a line that starts with # is a comment; each value has one above it with the figure that it comes from.
"""

from typing import NamedTuple

from flownav.lab.identification.quantities import Interval

INTEGER, FLOAT = 6, 9
AUTOPILOTS = {"px4": ".params", "ardupilot": ".param", "inav": ".txt"}


class Parameter(NamedTuple):
    """A name, its value in the autopilot's unit, its MAVLink type and where it comes from.

    needed: the value that the log requires, where the parameter's range does not reach so far; else None.
    """

    name: str
    value: float
    kind: int
    reason: str
    needed: float | None = None

    @property
    def text(self) -> str:
        """The value as the file holds it."""
        return str(round(self.value)) if self.kind == INTEGER else f"{self.value:.4g}"


def within(name: str, wanted: float, low: float, high: float, kind: int, reason: str) -> Parameter:
    """A parameter within its range low to high; where a value is cut, the reason states it."""
    held = min(max(wanted, low), high)
    if held == wanted:
        return Parameter(name, wanted, kind, reason)
    cut = f"{wanted:.4g} is needed, cut to the parameter's range of {low:g} to {high:g}"
    return Parameter(name, held, kind, f"{reason}; {cut}", wanted)


def file_text(autopilot: str, found: list[Parameter], remarks: tuple[str, ...]) -> str:
    """The file."""
    lines = [f"# flownav identify, for {autopilot}", *(f"# {one_line(remark)}" for remark in remarks)]
    if autopilot == "px4":
        lines.append("# Vehicle-Id Component-Id Name Value Type")
    for parameter in found:
        lines += [f"# {one_line(parameter.reason)}", _line(autopilot, parameter)]
    if autopilot == "inav" and found:
        lines.append("save")
    return "\n".join(lines) + "\n"


def _line(autopilot: str, parameter: Parameter) -> str:
    if autopilot == "px4":
        return f"1\t1\t{parameter.name}\t{parameter.text}\t{parameter.kind}"
    if autopilot == "inav":
        return f"set {parameter.name} = {parameter.text}"
    return f"{parameter.name},{parameter.text}"


def one_line(text: str) -> str:
    """A text without line ends."""
    return " ".join(text.split())


def shown(interval: Interval, factor: float, unit: str) -> str:
    """A value with its interval, in a unit."""
    value, low, high = (factor * number for number in interval)
    return f"{value:.3g} {unit}".strip() + f" [{low:.3g}, {high:.3g}]"
