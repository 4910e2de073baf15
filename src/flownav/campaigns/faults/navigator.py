"""Runs the navigator under test behind a horizon, set up from the sensors' datasheets, and collects its outputs."""

from collections.abc import Callable, Mapping
from dataclasses import dataclass
from pathlib import Path
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from flownav.campaigns.faults.inject import as_fed, stamped_ahead
from flownav.core.compile import announce_compilation
from flownav.core.errors import InputError
from flownav.core.measurement import Array, EventQueue, Sensor, Stream
from flownav.estimation.gating import Reason
from flownav.logs.log import Log
from flownav.navigation.feed import equipment_of
from flownav.navigation.flags import Flag, flags_of
from flownav.navigation.loop import Running, run, start_navigator
from flownav.navigation.rows import EstimateRow, InnovationRow
from flownav.navigation.settings_of import GivenSettings
from flownav.navigation.tables import Written, written_on
from flownav.navigation.tape import EVENT_NAMES, new_tape
from flownav.replays.prepare import Prepared, ReplayOptions, prepare
from flownav.sensors.datasheet import IdentifiedFlow
from flownav.simulation.assemble import Setup


class Offers(NamedTuple):
    """One row for each component of a reading that the navigator was given and judged.

    t_s (m,): the reading's time stamp, as in the stream that was given (not less its delay). sensor (m,): of
    measurement.Sensor. component (m,): its number in the reading. fused (m,): whether it moved the state or set a
    datum. reason (m,): the label where it was not.
    """

    t_s: Array
    sensor: NDArray[np.int64]
    component: NDArray[np.int64]
    fused: NDArray[np.bool_]
    reason: NDArray[np.str_]


class Event(NamedTuple):
    """A happening: a reset, a datum, a flag raised or taken down. source: "gps", "flow", "range", ... or "filter"."""

    t_s: float
    source: str
    kind: str


@dataclass(frozen=True)
class Navigated:
    """The outputs of a navigator on a log.

    t_s (n,) increasing, the instants that the estimates describe; position_ned_m and sigma_ned_m (n, 3) in the log's
    local frame, one standard deviation each; offers, events, flags in any order. levels_m (n, 2): protection levels,
    horizontal and vertical; None where the navigator states none.
    """

    t_s: Array
    position_ned_m: Array
    sigma_ned_m: Array
    offers: Offers
    events: tuple[Event, ...] = ()
    flags: tuple[Flag, ...] = ()
    levels_m: Array | None = None


Navigate = Callable[[Mapping[Sensor, Stream]], Navigated]


# -- the navigator -----------------------------------------------------------------------------------------------
TAKEN_IN = (Reason.FUSED, Reason.DATUM)


def navigator_with(given: GivenSettings) -> Navigate:
    """The navigator with these settings; streams state the delays of their readings."""

    def navigate(streams: Mapping[Sensor, Stream]) -> Navigated:
        """Raises InputError where the filter never starts."""
        prepared, queue, running = started(streams, given)
        with announce_compilation("faults", "the navigator, once, about 20 s"):
            run(queue, running)
        written = written_on(running.tape)
        if len(written.estimate) < 2:
            raise InputError("faults: the navigator never started; it needs an IMU or an attitude, and a fix or flow")
        return navigated(written, prepared)

    return navigate


def started(streams: Mapping[Sensor, Stream], given: GivenSettings) -> tuple[Prepared, EventQueue, Running]:
    """The streams as they are fed, and a navigator that waits for them."""
    aged = ReplayOptions(_gps_delay(streams), identified=_flow_as_it_is(streams))
    prepared = prepare(Log(Path("faults"), dict(streams)), aged)
    queue = as_fed(prepared.streams)
    equipment = equipment_of(prepared.streams, float(queue.t_s[0]), prepared.flow_gyro_is_imu, given.settings)
    return prepared, queue, start_navigator(equipment, given.settings, new_tape(queue), given.noise)


def navigator_of(setup: Setup) -> Navigate:
    """The navigator of a simulated vehicle, with the same settings as in flight.

    ValueError where the vehicle carries no sensors of its own.
    """
    if setup.fitted is None:
        raise ValueError(f"{setup.scenario.name}: the paper's filter flies, and no navigator")
    return navigator_with(setup.fitted.given)


def _gps_delay(streams: Mapping[Sensor, Stream]) -> float:
    """The delay that the receiver states."""
    delays_s = [streams[sensor].delay_s for sensor in (Sensor.GPS_POSITION, Sensor.GPS_VELOCITY) if sensor in streams]
    return max(delays_s, default=0.0)


def _flow_as_it_is(streams: Mapping[Sensor, Stream]) -> IdentifiedFlow | None:
    """The flow sensor's age as its stream states it, and its axes the vehicle's."""
    flow = streams.get(Sensor.FLOW_RATE)
    return None if flow is None else IdentifiedFlow(1.0, 1.0, flow.delay_s)


# -- outputs ---------------------------------------------------------------------------------------------------
def navigated(written: Written, prepared: Prepared) -> Navigated:
    """The written outputs in the form that the judges of faults take. A state that is no number has no standard
    deviation either.
    """
    row = EstimateRow.of(written.estimate)
    return Navigated(
        row.t_s,
        row.pos_ned_m,
        row.std_pos_ned_m,
        offers_of(written.innovation, prepared),
        tuple(Event(t_s, *EVENT_NAMES[int(kind)][:2]) for t_s, kind, _ in written.event.tolist()),
        flags_of(written.event),
        row.protection_m,
    )


def offers_of(rows: Array, prepared: Prepared) -> Offers:
    """Every judged component, and every reading that was not fed because its stamp lay ahead of the clock."""
    delay_s = np.zeros(max(Sensor) + 1)
    for sensor, known_s in prepared.delays_s.items():
        delay_s[sensor] = known_s
    offered = InnovationRow.of(rows)
    sensors, reasons = offered.sensor.astype(int), offered.reason.astype(int)
    labels = np.array([reason.label for reason in Reason])
    ahead_s = {sensor: stream.t_s[stamped_ahead(stream)] for sensor, stream in prepared.streams.items()}
    refused = sum(len(times) for times in ahead_s.values())
    return Offers(
        np.concatenate([offered.t_s + delay_s[sensors], *ahead_s.values()]),
        np.concatenate([sensors, *(np.full(len(times), int(sensor)) for sensor, times in ahead_s.items())]),
        np.concatenate([offered.component.astype(int), np.zeros(refused, int)]),
        np.concatenate([np.isin(reasons, TAKEN_IN), np.zeros(refused, bool)]),
        np.concatenate([labels[reasons], np.full(refused, Reason.AHEAD.label)]),
    )
