"""Why a measurement component was not fused: one code per reason, each with its sentence.

The codes are stable: kernels write them, records keep their names. Nothing is rejected without one.
"""

from enum import IntEnum


class Reason(IntEnum):
    """Outcome of one measurement component. `FUSED` is the only one that is no rejection."""

    FUSED = 0
    INNOVATION_GATE = 1
    NO_DATA = 2
    NOT_FINITE = 3
    OUT_OF_RANGE = 4
    NO_HEIGHT = 5
    TILTED = 6
    BEFORE_START = 7
    DATUM = 8
    OUTAGE = 9
    DUPLICATE = 10
    LATE = 11
    STUCK = 12
    NEAR_GROUND = 13
    NOT_NEEDED = 14
    AHEAD = 15
    NO_HEADING = 16

    @property
    def label(self) -> str:
        """The name that records and JSON carry, e.g. `innovation_gate`."""
        return self.name.lower()

    @property
    def message(self) -> str:
        """One sentence for people."""
        return MESSAGES[self]


MESSAGES: dict[Reason, str] = {
    Reason.FUSED: "The component corrected the state.",
    Reason.INNOVATION_GATE: "The reading disagrees with the prediction by more than the gate allows.",
    Reason.NO_DATA: "The sensor says that it has no data (quality 0), which is not zero motion.",
    Reason.NOT_FINITE: "The reading or its variance is not a finite number.",
    Reason.OUT_OF_RANGE: "The reading lies outside what the sensor can measure.",
    Reason.NO_HEIGHT: "Flow needs the height above ground, and no range has been accepted lately, or the latest not.",
    Reason.TILTED: "The vehicle tilts too far for a downward-looking sensor.",
    Reason.BEFORE_START: "The filter had not started: it waits for an attitude and a first position.",
    Reason.DATUM: "The reading set the sensor's datum (ground level, pressure offset) and holds no more news.",
    Reason.OUTAGE: "The user withheld the reading (a GPS cut, or no flow); its innovation is still shown.",
    Reason.DUPLICATE: "The same reading came before, or one of this sensor that is not older.",
    Reason.LATE: "The reading describes a time that the filter has left behind.",
    Reason.STUCK: "The sensor has repeated one value for long, which is no news, and may be stuck.",
    Reason.NEAR_GROUND: "The vehicle is nearer to the ground than the sensor can be trusted.",
    Reason.NOT_NEEDED: "Another source of the same kind serves; this one is only watched.",
    Reason.AHEAD: "The reading's time stamp lies ahead of the receiver's clock.",
    Reason.NO_HEADING: "Flow needs a heading, which is being found from the course by GPS; or the compass was refuted.",
}
