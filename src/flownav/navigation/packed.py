"""The navigator's settings as one array of numbers, and the equations that take each subject's part of it."""

from typing import Any, NamedTuple

import numpy as np

from flownav.core.compile import flat_access
from flownav.core.measurement import Array
from flownav.estimation.error_models import FilterSettings
from flownav.navigation import kernel_settings
from flownav.navigation.kernel_settings import NavigatorSettings

PARTS: dict[str, type[Any]] = {
    "filter": FilterSettings,
    "imu": kernel_settings.ImuSettings,
    "gps": kernel_settings.GpsSettings,
    "flow": kernel_settings.FlowSettings,
    "height": kernel_settings.HeightSettings,
    "attitude": kernel_settings.AttitudeSettings,
    "place": kernel_settings.PlaceSettings,
    "aid": kernel_settings.AidSettings,
    "equipment": kernel_settings.Equipment,
}


class _Starts(NamedTuple):
    filter: int
    imu: int
    gps: int
    flow: int
    height: int
    attitude: int
    place: int
    aid: int
    equipment: int
    start_sigma: int


_access = {name: flat_access(bundle) for name, bundle in PARTS.items()}
_sizes = [access.size for access in _access.values()]
_starts = _Starts(*(int(first) for first in np.cumsum([0, *_sizes])))
START_SIGMA = _starts.start_sigma

load_filter_settings = flat_access(PARTS["filter"], _starts.filter).load
load_imu_settings = flat_access(PARTS["imu"], _starts.imu).load
load_gps_settings = flat_access(PARTS["gps"], _starts.gps).load
load_flow_settings = flat_access(PARTS["flow"], _starts.flow).load
load_height_settings = flat_access(PARTS["height"], _starts.height).load
load_attitude_settings = flat_access(PARTS["attitude"], _starts.attitude).load
load_place_settings = flat_access(PARTS["place"], _starts.place).load
load_aid_settings = flat_access(PARTS["aid"], _starts.aid).load
load_equipment = flat_access(PARTS["equipment"], _starts.equipment).load


def pack(settings: NavigatorSettings, start_sigma: Array) -> Array:
    """Settings and the standard deviations before the first reading, as kernels take them."""
    parts = [_access[name].pack(getattr(settings, name)) for name in PARTS]
    return np.concatenate([*parts, start_sigma])
