"""The navigator on trial: the event-driven landing filter behind a horizon, with what the datasheets state."""

from __future__ import annotations

from collections.abc import Mapping
from pathlib import Path

import numpy as np

from flownav.compile import announce_compilation
from flownav.errors import InputError
from flownav.estimation.gating import Reason
from flownav.faults.arrival import as_fed, stamped_ahead
from flownav.faults.navigated import Event, Flag, Navigate, Navigated, Offers
from flownav.logs.log import Log
from flownav.measurement import Array, Sensor, Stream
from flownav.navigation.feed import new_navigator
from flownav.navigation.loop import run
from flownav.navigation.settings import NavigatorSettingsFile
from flownav.navigation.state import (
    AIDED_AGAIN,
    DEAD_RECKONING,
    EVENT_NAMES,
    FLOW_DOUBTED,
    FLOW_TRUSTED,
    POSITION_INVALID,
    Tape,
    new_tape,
)
from flownav.replay.prepare import IdentifiedFlow, Prepared, ReplayOptions, identified_flow, prepare
from flownav.simulation.assemble import Setup

TAKEN_IN = (Reason.FUSED, Reason.DATUM)
RAISING = {
    int(DEAD_RECKONING): int(AIDED_AGAIN),
    int(POSITION_INVALID): int(AIDED_AGAIN),
    int(FLOW_DOUBTED): int(FLOW_TRUSTED),
}
ABOVE_FLOOR_M = 0.01  # a sonar that reads its floor says only that there is no more


def landing_navigator(settings: NavigatorSettingsFile, flow: IdentifiedFlow) -> Navigate:
    """The navigator with these settings, and this gain and latency of the flow sensor."""

    def navigate(streams: Mapping[Sensor, Stream]) -> Navigated:
        """Raises InputError where the filter never starts."""
        prepared = prepare(Log(Path("faults"), dict(streams)), ReplayOptions(_gps_delay(streams), identified=flow))
        queue = as_fed(prepared.streams)
        running = new_navigator(
            prepared.streams, float(queue.t_s[0]), prepared.flow_gyro_is_imu, settings, new_tape(queue)
        )
        with announce_compilation("faults"):
            run(queue, running)
        if running.tape.used[0] < 2:
            raise InputError("faults: the navigator never started; it needs an IMU or an attitude, and a fix or flow")
        return navigated(running.tape, prepared)

    return navigate


def navigator_of(setup: Setup) -> Navigate:
    """The navigator for a simulated vehicle: defaults, but for what its datasheets and its drawing state."""
    gps, sonar, sensors = setup.scenario.gps, setup.scenario.rangefinder, setup.flight.sensors
    settings = NavigatorSettingsFile(
        gps_slow_sigma_m=gps.slow_sigma_m,
        gps_slow_sigma_down_m=gps.slow_sigma_down_m,
        gps_slow_tau_s=gps.slow_tau_s,
        gps_fast_sigma_m=gps.fast_sigma_m,
        gps_fast_sigma_down_m=gps.fast_sigma_down_m,
        gps_fast_tau_s=gps.fast_tau_s,
        gps_velocity_sigma_m_s=gps.velocity_sigma_total_m_s,
        gps_velocity_tau_s=gps.velocity_tau_s,
        range_min_m=float(sonar.floor_m) + ABOVE_FLOOR_M,
        range_max_m=float(sonar.ceiling_m),
        flow_min_height_m=sensors.flow.min_height_m,
        flow_limit_rad_s=sensors.flow.max_flow_rad_s,
        flow_below_m=sensors.lens_below_cg_m,
        range_below_m=sensors.lens_below_cg_m,
    )
    return landing_navigator(settings, identified_flow(setup.sensor))


def _gps_delay(streams: Mapping[Sensor, Stream]) -> float:
    """The delay that the receiver states."""
    delays_s = [streams[sensor].delay_s for sensor in (Sensor.GPS_POSITION, Sensor.GPS_VELOCITY) if sensor in streams]
    return max(delays_s, default=0.0)


# -- what came of it ---------------------------------------------------------------------------------------
def navigated(tape: Tape, prepared: Prepared) -> Navigated:
    """A tape as the judges of faults take it. A state that is no number has no standard deviation either."""
    estimate = tape.estimate[: tape.used[0]]
    happened = tape.event[: tape.used[2]]
    return Navigated(
        estimate[:, 0],
        estimate[:, 1:4],
        estimate[:, 11:14],
        offers_of(tape.innovation[: tape.used[1]], prepared),
        tuple(Event(t_s, *EVENT_NAMES[int(kind)][:2]) for t_s, kind, _ in happened.tolist()),
        flags_of(happened),
    )


def offers_of(rows: Array, prepared: Prepared) -> Offers:
    """Every judged component, and every reading that was not fed because its stamp lay ahead of the clock."""
    delay_s = np.zeros(max(Sensor) + 1)
    for sensor, known_s in prepared.delays_s.items():
        delay_s[sensor] = known_s
    sensors, reasons = rows[:, 1].astype(int), rows[:, 8].astype(int)
    labels = np.array([reason.label for reason in Reason])
    ahead_s = {sensor: stream.t_s[stamped_ahead(stream)] for sensor, stream in prepared.streams.items()}
    refused = sum(len(times) for times in ahead_s.values())
    return Offers(
        np.concatenate([rows[:, 0] + delay_s[sensors], *ahead_s.values()]),
        np.concatenate([sensors, *(np.full(len(times), int(sensor)) for sensor, times in ahead_s.items())]),
        np.concatenate([rows[:, 2].astype(int), np.zeros(refused, int)]),
        np.concatenate([np.isin(reasons, TAKEN_IN), np.zeros(refused, bool)]),
        np.concatenate([labels[reasons], np.full(refused, Reason.AHEAD.label)]),
    )


def flags_of(happened: Array) -> tuple[Flag, ...]:
    """Warnings that stood: each from the event that raised it to the one that took it down, or to the end."""
    flags = []
    for t_s, kind, _ in happened.tolist():
        if int(kind) in RAISING:
            down = happened[(happened[:, 1] == RAISING[int(kind)]) & (happened[:, 0] >= t_s), 0]
            flags.append(Flag(t_s, float(down.min(initial=np.inf)), *EVENT_NAMES[int(kind)][:2]))
    return tuple(flags)
