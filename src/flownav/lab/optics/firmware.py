"""The PX4FLOW firmware's versions: what changed between 2013 and 2020, and the defects that came and went.

Dates and commits are those of the public PX4/Flow history (github.com/PX4/Flow). A version is a
set of plain numbers and switches, so that a defect can be switched alone:
`firmware_named("2013-09")._replace(gyro_scale=1.0)`.
"""

from itertools import accumulate
from typing import Any, NamedTuple

from flownav.core.errors import InputError

TILE_PX = 8
GYRO_RATED_RAD_S_PER_DIGIT = 8.75e-3  # L3GD20 at +-250 deg/s: 8.75 mdps a digit; the ratio alone matters
EARLY_GYRO_SCALE = 250.0 / 32768.0 / GYRO_RATED_RAD_S_PER_DIGIT  # 0.872: 12.8 % low until 2014-11
DEFAULT = "2014-12"


class Firmware(NamedTuple):
    """One version's numbers and switches.

    `first_px` and `step_px` place the corners of the patches; 0 takes the firmware's own formula, which spreads
    `patches` x `patches` over the frame. The switches named `..._defect` reproduce a known fault.
    """

    name: str
    frame_rate_hz: float
    search_px: int
    patches: int
    first_px: int
    step_px: int
    feature_threshold: int
    sad_threshold: int
    histogram_filter: bool
    gyro_compensation: bool
    gyro_threshold_rad_s: float
    gyro_scale: float
    frames_per_message: int
    clock_s: float
    transmit_latency_s: float
    sonar_median: bool
    low_pass: bool
    low_pass_weight: float
    rows_twice_defect: bool
    half_pixel_y_defect: bool
    over_zero_defect: bool
    histogram_index_defect: bool


FIRST = Firmware(
    name="2013-06",
    frame_rate_hz=250.0,
    search_px=4,
    patches=8,
    first_px=17,
    step_px=3,
    feature_threshold=30,
    sad_threshold=5000,
    histogram_filter=False,
    gyro_compensation=True,
    gyro_threshold_rad_s=0.01,
    gyro_scale=EARLY_GYRO_SCALE,
    frames_per_message=2,
    clock_s=1e-3,
    transmit_latency_s=0.003,
    sonar_median=False,
    low_pass=False,
    low_pass_weight=0.3,
    rows_twice_defect=True,
    half_pixel_y_defect=True,
    over_zero_defect=True,
    histogram_index_defect=True,
)
# what each version changed in the one before
CHANGES: dict[str, dict[str, Any]] = {
    "2013-09": {"first_px": 0, "step_px": 0},
    "2014-01": {"over_zero_defect": False},
    "2014-07": {"frame_rate_hz": 400.0, "patches": 5},
    "2014-08": {"clock_s": 1e-5, "frames_per_message": 1, "transmit_latency_s": 0.356},
    "2014-10": {"frames_per_message": 10, "transmit_latency_s": 0.003, "gyro_compensation": False},
    "2014-11": {"gyro_scale": 1.0},
    "2014-12": {"rows_twice_defect": False, "half_pixel_y_defect": False, "sonar_median": True},
    "2015-12": {"sonar_median": False},
    "2016": {"search_px": 8, "frames_per_message": 40},
    "2017": {"feature_threshold": 40},
    "2020": {"histogram_index_defect": False},
}
VERSIONS: dict[str, Firmware] = {
    version.name: version
    for version in accumulate(CHANGES.items(), lambda old, new: old._replace(name=new[0], **new[1]), initial=FIRST)
}

DEFECTS: dict[str, dict[str, Any]] = {
    "rows-twice": {"rows_twice_defect": True},
    "half-pixel-y": {"half_pixel_y_defect": True},
    "gyro-scale": {"gyro_scale": EARLY_GYRO_SCALE},
    "over-zero": {"over_zero_defect": True},
    "histogram-index": {"histogram_index_defect": True},
}
REPAIRS: dict[str, dict[str, Any]] = {
    name: {switch: 1.0 if switch == "gyro_scale" else False for switch in switches}
    for name, switches in DEFECTS.items()
}


def firmware_named(text: str) -> Firmware:
    """A version, with switches: `2013-09`, `2013-09-gyro-scale` repaired, written `2013-09,-gyro-scale,+over-zero`.

    After the version, `-NAME` repairs a defect and `+NAME` puts it in; also `+histogram`, `+low-pass`, `+gyro` and
    their `-` forms for the firmware's own parameters. InputError lists what is known.
    """
    name, *switches = [part.strip() for part in text.split(",")]
    if name not in VERSIONS:
        raise InputError(f"firmware {name!r}: unknown; known are {', '.join(VERSIONS)}")
    version = VERSIONS[name]
    for switch in switches:
        version = version._replace(**_changes(switch))
    return version._replace(name=text)


def _changes(switch: str) -> dict[str, Any]:
    sign, name = switch[:1], switch[1:]
    parameters = {"histogram": "histogram_filter", "low-pass": "low_pass", "gyro": "gyro_compensation"}
    if sign in ("+", "-") and name in parameters:
        return {parameters[name]: sign == "+"}
    if sign in ("+", "-") and name in DEFECTS:
        return (DEFECTS if sign == "+" else REPAIRS)[name]
    known = ", ".join([*DEFECTS, *parameters])
    raise InputError(f"firmware switch {switch!r}: write + or - and one of {known}")
