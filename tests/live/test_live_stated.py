"""The screen's words on readings: a component that a sensor does not have is no fault of it."""

from __future__ import annotations

import math
import re
from io import StringIO
from pathlib import Path

import pytest
from rich.console import Console

from flownav.core.measurement import Sensor
from flownav.estimation.gating import Reason
from flownav.live.answers import WITHHELD
from flownav.live.display import draw
from flownav.live.loop import Latency
from flownav.live.options import Options
from flownav.live.screen import Screen
from flownav.logs.mavlink.framing import coder
from live_ends import HEIGHT_M, Hover, Wire


def shown(wire):
    console = Console(width=200, file=StringIO(), record=True)
    console.print(draw(Screen(wire.session, Latency(), "udp:1").view(wire.now_s)))
    return console.export_text()


def test_gps_without_vertical_velocity_is_not_shown_as_not_finite():
    wire = Wire(Hover())
    try:
        wire.fly(6.0)
        session = wire.session
        assert session.innovations[int(Sensor.GPS_VELOCITY), 2][2] == Reason.NOT_FINITE  # which is so, and no fault
        assert "gps_velocity" in shown(wire)
        assert "not_finite" not in shown(wire)
        session.innovations[int(Sensor.GPS_VELOCITY), 0] = (float("nan"), float("nan"), int(Reason.NOT_FINITE))
        assert "not_finite" in shown(wire)  # one that must be there
    finally:
        wire.close()


class Px4(Hover):
    """The same, of PX4's make."""

    def frames(self, t_s):
        made = super().frames(t_s)
        beat = self.mav.heartbeat_encode(4, 12, 128, 0, 4, 3)
        return [bytes(beat.pack(self.mav)), *made[1:]] if self.steps % 100 == 1 else made


@pytest.mark.parametrize(("vehicle", "frame"), [(Hover(), 12), (Px4(), 1)])
def test_the_pad_is_told_in_the_frame_that_the_autopilot_takes(vehicle, frame):
    """ArduPilot takes BODY_FRD, PX4 LOCAL_NED: it refuses a valid position in any other."""
    wire = Wire(vehicle, Options(send="landing-target"))
    mav = coder(1, 191)

    def see():
        time_us = round((wire.vehicle.boot_s + wire.t_s) * 1e6)
        message = mav.landing_target_encode(time_us, 0, 12, 0.1, -0.2, HEIGHT_M, 0, 0)
        wire.socket.send(bytes(message.pack(mav)))

    try:
        wire.fly(4.0)
        wire.fly(3.0, beside=see)
        last = [message for message in wire.heard if message.msgname == "LANDING_TARGET"][-1]
        own = wire.session.estimate
        assert last.frame == frame
        assert last.position_valid == 1
        seen = HEIGHT_M / math.sqrt(1.0 + math.tan(0.2) ** 2 + math.tan(0.1) ** 2)  # down
        body = (math.tan(0.2) * seen, math.tan(0.1) * seen, seen)
        expected = body if frame == 12 else tuple(a + b for a, b in zip(body, own.pos_ned_m, strict=True))
        assert (last.x, last.y, last.z) == pytest.approx(expected, abs=0.2)  # it hovers level, looking north
    finally:
        wire.close()


PAGES = Path(__file__).resolve().parents[2] / "docs"


def test_the_page_has_each_reason_to_withhold_and_what_to_do():
    table = (PAGES / "how-to" / "live.md").read_text(encoding="utf-8").partition("## When nothing is sent")[2]
    rows = [line.strip("|").split("|") for line in table.splitlines() if line.startswith("| `")]
    cures = {reason: cure.strip() for names, _, cure in rows for reason in re.findall(r"`(\w+)`", names)}
    assert set(cures) == set(WITHHELD)
    assert all(cures.values())


def test_no_row_of_a_table_is_broken():
    broken = [
        f"{page.relative_to(PAGES)}: {line[:60]}"
        for page in PAGES.rglob("*.md")
        for line in page.read_text(encoding="utf-8").splitlines()
        if line.startswith("| ") and not line.rstrip().endswith("|")
    ]
    assert broken == []
