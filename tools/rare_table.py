"""Rare events of the paper's landing, by subset simulation beside flights at random. `make rare`.

python tools/rare_table.py [FLIGHTS] flies this number at random first (100000 if not given; 0: none, for the time
alone).
"""

from __future__ import annotations

import sys
import time

from flownav.campaigns.measures import event_of, happened
from flownav.campaigns.plan import changed
from flownav.campaigns.rare.branches import Array, Space
from flownav.campaigns.rare.estimate import estimate_rare
from flownav.simulation.assemble import Setup, assemble
from flownav.simulation.scenario import load_scenario

WHITE, DRIFTING = "white", "midg"  # the GPS of the paper, and a real one
EVENTS = (
    (WHITE, "estimate.axis_m > 0.35"),
    (WHITE, "touchdown.horizontal_m > 0.1"),
    (WHITE, "estimate.axis_m > 0.38"),
    (WHITE, "estimate.axis_m > 0.44"),
    (DRIFTING, "estimate.axis_m > 9.7"),
    (DRIFTING, "estimate.axis_m > 11.1"),
    (DRIFTING, "estimate.axis_m > 13.6"),
)
AT_RANDOM, SEED, RARE_SEED = 100_000, 1, 11


def main(flights: int) -> None:
    """Fly and print, a row an event."""
    from scipy.stats import binomtest

    print(
        f"| GPS | event | {flights} flights at random | 95 % | by levels | 95 % | cv | flights | time | processors' |"
    )
    print("|---|---|---|---|---|---|---|---|---|---|")
    known: dict[str, tuple[Setup, Array | None]] = {}
    for gps, text in EVENTS:
        if gps not in known:
            setup = assemble(changed(load_scenario("landing"), {"filter.name": "paper", "gps.model": gps}))
            known[gps] = setup, Space(setup, SEED, dispersed=False).usual(flights) if flights else None
        setup, rows = known[gps]
        event, direct = event_of(text), "- | -"
        if rows is not None:
            interval = binomtest(int(happened(event, rows).sum()), flights).proportion_ci(0.95)
            direct = f"{happened(event, rows).mean():.2e} | {interval.low:.1e} to {interval.high:.1e}"
        began_s, used_s = time.monotonic(), time.process_time()
        found = estimate_rare(setup, event, seed=RARE_SEED, dispersed=False)
        wall_s, own_s = time.monotonic() - began_s, time.process_time() - used_s
        print(
            f"| {gps} | `{text}` | {direct} | {found.probability:.2e} | {found.low:.1e} to {found.high:.1e} | "
            f"{found.cv or float('nan'):.2f} | {found.flights} | {wall_s:.0f} s | {own_s:.0f} s |",
            flush=True,
        )


if __name__ == "__main__":
    main(int(sys.argv[1]) if len(sys.argv) > 1 else AT_RANDOM)
