"""Both ends against each other, and the record: it is complete, and a replay of it gives the same bits."""

from __future__ import annotations

import gc
import json
import signal
import threading
import time
import tracemalloc
from io import StringIO

import numpy as np
import pymap3d
import pytest

from command import printed
from command import run as typed
from flownav.campaigns.faults.table import log_of
from flownav.campaigns.local import fly_recorded
from flownav.core.errors import InputError
from flownav.core.measurement import Sensor
from flownav.core.record import Record
from flownav.live.byte_links import open_link
from flownav.live.display import draw
from flownav.live.filtering import Keeper
from flownav.live.loop import Latency, run_session, run_vehicle, warm_up
from flownav.live.options import Options
from flownav.live.recorder import Recorder
from flownav.live.screen import Screen
from flownav.live.session import Session
from flownav.live.simulated import BOOT_S, ORIGIN_DEG_M, SimulatedVehicle
from flownav.logs.mavlink.framing import coder
from flownav.logs.open_log import open_flight
from flownav.navigation.tables import estimate_table, innovation_table, states_table
from flownav.replays.fed import as_fed
from flownav.replays.prepare import ReplayOptions
from flownav.replays.session import replay
from flownav.sensors.datasheet import IdentifiedFlow
from flownav.simulation.assemble import assemble
from flownav.simulation.scenario import load_scenario
from live_ends import Hover, Wire
from live_process import LiveProcess
from virtual_link import UNIX_S, Clock, VirtualLink, link_to

SPEED = 4.0
STRETCH_S, MOST_KEPT_BYTES = 2.0, 3600.0  # 452 messages: a float kept of each is 10 848 bytes; clean, up to 1000


def replayed(path):
    log = open_flight(path)
    return replay(log, *as_fed(log, ReplayOptions(), None))


def assert_same_bits(path):
    record, again = Record.load(path), replayed(path)
    for name, table in (
        ("estimate", estimate_table(again.estimate)),
        ("states", states_table(again.estimate)),
        ("innovation", innovation_table(again.innovation)),
    ):
        assert set(table) == set(record.tables[name])
        for column, values in table.items():
            recorded = record.tables[name][column]
            same = np.array_equal(values, recorded, equal_nan=values.dtype.kind == "f")
            assert same, f"{name}.{column}"
    return record


@pytest.fixture(scope="module")
def simulated():
    """The flight of pad_return as a log, and the session's options."""
    warm_up()
    setup = assemble(load_scenario("pad_return"))
    told, ages_s = setup.fitted.given, setup.fitted.ages_s
    options = Options(
        gps_delay_s=float(ages_s[Sensor.GPS_POSITION]),
        identified=IdentifiedFlow(1.0, 1.0, float(ages_s[Sensor.FLOW_RATE])),
        settings=told.settings,
        flow_noise=told.noise,
    )
    return log_of(fly_recorded(setup, 1), setup), options


@pytest.fixture(scope="module")
def flight(simulated, tmp_path_factory):
    """pad_return and a session at two ends of a link, on a virtual clock."""
    log, options = simulated
    path = tmp_path_factory.mktemp("live") / "flight.fnr"
    vehicle, clock, recorder = SimulatedVehicle(log), Clock(), Recorder(path, options)
    link, session, latency = link_to(vehicle, clock), Session(options, recorder, 0.0, UNIX_S), Latency()
    run_session(session, link, latency, lambda: vehicle.finished, clock=clock)
    link.close()
    recorder.finish({})
    return vehicle, session, latency, path


def estimates_of(vehicle):
    return [message for _, message in list(vehicle.received) if message.msgname == "ODOMETRY"]


def _tell(vehicle, url, ended):
    link = open_link(url)
    try:
        run_vehicle(vehicle, link, 1.0, lambda: len(estimates_of(vehicle)) > 200)
    finally:
        link.close()
        ended.set()


@pytest.mark.real_time
def test_a_flight_told_over_loopback_is_followed(simulated, tmp_path):
    """Both loops with sockets, threads and the machine's clock; the record's replay is the same bits here, too."""
    log, options = simulated
    vehicle, path = SimulatedVehicle(log), tmp_path / "flight.fnr"
    link, recorder = open_link("udp:0"), Recorder(path, options)
    session = Session(options, recorder, time.monotonic(), time.time())
    latency, ended = Latency(), threading.Event()
    telling = threading.Thread(target=_tell, args=(vehicle, f"udpout:127.0.0.1:{link.port}", ended))
    telling.start()
    run_session(session, link, latency, ended.is_set)
    telling.join()
    link.close()
    recorder.finish({})
    assert len(estimates_of(vehicle)) > 20  # of 200, on a machine that has time
    assert vehicle.counts["TIMESYNC"] >= 1
    assert latency.counts.sum() > 0
    assert_same_bits(path)


