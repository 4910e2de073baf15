"""`flownav live`: a MAVLink vehicle in real time through the filter, its estimate sent back."""

from __future__ import annotations

import os
import sys
import time
from collections.abc import Callable, Iterator
from contextlib import closing, contextmanager, suppress
from dataclasses import replace
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any

from flownav.cli import live_help, options
from flownav.cli.options import chosen, named, one_of, option, switch
from flownav.cli.output import answer, require_between, require_place, require_recordable, say, say_files
from flownav.core.errors import InputError, VerdictError

if TYPE_CHECKING:
    from flownav.live.loop import Latency
    from flownav.live.options import Options
    from flownav.live.recorder import Recorder
    from flownav.live.session import Session
    from flownav.live.status import Status as State


URL = "udp:PORT, udpout:HOST:PORT, tcp:HOST:PORT, tcpin:PORT or serial:DEVICE[:BAUD]."
SEND = "As which message the estimate is sent."
RECORD = "The record; `flownav replay` reproduces it."
NUMBERS = (1, 255)  # of a MAVLink system, and of a component
SYSTEM, COMPONENT = "Listen to this system only.", "Listen to this component only."
LIMIT = "Send no longer than this without a horizontal aid (dead reckoning) [s]."
SIGMA = "Send while one standard deviation of the position is below this [m]."
PROTECTION = "Send while the horizontal protection level is below this [m]."
UNFUSED = "Send nothing once a horizontal sensor is received but not fused for this long [s]."
ACCEPT = "Who else may send a message, 0 for any; may be repeated."
STATUS = "A JSON file with the session's state, replaced twice a second and removed at the end."
DURATION = "End after this time."
CARRIES = "The link's capacity each way."
BAUD = "a serial port's by its baud rate"
SETUP = "Only read the vehicle's parameters, and say what must change for --send."
WRITE = "With --setup: write what must change, never while armed."
ORIGIN = "With --setup: where the EKF's frame begins, for a vehicle without GPS [deg, deg, m]."
SOURCES = "With --setup: ArduPilot's source set for flownav."
Url = Annotated[str, named("URL", URL, autocompletion=one_of(*options.LINKS)["autocompletion"])]
Record = Annotated[Path | None, option("PATH", RECORD, "--out", "--record", unset="none is written")]
Status = Annotated[Path | None, option("PATH", STATUS, unset="none is written")]
System = Annotated[int | None, option("N", SYSTEM, unset="the first autopilot's", within=NUMBERS)]
Component = Annotated[int | None, option("N", COMPONENT, unset="the autopilot's", within=NUMBERS)]
Accept = Annotated[list[str] | None, option("MESSAGE=SYSTEM.COMPONENT", ACCEPT)]
Duration = Annotated[float | None, option("S", DURATION, unset="at Ctrl-C", within=(0.1, 1e6))]
Capacity = Annotated[float | None, option("BYTES/S", CARRIES, unset=BAUD, within=(500.0, 1e9))]
Origin = Annotated[str | None, option("LAT,LON,ALT", ORIGIN, unset="none is set")]
SHOWN = live_help.SHOWN
SourceSet = Annotated[int | None, option("1..3", SOURCES, unset="a free one", within=(1, 3))]


def command(
    url: Url,
    sensor: options.Sensor = None,
    send: Annotated[str, chosen(SEND, *options.SENDINGS)] = "odometry",
    record: Record = None,
    force: options.Force = False,
    signing_key: options.SigningKey = None,
    system: System = None,
    component: Component = None,
    gps_delay: options.GpsDelay = 0.22,
    settings: options.Settings = None,
    send_limit: Annotated[float, option("S", LIMIT, within=(0.1, 60.0))] = 1.5,
    send_sigma: Annotated[float, option("M", SIGMA, within=(0.01, 1000.0))] = 5.0,
    send_protection: Annotated[float, option("M", PROTECTION, within=(0.01, 1000.0))] = 20.0,
    unfused: Annotated[float, option("S", UNFUSED, within=(1.0, float("inf")))] = 5.0,
    accept: Accept = None,
    status: Status = None,
    duration: Duration = None,
    capacity: Capacity = None,
    setup: Annotated[bool, switch(SETUP, "--setup")] = False,
    write: Annotated[bool, switch(WRITE, "--write")] = False,
    source_set: SourceSet = None,
    origin: Origin = None,
    as_json: options.Json = False,
) -> None:
    """Navigate a vehicle that is connected by MAVLink: fuse its sensors, send the estimate, show and record it."""
    from flownav.cli.live_setup import run as run_setup
    from flownav.live.link import parse_url
    from flownav.live.options import Limits
    from flownav.live.reception import accepted_by
    from flownav.live.status import status_place
    from flownav.logs.mavlink.signing import load_key

    require_between("--gps-delay", gps_delay, 0.0, 1.0)
    if setup and (record is not None or status is not None):
        raise InputError(f"{'--out' if record else '--status'}: --setup flies nothing; leave one of the two away")
    if setup:
        key = load_key(signing_key) if signing_key else None
        return run_setup(
            url, send, write=write, source_set=source_set, system=system, component=component, key=key, origin=origin,
            as_json=as_json,
        )  # fmt: skip
    if write or source_set is not None or origin is not None:
        raise InputError("--write, --source-set and --origin go with --setup only")
    if record is not None:
        require_recordable(record, sensor, signing_key, settings, force=force)
    if status is not None:
        status = status_place(status)
        require_place(status)
    given = replace(
        _options(send, system, component, signing_key, gps_delay, sensor, settings),
        limits=Limits(dead_reckoning_s=send_limit, sigma_m=send_sigma, protection_m=send_protection, unfused_s=unfused),
        accept=accepted_by(accept or []),
        capacity_bytes_s=capacity or parse_url(url).capacity_bytes_s,
    )
    _navigate(url, given, record, status, duration, force=force, as_json=as_json)


