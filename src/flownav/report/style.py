"""Colours, fonts and the common layout: one look for the page and all its figures, on light and on dark.

Each colour has a light and a dark value. Figures are built with the light ones; the page's script swaps
them where the reader's system asks for dark, so a role (truth, estimate, ...) has one colour everywhere.
"""

from __future__ import annotations

from typing import Any

# role: (on light, on dark)
PALETTE: dict[str, tuple[str, str]] = {
    "page": ("#f6f7f9", "#14181d"),
    "surface": ("#ffffff", "#1b2027"),
    "ink": ("#1d232a", "#e7eaee"),
    "muted": ("#57616c", "#a3adb8"),
    "rule": ("#dfe3e8", "#323a44"),
    "grid": ("#e9ecef", "#2a313a"),
    "truth": ("#16191d", "#f5f6f7"),
    "estimate": ("#0a5fb4", "#62b3ff"),
    "smoothed": ("#9a2f6b", "#f08bc0"),
    "gps": ("#bf5b0b", "#f2a354"),
    "flow": ("#0e7a5f", "#45cfa2"),
    "autopilot": ("#8339a8", "#cb9df2"),
    "flown": ("#8339a8", "#cb9df2"),  # what an autopilot flew on: its own estimate, too
    "imu": ("#7a6000", "#d8bf5a"),
    "command": ("#57616c", "#a3adb8"),
    "gate": ("#b8232a", "#ff8078"),
    "alert": ("#b8232a", "#ff8078"),
    "pad": ("#7d8894", "#8793a0"),
    "band": ("rgba(10,95,180,0.15)", "rgba(98,179,255,0.20)"),
    "window": ("rgba(184,35,42,0.09)", "rgba(255,128,120,0.14)"),
    "shade": ("rgba(29,35,42,0.22)", "rgba(0,0,0,0.7)"),
    # the phases of a flight (scoring/phases.py)
    "phase-ground": ("#c9ced4", "#4a525c"),
    "phase-climb": ("#a9cdf0", "#2f5f8c"),
    "phase-hover": ("#b5dfcd", "#2b6b55"),
    "phase-transit": ("#d9cdee", "#5d4a83"),
    "phase-descent": ("#f4d9ae", "#7c5a22"),
    "phase-approach": ("#f6c296", "#8d5424"),
    "phase-touchdown": ("#f0a5a0", "#96423e"),
    "phase-landed": ("#c9ced4", "#4a525d"),
    # records beside each other
    "record-1": ("#16191d", "#f5f6f7"),
    "record-2": ("#0a5fb4", "#62b3ff"),
    "record-3": ("#bf5b0b", "#f2a354"),
    "record-4": ("#0e7a5f", "#45cfa2"),
    "record-5": ("#8339a8", "#cb9df2"),
    "record-6": ("#9a2f6b", "#f08bc0"),
    "padfill": ("rgba(125,136,148,0.25)", "rgba(135,147,160,0.28)"),
}
COLOUR = {role: light for role, (light, _) in PALETTE.items()}
LIGHT_TO_DARK = dict(PALETTE.values())

FONT = 'system-ui, -apple-system, "Segoe UI", Roboto, "Helvetica Neue", Arial, "Liberation Sans", sans-serif'

# How a role is drawn as a line over time: the truth comes last and is dashed, so that the estimate shows through.
LINES: dict[str, dict[str, Any]] = {
    "truth": {"color": COLOUR["truth"], "width": 1.3, "dash": "5px,3px"},
    "estimate": {"color": COLOUR["estimate"], "width": 1.6},
    "smoothed": {"color": COLOUR["smoothed"], "width": 1.3},
    "gps": {"color": COLOUR["gps"], "width": 1.5},
    "flow": {"color": COLOUR["flow"], "width": 1.5},
    "autopilot": {"color": COLOUR["autopilot"], "width": 1.4},
    "flown": {"color": COLOUR["flown"], "width": 1.4},
    "imu": {"color": COLOUR["imu"], "width": 1.3},
    "command": {"color": COLOUR["muted"], "width": 1.2, "dash": "2px,3px"},
    "gate": {"color": COLOUR["alert"], "width": 1.2, "dash": "6px,4px"},
}


def axis(title: str = "") -> dict[str, Any]:
    """A 2-D axis in the report's look; the title carries the unit."""
    return {
        "title": {"text": title, "standoff": 6, "font": {"color": COLOUR["muted"], "size": 12}},
        "gridcolor": COLOUR["grid"],
        "linecolor": COLOUR["rule"],
        "zerolinecolor": COLOUR["rule"],
        "tickfont": {"color": COLOUR["muted"], "size": 11},
        "showline": True,
        "ticks": "outside",
        "tickcolor": COLOUR["rule"],
        "ticklen": 4,
        "nticks": 8,
    }


def layout(height_px: int) -> dict[str, Any]:
    """What every figure shares: transparent ground, fonts, legend above, room for the axes."""
    return {
        "height": height_px,
        "autosize": True,
        "paper_bgcolor": "rgba(0,0,0,0)",
        "plot_bgcolor": "rgba(0,0,0,0)",
        "font": {"family": FONT, "size": 12, "color": COLOUR["ink"]},
        "margin": {"l": 60, "r": 14, "t": 36, "b": 44},
        "legend": {"orientation": "h", "x": 0, "y": 1, "xanchor": "left", "yanchor": "bottom", "font": {"size": 12}},
        "modebar": {"bgcolor": "rgba(0,0,0,0)", "color": COLOUR["muted"], "activecolor": COLOUR["estimate"]},
        "hovermode": "x unified",
        "hoverlabel": {
            "bgcolor": COLOUR["surface"],
            "bordercolor": COLOUR["rule"],
            "font": {"family": FONT, "size": 12, "color": COLOUR["ink"]},
        },
        "uirevision": "keep",
    }
