"""Replaying what a live filter was fed: the same rows in the same order, so that the estimates are the same bits."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import replace

import numpy as np

from flownav.errors import InputError
from flownav.logs.log import Log
from flownav.measurement import EventQueue
from flownav.navigation.feed import Equipment, start_navigator
from flownav.navigation.loop import run
from flownav.navigation.settings import NavigatorSettingsFile
from flownav.navigation.state import Tape, new_tape
from flownav.parameter_files import check
from flownav.replay.prepare import Prepared, ReplayOptions, check_windows


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
            f"{log.path}: a live record holds flow as it was fed; replay it without --flow-scale, --sensor"
        )
    check_windows(log, options.gps_outages_s, "--gps-outage")
    recorded = check(dict(log.fed_settings["filter"]), NavigatorSettingsFile, str(log.path))
    return replace(options, gps_delay_s=float(log.fed_settings["gps_delay_s"])), settings or recorded


def prepared_as_fed(log: Log) -> Prepared:
    """The queue of all navigators, one after the other."""
    parts = [segment.queue for segment in log.fed]
    whole = EventQueue(*(np.concatenate(columns) for columns in zip(*parts, strict=True)))
    return Prepared(dict(log.streams), whole, log.notes, bool(log.fed[0].equipment["flow_gyro_is_imu"]))


def run_as_fed(log: Log, settings: NavigatorSettingsFile, withhold: Callable[[EventQueue], EventQueue]) -> Tape:
    """Each navigator of the session again; their tapes one after the other."""
    tapes = []
    for segment in log.fed:
        queue = withhold(segment.queue)
        if len(queue.t_s):
            running = start_navigator(Equipment(**segment.equipment), settings, new_tape(queue))
            run(queue, running)
            tapes.append(running.tape)
    used = np.array([tape.used for tape in tapes])
    estimate, innovation, event = (
        np.concatenate([tape[part][: tape.used[part]] for tape in tapes]) for part in range(3)
    )
    return Tape(estimate, innovation, event, used.sum(axis=0))
