"""Search the autopilot's gains anew and print them beside those of `control.design` (minutes).

python tools/shape_gains.py [VEHICLE]
"""

from __future__ import annotations

import sys
from pathlib import Path

from flownav.control.design import gains_for
from flownav.control.shaping import AXES, Shape, axis_of, drift_m, least_margins, shape_in, shaped
from flownav.core.errors import FlownavError
from flownav.vehicle.kinds import hover_of, load_vehicle


def main(path: Path | None) -> None:
    """Both axes: gains, drift and least margins, as designed and as found."""
    vehicle = load_vehicle(path)
    gains = gains_for(vehicle, hover_of(vehicle), 0.0)
    print(f"{'':16}" + "".join(f"{name:>24}" for name in Shape._fields) + "   drift, m   phase, deg   gain, dB")
    for name in AXES:
        axis = axis_of(name, path)
        for title, shape in (("designed", shape_in(gains, name)), ("found", shaped(name, gains, path)[0])):
            phase, gain = least_margins(shape, axis)
            figures = "".join(f"{value:24.4f}" for value in shape)
            print(f"{name:8}{title:8}{figures}{drift_m(shape, axis):11.4f}{phase:13.1f}{gain:11.1f}", flush=True)


if __name__ == "__main__":
    try:
        main(Path(sys.argv[1]) if len(sys.argv) > 1 else None)
    except FlownavError as error:
        sys.exit(f"flownav: {error}")
