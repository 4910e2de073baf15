"""MAVLink 2's C headers of the dialect `common`, from the definitions that come with pymavlink: generate.py FOLDER."""

import sys
from pathlib import Path

import pymavlink.dialects.v20 as dialects
from pymavlink.generator import mavgen

definitions = Path(dialects.__file__).parent / "common.xml"
options = mavgen.Opts(sys.argv[1], wire_protocol="2.0", language="C", validate=False)
sys.exit(0 if mavgen.mavgen(options, [str(definitions)]) else 1)
