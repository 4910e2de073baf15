"""The results of planted faults, and the page on how often an explanation was right."""

from __future__ import annotations

from typing import NamedTuple

from planted.planted import Planted

SINGLE = ("forum", "unseen", "own")
HOLDS, HOLDS_M_S, HOLDS_M = 1.3, 0.08, 0.5  # times the clean flight's error, and what is added to it
FIRST_LOOK = {"forum": "26 of 27", "unseen": "25 of 31", "harmless": "8 of 10"}  # before a rule was mended by them
FIRST_LOOK_CLEAN = "1 of 30"


FLOWN_TITLE = "## Flown in an autopilot's simulator"  # a section of its own: tools/explain_flown.py prints it


def without_flown(page: str) -> str:
    """The page but for that section, which is its last."""
    before = page.split(FLOWN_TITLE)[0]
    return before.rstrip("\n") + "\n\n" if before else ""


class Flown(NamedTuple):
    """A cure flown by another flight: errors of the stand-in's level velocity [m/s] and height [m], rms."""

    before: tuple[float, float]
    after: tuple[float, float]
    sound: tuple[float, float]

    @property
    def harmed(self) -> bool:
        """Whether the fault did any harm in this flight."""
        return not self._as_sound(self.before)

    @property
    def holds(self) -> bool:
        """Whether the cured errors are those of a sound flight."""
        return self._as_sound(self.after)

    def _as_sound(self, errors: tuple[float, float]) -> bool:
        slack = (HOLDS_M_S, HOLDS_M)
        return all(one <= HOLDS * s + more for one, s, more in zip(errors, self.sound, slack, strict=True))


class Result(NamedTuple):
    """The result of one planted fault: the causes named, the first one first, and its cure flown again."""

    fault: Planted
    named: tuple[str, ...]
    seconds: float
    flown: Flown | None

    @property
    def right(self) -> bool:
        """Whether the first cause is one that was planted; of a clean flight, whether none is named."""
        return self.named[:1] != () and self.named[0] in self.fault.causes if self.fault.causes else not self.named

    @property
    def all_named(self) -> bool:
        """Whether every planted cause is named."""
        return set(self.fault.causes) <= set(self.named)

    @property
    def besides(self) -> bool:
        """Whether a cause is named that was not planted."""
        return not set(self.named) <= set(self.fault.causes)


class Recorded(NamedTuple):
    """A recorded log: what is known of it by others, what was named, its length and the processor time [s]."""

    name: str
    known: str
    named: tuple[str, ...]
    length_s: float
    seconds: float


HEAD = """# How often an explanation is right

Printed by `make explain`. Logs are made by flownav's simulator, with a stand-in for the autopilot's estimator that
does what its parameters say; they are written in the autopilots' own formats, without the truth, and read back.

| list | written |
|---|---|
| *forum* | from forums, issue trackers and manuals, before any rule was |
| *unseen* | by an engineer who had not read the rules |
| *own* | beside the rules |
| *pairs* | two causes at once, beside the rules |
| *harmless* | oddities that are no fault: nothing is to be named; by an engineer who had not read the rules |

A first cause is right where it is what was planted (of a pair, either one). *First look* is what was right when a list
was looked at for the first time. The rules were then mended by what *forum*, *unseen*, *harmless* and clean flights
had shown, once also by the same faults in other flights: what is right since then is no longer a blind figure. *In
other flights* plants the same faults into flights of yet other seeds, which no rule was mended by.

"""


