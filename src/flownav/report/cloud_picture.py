"""The picture of a campaign: where its flights first touched, over the pad and close up with its rings, in SVG."""

from html import escape
from typing import Any

import numpy as np

from flownav.core.measurement import Array
from flownav.report.campaign_figures import CIRCLES, Touchdowns
from flownav.report.landing import HIGH_PX, Picture, scale_bar, side_by_side, view
from flownav.report.panels import metres

VIEW_PX = 420
DOTS = 1500  # as many are drawn at most, evenly from all
BEYOND = 1.25  # of the largest ring is in sight close up


def cloud_picture(cell: dict[str, Any], touched: Touchdowns) -> Picture | None:
    """The picture of a cell's touchdowns; None where none is known."""
    known = np.isfinite(touched.north_m) & np.isfinite(touched.east_m)
    if not known.any():
        return None
    places = np.column_stack([touched.north_m[known], touched.east_m[known]])
    values = ((title, role, cell["figures"].get(name, {}).get("value")) for name, title, role in CIRCLES)
    rings = [(title, role, float(size)) for title, role, size in values if size]
    shown = places[:: int(np.ceil(len(places) / DOTS))]
    wide_m = max(0.5 * touched.pad_m, 1.05 * max((size for *_, size in rings), default=0.1))
    near_m = BEYOND * max((size for *_, size in rings), default=float(np.abs(places).max()) + 0.01)
    flights = f"{len(places)} flight{'s' * (len(places) > 1)}"
    pad = f"The pad of {touched.pad_m:g} m, and where {flights} first touched"
    views = [
        (view(0, VIEW_PX, pad, _above(shown, rings, touched.pad_m, wide_m, named=False)), VIEW_PX),
        (view(1, VIEW_PX, "Close up", _above(shown, rings, touched.pad_m, near_m, named=True)), VIEW_PX),
    ]
    ring_words = ", ".join(f"{title} {metres(size)} m" for title, _, size in rings)
    drawn = (
        f"rings about the pad's centre: {ring_words}" if rings else "too few touched for a ring that holds half of all"
    )
    few = any(title == "R95" for title, *_ in rings) or known.sum() >= 0.95 * len(known)
    drawn += "" if few else "; there is no R95, since fewer than 95 % of the flights touched without a crash"
    words = f"Where the flights of {cell['label']} first touched, north up; {drawn}."
    return Picture(side_by_side(views, words), words)


def _above(places: Array, rings: list[tuple[str, str, float]], pad_m: float, reach_m: float, *, named: bool) -> str:
    scale, x, y = 0.5 * (HIGH_PX - 56.0) / reach_m, 0.5 * VIEW_PX, 0.5 * (HIGH_PX + 8.0)
    half = 0.5 * pad_m * scale
    pad = f'<rect class="pad" x="{x - half:.1f}" y="{y - half:.1f}" width="{2 * half:.1f}" height="{2 * half:.1f}"/>'
    dots = "".join(
        f'<circle class="other" cx="{x + scale * e:.1f}" cy="{y - scale * n:.1f}" r="2.5"/>' for n, e in places
    )
    drawn = "".join(
        f'<circle class="ring" style="stroke:var(--{role})" cx="{x:.1f}" cy="{y:.1f}" r="{scale * size:.1f}"/>'
        for _, role, size in rings
    )
    key = "".join(
        f'<text class="key" style="fill:var(--{role})" x="{VIEW_PX - 4}" y="{38 + 15 * k}">'
        f"{escape(title)} {metres(size)} m</text>"
        for k, (title, role, size) in enumerate(rings)
    )
    centre = f'<path class="centre" d="M{x - 8:.1f} {y:.1f}h16M{x:.1f} {y - 8:.1f}v16"/>'
    return f"{pad}{dots}{drawn}{centre}{scale_bar(scale)}{key if named else ''}"
