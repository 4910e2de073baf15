"""The simulator's acceptance test: recorded flights flown again with simulated sensors, figure beside figure."""

from collections.abc import Callable
from dataclasses import asdict, dataclass
from pathlib import Path

import numpy as np

from flownav.core.errors import InputError
from flownav.core.measurement import Sensor
from flownav.core.text import finite_or_none
from flownav.logs.log import Log
from flownav.logs.open_log import open_flight
from flownav.navigation.settings import NavigatorSettingsFile
from flownav.replays.prepare import ReplayOptions
from flownav.replays.session import Replay, outage_summary, outage_table, replay
from flownav.studies.validation.drawn import AssumedVehicle, Flight, ValidationFile, Window
from flownav.studies.validation.figures import figures_of
from flownav.studies.validation.path import path_of
from flownav.studies.validation.sensed import simulated_log

NEEDED = (Sensor.GPS_POSITION, Sensor.FLOW_RATE, Sensor.IMU)
DECIDES = ("outage_median_m", "outage_worst_m")
NEITHER = ("flow_gain", "flow_lag_s")  # larger is not worse
LESS_IS_WORSE = ("_white",)
WITH_SIGN = ("_lag_one",)  # of which the size counts
SHARE_ENDINGS = ("_lag_one", "_share", "_lag_s")
SLACK, SHARE_SLACK = 1.25, 0.02  # a figure this little beyond the simulated flights counts as theirs


@dataclass(frozen=True)
class Row:
    """A figure of a log: as it was flown, and the median, least and largest of the simulated flights; None: unknown."""

    log: str
    figure: str
    flown: float | None
    simulated: float | None
    low: float | None
    high: float | None

    @property
    def decides(self) -> bool:
        """Whether the acceptance rests on this figure: the drift with flow does."""
        return self.figure in DECIDES

    @property
    def verdict(self) -> str:
        """Verdict on the simulator by this figure: too kind where no simulated flight was as hard as the recorded."""
        if self.flown is None or self.low is None or self.high is None:
            return "unknown"
        flown, low, high = self.flown, self.low, self.high
        if self.figure.endswith(WITH_SIGN):
            flown, low, high = abs(flown), *_sizes(low, high)
        kinder, harder = flown > SLACK * high + self._slack, flown < low / SLACK - self._slack
        if not (kinder or harder):
            return "as flown"
        if self.figure.endswith(NEITHER):
            return "other than flown"
        return "too kind" if kinder != self.figure.endswith(LESS_IS_WORSE) else "too hard"

    @property
    def _slack(self) -> float:
        return SHARE_SLACK if self.figure.endswith(SHARE_ENDINGS) else 0.0

    def as_json(self) -> dict[str, str | float | None]:
        """The figure as the command prints it."""
        return asdict(self)


def replays_of(flights: ValidationFile, seeds: int) -> int:
    """How many replays a validation takes."""
    return sum((1 + seeds) * (1 + 2 * len(flight.windows())) for flight in flights.flight)


def validate(
    folder: Path,
    flights: ValidationFile,
    seed: int,
    count: int,
    on_progress: Callable[[int], None] = lambda done: None,
) -> list[Row]:
    """The rows of every log, `count` simulated flights each. on_progress: called with how many replays are done.

    InputError where a log is missing, cannot be replayed, or lacks GPS, flow or IMU.
    """
    rows = []
    for flight in flights.flight:
        log = open_flight(folder / flight.log)
        rows += validate_log(flight.log, log, flight.windows(), flights.vehicle, seed, count, on_progress)
    return rows


def validate_log(
    name: str,
    log: Log,
    windows: list[Window],
    vehicle: AssumedVehicle,
    seed: int,
    count: int,
    on_progress: Callable[[int], None] = lambda done: None,
) -> list[Row]:
    """A log's rows. InputError as `validate`."""
    missing = [sensor.name.lower() for sensor in NEEDED if sensor not in log.streams]
    if missing:
        raise InputError(f"{log.path}: has no {' and no '.join(missing)}; a log to validate on needs GPS, flow and IMU")
    recorded, flown = measured(log, windows, on_progress)
    path = path_of(recorded, vehicle)
    simulated = []
    for number in range(count):
        again = simulated_log(log, path, Flight(seed, number), vehicle)
        simulated.append(measured(again, windows, on_progress)[1])
    return [
        row_of(name, figure, value, [other.get(figure, np.nan) for other in simulated])
        for figure, value in flown.items()
    ]


def measured(log: Log, windows: list[Window], on_progress: Callable[[int], None]) -> tuple[Replay, dict[str, float]]:
    """The smoothed replay of a log, and its figures; each outage is a replay of its own, with flow and without."""
    settings = NavigatorSettingsFile()
    found: dict[str, float] = {}
    for words, use_flow in (("", True), ("_no_flow", False)):
        cuts = outage_table(log, ReplayOptions(use_flow=use_flow), settings, windows, on_progress)
        summary = outage_summary(cuts)
        for which in ("median", "worst"):
            value = summary[f"outage_{which}_rms_m"]
            found[f"outage_{which}{words}_m"] = np.nan if value is None else value
    whole = replay(log, ReplayOptions(), settings, smoothed=True)
    on_progress(1)
    return whole, found | figures_of(whole)


def row_of(log: str, figure: str, flown: float, simulated: list[float]) -> Row:
    """The row of one figure; simulated flights that do not know it are left out."""
    known = np.array([value for value in simulated if np.isfinite(value)])
    if not len(known):
        return Row(log, figure, finite_or_none(flown), None, None, None)
    return Row(log, figure, finite_or_none(flown), float(np.median(known)), float(known.min()), float(known.max()))


def _sizes(low: float, high: float) -> tuple[float, float]:
    """Least and largest size of what lies between two numbers."""
    smaller, larger = sorted((abs(low), abs(high)))
    return (0.0 if low <= 0.0 <= high else smaller), larger