def _navigate(
    url: str, options: Options, record: Path | None, status: Path | None, duration_s: float | None, *, force: bool,
    as_json: bool,
) -> None:  # fmt: skip
    """Run until stopped; print the summary. VerdictError where no vehicle was received or no record was kept."""
    from flownav.live.byte_links import open_link
    from flownav.live.display import on_terminal
    from flownav.live.filtering import Keeper
    from flownav.live.loop import Latency, run_as_others, run_before_others, run_session, stoppable, warm_up
    from flownav.live.recorder import facts_every_second
    from flownav.live.screen import Screen, traffic_facts
    from flownav.live.session import Session
    from flownav.live.status import Status as State

    warm_up()
    shown = not as_json and sys.stdout.isatty()
    with closing(open_link(url)) as link, _recording(url, record, options, force=force, shown=shown) as recorder:
        link.capacity_bytes_s = options.capacity_bytes_s
        scheduling = run_before_others()
        now_s, latency = time.monotonic(), Latency()
        session = Session(options, recorder or Keeper(), now_s, time.time())
        end_s = float("inf") if duration_s is None else now_s + duration_s

        def facts_now() -> dict[str, Any]:
            lasted_s = time.monotonic() - now_s
            own = _facts(session, latency, lasted_s) | {"traffic": traffic_facts(link, session, lasted_s)}
            return own | {"link": dict(link.counts), "scheduling": scheduling}

        def screen() -> Screen:
            return Screen(session, latency, url, recorder, scheduling, link)

        def state() -> State:
            return State(session, screen(), url, recorder.path if recorder else None, now_s)

        with stoppable() as asked:
            with on_terminal(screen().view, shown=shown) as display, _status_file(status, state) as shows:
                shows += [display.show, *([facts_every_second(recorder, facts_now)] if recorder is not None else [])]
                run_session(session, link, latency, lambda: asked() or time.monotonic() >= end_s, shows)
            run_as_others()
            facts = facts_now()
            received = session.reception.vehicle is not None
            finished = recorder.finish(facts, received=received) if recorder is not None else None
    if finished is not None:
        facts |= finished.facts()
    if not display.stuck:
        _say(facts, as_json=as_json)
    if not received:
        raise VerdictError(_nobody(url, facts))
    if finished is not None and finished.reason:
        raise VerdictError(finished.verdict())


def _nobody(url: str, facts: dict[str, Any]) -> str:
    """Why there was no vehicle to navigate."""
    others = [f"{system}.{component}" for system, component in facts["other_autopilots"]]
    if others:
        senders = ", ".join(others)
        return f"{url}: only autopilots that were not asked for were received ({senders}); see --system, --component"
    return f"{url}: no autopilot was received in {facts['duration_s']:.1f} s; see that it sends there"


@contextmanager
def _recording(url: str, path: Path | None, options: Options, *, force: bool, shown: bool) -> Iterator[Recorder | None]:
    """The recorder, where a record is asked for; when the session breaks off, its journal stays and is named."""
    from flownav.live.recorder import Recorder

    recorder = Recorder(path, options, force=force, failed=_say_once(shown)) if path is not None else None
    if recorder is not None and recorder.notice:
        print(f"flownav: {recorder.notice}", file=sys.stderr)
    try:
        yield recorder
    except BaseException as error:
        if recorder is not None:
            recorder.leave()
            how = f"{recorder.journal} holds the session; `flownav recover {recorder.journal}`"
            print(f"flownav: {how}", file=sys.stderr)
        if isinstance(error, KeyboardInterrupt):
            raise VerdictError(f"{url}: broken off") from error
        raise


