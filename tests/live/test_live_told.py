"""What the screen says of readings: a component that a sensor does not have is no fault of it."""

from __future__ import annotations

from io import StringIO

from rich.console import Console

from flownav.estimation.gating import Reason
from flownav.live.display import draw
from flownav.live.loop import Latency
from flownav.live.screen import Screen
from flownav.measurement import Sensor
from live_ends import Hover, Wire


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
