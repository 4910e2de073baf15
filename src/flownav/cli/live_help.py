"""The groups of the options of `flownav live --help`, and its examples."""

from flownav.cli.grouped import grouped

GROUPS = {
    "Arguments": ("url",),
    "The link": ("system", "component", "accept", "capacity", "signing_key"),
    "Messages sent, and the sensors": ("send", "sensor", "gps_delay", "settings"),
    "Limits, beyond which nothing is sent": ("send_limit", "send_sigma", "send_protection", "unfused"),
    "The record, and the state for others to read": ("record", "force", "status"),
    "Setting the vehicle up, in place of navigating": ("setup", "write", "source_set", "origin"),
}
EXAMPLES = (
    ("Settings that ArduPilot's simulator must change, and its origin where it has no GPS",
     "flownav live tcp:127.0.0.1:5762 --setup --origin 47.3977,8.5456,489"),
    ("Navigate PX4's simulator, send it the estimate, and keep a record",
     "flownav live udp:14540 --record flight.fnr"),
)  # fmt: skip
SHOWN = grouped(GROUPS, EXAMPLES)