def test_a_vehicle_is_told_at_a_multiple_of_its_pace(simulated):
    """Its loop: what is due by then goes out, and received messages are answered."""
    vehicle, clock, sent = SimulatedVehicle(simulated[0]), Clock(), []
    asked = bytes(coder(1, 197).timesync_encode(0, 77).pack(coder(1, 197)))
    link = VirtualLink(clock, lambda now_s: [asked] if not sent else [])
    link.write = lambda frame: sent.append((SPEED * clock.now_s, coder().decode(bytearray(frame))))
    reached_s = run_vehicle(vehicle, link, SPEED, lambda: clock.now_s > 2.0, clock)
    link.close()
    assert reached_s == pytest.approx(2.0 * SPEED, abs=0.02)
    told = [(t_s, message) for t_s, message in sent if message.msgname == "HIGHRES_IMU"]
    assert told[-1][0] == pytest.approx(reached_s, abs=0.02)
    assert all(t_s - 0.02 < message.time_usec * 1e-6 - BOOT_S <= t_s for t_s, message in told)
    (answer,) = [message for _, message in sent if message.msgname == "TIMESYNC"]
    assert (answer.ts1, answer.tc1 > BOOT_S * 1e9) == (77, True)


def test_the_estimate_that_comes_back_follows_the_truth(flight):
    """Horizontal speed within 0.5 m/s, path within 2 m, beside the constant error of the first fix (the origin)."""
    vehicle, session, _, _ = flight
    told = estimates_of(vehicle)
    assert len(told) > 500
    origin = np.array(pymap3d.geodetic2ned(*session.origin_deg_m, *ORIGIN_DEG_M))
    errors = []
    for message in told:
        position, velocity = vehicle.truth_at(message.time_usec * 1e-6 - BOOT_S)
        w, x, y, z = message.q
        speed = np.hypot(message.vx, message.vy) - np.hypot(*velocity[:2])
        errors.append([message.x + origin[0], message.y + origin[1], message.z + origin[2], speed])
        errors[-1][:3] -= position
        assert abs(w * w + x * x + y * y + z * z - 1.0) < 1e-5
    away = np.array(errors)
    path = np.abs(away[:, :3] - np.median(away[:, :3], axis=0)).max(axis=0)
    assert session.dropped.get("link: lost", 0) < 100
    assert path.max() < 2.0, path
    assert np.abs(away[:, 3]).max() < 0.5
    assert len({message.reset_counter for message in told}) == 1


def test_the_simulated_vehicle_answers_what_it_is_asked(flight):
    vehicle, session, _, _ = flight
    assert session.requests.answers["accepted"] == 5 + 1 + 1  # streams, the state of the ground, the truth
    assert set(session.requests.refused) == {
        *("SCALED_IMU", "SCALED_IMU2", "SCALED_IMU3", "OPTICAL_FLOW", "SCALED_PRESSURE", "SYSTEM_TIME"),
        *("HIL_STATE_QUATERNION", "GPS_GLOBAL_ORIGIN"),
    }
    assert vehicle.counts["HEARTBEAT"] >= 4
    assert vehicle.counts["TIMESYNC"] >= 4


def test_the_latency_was_measured_for_every_estimate_that_flow_brought(flight):
    _, session, latency, _ = flight
    assert 0 < latency.counts.sum() <= session.sent
    assert 0.0 < latency.quantile_s(0.5) <= latency.longest_s < 0.001


def test_a_replay_of_the_record_is_the_same_bits(flight):
    record = assert_same_bits(flight[3])
    assert {"fed", "truth", "imu", "flow_rate", "gps_position", "range"} <= set(record.tables)
    assert record.manifest["kind"] == "live"
    assert replayed(flight[3]).scores()["truth"]["velocity_rms_m_s"] < 0.3


def test_the_screen_shows_rates_ages_and_the_estimate(flight):
    from rich.console import Console

    _, session, latency, _ = flight
    screen, console = Screen(session, latency, "udp:1"), Console(width=160, record=True, file=StringIO(), markup=False)
    for now_s in (0.0, 1.0):
        console.print(draw(screen.view(now_s)))
    text = console.export_text()
    for word in ("flow_rate", "range", "position [m]", "±", "sent", "latency", "dropped"):
        assert word in text


def test_a_restart_in_the_record_is_replayed_too(tmp_path):
    path = tmp_path / "restart.fnr"
    recorder = Recorder(path, options := Options())
    wire = Wire(Hover(), options, recorder)
    wire.fly(4.0)
    wire.vehicle.boot_s = 1.0 - wire.t_s  # it reboots
    wire.fly(4.0)
    wire.close()
    recorder.finish({})
    record = assert_same_bits(path)
    assert len(record.manifest["segments"]) == 2
    assert "restart" in record.tables["events"]["kind"]
    assert not list(tmp_path.glob(".*"))


