"""flownav: GPS/INS + optical-flow navigation for precision VTOL take-off and landing."""

__version__ = "0.1.0"