@contextmanager
def _status_file(path: Path | None, state: Callable[[], State]) -> Iterator[list[Callable[[float], None]]]:
    """The functions that the loop calls to have the status written; none where none is asked for."""
    from flownav.live.status import StatusFile

    if path is None:
        yield []
        return

    def failed(reason: str) -> None:
        with suppress(OSError):
            print(f"flownav: {path}: cannot be written ({reason}); the session goes on", file=sys.stderr, flush=True)

    with closing(StatusFile(path, state().look, failed)) as file:
        yield [file.show]


def _options(
    send: Any, system: int | None, component: int | None, key: Path | None, gps_delay_s: float, sensor: Path | None,
    settings: Path | None,
) -> Options:  # fmt: skip
    from flownav.core.parameter_files import load
    from flownav.live.options import Options
    from flownav.logs.mavlink.signing import load_key
    from flownav.navigation.settings import NavigatorSettingsFile
    from flownav.navigation.settings_of import settings_of
    from flownav.sensors.datasheet import identified_flow, load_sensor

    flow = load_sensor(sensor) if sensor else None
    given = settings_of(flow, stated=load(settings, NavigatorSettingsFile) if settings else None)
    return Options(
        send=send,
        system=system,
        component=component,
        key=load_key(key) if key else None,
        gps_delay_s=gps_delay_s,
        identified=identified_flow(flow, given.lag_states) if flow else None,
        settings=given.settings,
        flow_noise=given.noise,
    )


def _say_once(shown: bool) -> Callable[[str], None]:
    """A function that reports once that a recording stopped, where no screen shows it; from the thread that writes."""

    def say(reason: str) -> None:
        if not shown:
            with suppress(OSError):
                print(f"flownav: not recording any more: {reason}; the session goes on", file=sys.stderr, flush=True)

    return say


def _say(facts: dict[str, Any], *, as_json: bool) -> None:
    """The figures of the session; nothing where nobody is there to read them any more."""
    try:
        answer(facts, as_json, lambda: _show(facts))
        sys.stdout.flush()
    except OSError:
        os.dup2(os.open(os.devnull, os.O_WRONLY), sys.stdout.fileno())


def _facts(session: Session, latency: Latency, duration_s: float) -> dict[str, Any]:
    vehicle = session.reception.vehicle
    best = session.clock.best(time.monotonic()) if session.clock else None
    return {
        "duration_s": duration_s,
        "vehicle": vehicle._asdict() if vehicle else None,
        "other_autopilots": session.reception.others,
        "sent": session.sent,
        "withheld": dict(session.withheld),
        "readings": {sensor.name.lower(): count for sensor, count in sorted(session.intake.readings.items())},
        "sources": session.intake.sources.names(),
        "dropped": session.dropped,
        "resets": session.resets,
        "alarms": {
            sensor.name.lower(): {
                "unfused_s": spell.until_s - spell.since_s,
                "reason": spell.why,
                "now": sensor in session.alarms,
            }
            for sensor, spell in sorted(session.offering.past_alarms.items())
        },
        "horizon_s": session.intake.horizon_s,
        "lags_s": {sensor.name.lower(): lag_s for sensor, lag_s in sorted(session.intake.lags.by_sensor.items())},
        "origin": session.intake.origin.as_facts(),
        "requests": dict(session.requests.answers),
        "refused": session.requests.refused,
        "timesync_round_trip_ms": 1e3 * best.round_trip_s if best else None,
        "latency_ms": {
            name: 1e3 * latency.quantile_s(share) if latency.counts.any() else None
            for name, share in (("p50", 0.5), ("p90", 0.9), ("p99", 0.99), ("max", 1.0))
        },
    }


def _show(facts: dict[str, Any]) -> None:
    """Print the figures for people."""
    from flownav.live.answers import WITHHELD
    from flownav.live.screen import in_words

    vehicle = facts["vehicle"]
    who = f"system {vehicle['system']}, component {vehicle['component']}" if vehicle else "no vehicle was received"
    say(
        f"{facts['duration_s']:.1f} s, {who}; {facts['sent']} estimates sent, {facts['resets']} resets",
        *(
            f"ALARM: {name} was received and not fused for {alarm['unfused_s']:.0f} s ({alarm['reason']})"
            for name, alarm in facts["alarms"].items()
        ),
        *(f"Withheld {count}: {WITHHELD[reason]}" for reason, count in facts["withheld"].items()),
        *(f"Dropped {count}: {name}" for name, count in facts["dropped"].items()),
        in_words(facts["traffic"]),
    )
    if facts["latency_ms"]["p50"] is not None:
        figures = ", ".join(f"{name} {value:.2f} ms" for name, value in facts["latency_ms"].items())
        say(f"From a flow reading's arrival to the estimate's departure: {figures}")
    say_files(facts, ("record",))