def test_options_that_would_change_what_was_fed_are_refused(flight):
    log = open_flight(flight[3])
    with pytest.raises(InputError, match="without flow_scale"):
        as_fed(log, ReplayOptions(flow_scale=(2.0, 1.0)), None)
    with pytest.raises(InputError, match="of one flow sensor"):
        open_flight(flight[3], flow_instance=1)
    cut = replay(log, *as_fed(log, ReplayOptions(gps_outages_s=((BOOT_S + 20.0, BOOT_S + 30.0),)), None))
    assert cut.rejected()["gps_position"]["outage"] > 0


def test_a_record_of_another_kind_is_refused(tmp_path):
    path = tmp_path / "x.fnr"
    record = Record({"kind": "fly"})
    record.add("truth", {"t_s": [0.0]})
    record.save(path)
    with pytest.raises(InputError, match="of kind 'fly'"):
        open_flight(path)


def test_memory_does_not_grow_with_the_session():
    """The least that any stretch adds: what is kept of each message is in all of them, what is made once is not."""
    tracemalloc.start()  # before the session begins, so that what it replaces is counted as it goes
    wire = Wire(Hover(), Options(), Keeper())

    def held_bytes(seconds):
        wire.fly(seconds)
        for kept in (wire.heard, wire.frames, wire.heard_s):
            kept.clear()
        gc.collect()
        return tracemalloc.get_traced_memory()[0]

    held = [held_bytes(4.0)] + [held_bytes(STRETCH_S) for _ in range(6)]
    tracemalloc.stop()
    wire.close()
    assert np.diff(held).min() < MOST_KEPT_BYTES


@pytest.mark.real_time
def test_ctrl_c_leaves_a_complete_record(tmp_path):
    path = tmp_path / "live.fnr"
    with LiveProcess(path, "--json") as live:
        output, errors = live.fly(30).end(signal.SIGINT)
    assert live.process.returncode == 0, errors
    facts = json.loads(output)
    assert facts["sent"] >= 30
    assert facts["record"] == str(path)
    assert facts["traffic"]["received_bytes_s"] > 0.0
    assert facts["traffic"]["written_bytes_s"] > 0.0
    assert facts["traffic"]["capacity_bytes_s"] is None
    assert_same_bits(path)


@pytest.mark.parametrize(
    ("options", "said"),
    [
        (["nowhere"], "no link"),
        (["udp:0", "--send", "everything"], "--send everything: choose from odometry, vision, landing-target, none"),
        (["udp:0", "--system", "0"], "--system 0: must be from 1 to 255"),
        (["udp:0", "--duration", "0"], "--duration 0.0: must be from 0.1"),
        (["udp:0", "--capacity", "10"], "--capacity 10.0: must be from 500.0"),
        (["udp:0", "--gps-delay", "2"], "--gps-delay 2.0: must be from 0.0 to 1.0"),
        (["udp:0", "--signing-key", "no.key"], "no.key: cannot be read"),
    ],
)
def test_mistakes_are_one_line(options, said):
    from typer.testing import CliRunner

    from flownav.cli import app

    result = CliRunner().invoke(app, ["live", *options])
    assert isinstance(result.exception, InputError)
    assert said in printed(result.exception)


class LateGps(Hover):
    """GPS stamps that are 1.5 s old when they come."""

    def frames(self, t_s):
        now_s, self.boot_s = self.boot_s, self.boot_s - 1.5
        gps = [frame for frame in super().frames(t_s) if frame[7] | frame[8] << 8 == 24]
        self.steps, self.boot_s = self.steps - 1, now_s
        return [*(frame for frame in super().frames(t_s) if frame[7] | frame[8] << 8 != 24), *gps]


def test_a_sensor_that_was_heard_and_hardly_fused_is_a_bad_verdict_of_the_replay(tmp_path):
    path = tmp_path / "late.fnr"
    options = Options()
    recorder = Recorder(path, options)
    wire = Wire(LateGps(), options, recorder).fly(25.0)
    wire.close()
    assert wire.session.reason == "unfused"
    facts = {"dropped": wire.session.dropped}
    recorder.finish(facts)
    run = replayed(path)
    said = [finding.text for finding in run.findings if finding.unfused]
    assert len(said) == 2
    assert said[0].startswith("gps_position was received and hardly fused (")
    result = typed("replay", path, "--out", tmp_path / "again.fnr", "--report")
    assert result.returncode == 1
    assert "hardly fused" in result.stderr
    assert_same_bits(path)