def page(
    by_list: dict[str, list[Result]],
    again: dict[str, list[Result]],
    sound: list[Result],
    recorded: list[Recorded],
    judged: str,
) -> str:
    """The tables; again: the same in other flights, of "clean" as well; judged: the text on recorded logs."""
    text = HEAD + "| list | planted | first look | first cause right | all named | also one that was not planted "
    text += "| in other flights right | all named | processor time, most |\n|---|---|---|---|---|---|---|---|---|\n"
    for name, found in by_list.items():
        other, longest = again[name], max(one.seconds for one in found)
        right, share = _right(found)
        cells = [name, f"{len(found)}", FIRST_LOOK.get(name, "-"), f"{right} ({share:.0f} %)", _all_named(found)]
        cells += [f"{sum(one.right and one.besides for one in found)}"]
        cells += ["{} ({:.0f} %)".format(*_right(other)), _all_named(other), f"{longest:.1f} s"]
        text += f"| {' | '.join(cells)} |\n"
    wrong, wrong_again = (sum(not one.right for one in of) for of in (sound, again["clean"]))
    text += f"\nClean made flights in which something is named: {wrong} of {len(sound)} "
    text += f"(at the first look {FIRST_LOOK_CLEAN}), and {wrong_again} of {len(again['clean'])} of other seeds.\n"
    text += "\n## By cause\n\nOf *forum*, *unseen* and *own* together, and in other flights; "
    text += "also named first: how often the cause is named first where it was not planted.\n\n"
    text += "| cause | planted | named first | also named first |\n|---|---|---|---|\n"
    single = [one for name in SINGLE for one in by_list[name]]
    every = [*single, *(one for name in SINGLE for one in again[name])]
    for cause in sorted({cause for one in every for cause in one.fault.causes}):
        mine = [one for one in every if cause in one.fault.causes]
        also = [
            one
            for one in (*every, *sound, *again["clean"])
            if cause not in one.fault.causes and one.named[:1] == (cause,)
        ]
        text += f"| `{cause}` | {len(mine)} | {sum(one.right for one in mine)} | {len(also)} |\n"
    text += "\n## One by one\n\n| list | fault | planted | named | in another flight |\n|---|---|---|---|---|\n"
    for name, found in by_list.items():
        for one, other_flight in zip(found, again[name], strict=True):
            planted = ", ".join(one.fault.causes) or "nothing"
            text += f"| {name} | {one.fault.name} | {planted} | {_named(one)} | {_named(other_flight)} |\n"
    for one in (*sound, *again["clean"]):
        if not one.right:
            text += f"| clean | {one.fault.name} | nothing | {_named(one)} | - |\n"
    if recorded:
        text += "\n## Recorded logs\n\n| log | known of it | named | length | processor time |\n|---|---|---|---|---|\n"
        for log in recorded:
            named = ", ".join(log.named) or "nothing"
            text += f"| {log.name} | {log.known} | {named} | {log.length_s:.0f} s | {log.seconds:.1f} s |\n"
    text += judged
    cured = [(one.fault.name, one.flown) for one in single if one.flown is not None]
    harmed = [one for _, one in cured if one.harmed]
    text += "\n## Cures flown again\n\nThe same fault in another flight, with the parameters of the cure, where they "
    text += f"are named as its cure: of {len(harmed)} flights in which the fault did harm "
    text += f"{sum(one.holds for one in harmed)} "
    text += "are as good as without it; of the others, in which the stand-in was not hurt, "
    text += f"{sum(one.holds for _, one in cured if not one.harmed)} of {len(cured) - len(harmed)} stay so. "
    text += "Level velocity and height, rms, in m/s and m.\n\n"
    text += "| fault | with the fault | cured | without it | holds |\n|---|---|---|---|---|\n"
    for fault, flight in cured:
        cells = (f"{level:.2f}, {height:.2f}" for level, height in flight)
        held = "yes" if flight.holds else "**no**"
        text += f"| {fault} | {' | '.join(cells)} | {held if flight.harmed else f'{held} (no harm)'} |\n"
    return text


def _right(found: list[Result]) -> tuple[int, float]:
    """How many are right, and the share in percent."""
    right = sum(one.right for one in found)
    return right, 100.0 * right / len(found)


def _all_named(found: list[Result]) -> str:
    return f"{sum(one.all_named for one in found)}" if any(one.fault.causes for one in found) else "-"


def _named(one: Result) -> str:
    return (", ".join(one.named) or "nothing") + ("" if one.right else " (**wrong**)")
