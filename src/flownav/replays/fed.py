"""Replaying what a navigator was fed: the same rows in the same order, so that the estimates are the same bits."""

from collections.abc import Callable
from dataclasses import replace

import numpy as np

from flownav.core.errors import InputError, arg
from flownav.core.measurement import EventQueue, Sensor
from flownav.core.parameter_files import check
from flownav.logs.log import FedSegment, Log
from flownav.navigation.feed import equipment_of
from flownav.navigation.kernel_settings import NO_STATED_NOISE, Equipment, FlowNoise
from flownav.navigation.loop import Instead, run, start_navigator
from flownav.navigation.settings import NavigatorSettingsFile
from flownav.navigation.tables import Written, written_on
from flownav.navigation.tape import tape_for
from flownav.replays.prepare import Prepared, ReplayOptions, check_windows, prepare


def as_fed(
    log: Log, options: ReplayOptions, settings: NavigatorSettingsFile | None
) -> tuple[ReplayOptions, NavigatorSettingsFile]:
    """Options and settings of the session, but for what the user asks for (settings not None).

    InputError where an option would have to change what was fed, or a GPS cut lies outside it.
    """
    if not log.fed:
        return options, settings or NavigatorSettingsFile()
    if options.flow_scale != (1.0, 1.0) or options.identified is not None:
        raise InputError(
            f"{log.path}: it holds flow as it was fed; replay it without {arg('flow_scale')}, {arg('sensor')}"
        )
    check_windows(log, options.gps_outages_s, arg("gps_outages"))
    try:
        for segment in log.fed:
            Equipment(**segment.equipment)
        filter_keys, noise = dict(log.fed_settings["filter"]), log.fed_settings.get("flow_noise")
        delay_s = float(log.fed_settings["gps_delay_s"])
        stated = FlowNoise(**{name: float(value) for name, value in noise.items()}) if noise else NO_STATED_NOISE
    except (KeyError, TypeError, ValueError, AttributeError) as error:
        raise InputError(f"{log.path}: it lacks the settings of its navigators ({error}); write it again") from error
    recorded = check(filter_keys, NavigatorSettingsFile, str(log.path))
    return replace(options, gps_delay_s=delay_s, flow_noise=stated), settings or recorded


def prepared_as_fed(log: Log) -> Prepared:
    """The streams as they were fed."""
    return Prepared(dict(log.streams), log.notes, bool(log.fed[0].equipment["flow_gyro_is_imu"]))


def segments_of(log: Log, options: ReplayOptions, settings: NavigatorSettingsFile) -> list[FedSegment]:
    """The input of each navigator of a log or record, and its equipment: as a replay does it, with nothing cut."""
    if log.fed:
        return list(log.fed)
    prepared = prepare(log, options)
    fitted = equipment_of(prepared.streams, prepared.span_s[0], prepared.flow_gyro_is_imu, settings, log.origin_deg_m)
    return [FedSegment(fitted._asdict(), prepared.queue)]


def run_as_fed(
    log: Log, options: ReplayOptions, settings: NavigatorSettingsFile, withhold: Callable[[EventQueue], EventQueue],
    instead: Instead | None = None,
) -> Written:  # fmt: skip
    """Each navigator of the session again; what they wrote, one after the other."""
    parts = []
    for segment in log.fed:
        queue = withhold(segment.queue)
        if len(queue.t_s):
            readings = {sensor: int(np.count_nonzero(queue.sensor == sensor)) for sensor in Sensor}
            tape = tape_for(readings, float(np.ptp(queue.t_s)))
            running = start_navigator(Equipment(**segment.equipment), settings, tape, options.flow_noise)
            run(queue, running, instead=None if instead is None else instead(running))
            parts.append(written_on(running.tape))
    return Written(*(np.concatenate(rows) for rows in zip(*parts, strict=True)))
