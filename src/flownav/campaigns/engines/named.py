"""The engines of campaigns and certificates by their names."""

from __future__ import annotations

import os
from typing import TYPE_CHECKING

from flownav.core.errors import InputError

if TYPE_CHECKING:
    from flownav.campaigns.engines.engine import Engine

ENGINES = ("local", "ray", "cuda")


def require_engine(name: str) -> None:
    """InputError where there is no engine of that name."""
    if name not in ENGINES:
        raise InputError(f"--engine {name}: must be {', '.join(ENGINES[:-1])} or {ENGINES[-1]}")


def engine_named(name: str) -> Engine:
    """The engine of that name. InputError where what it needs is not there."""
    require_engine(name)
    if name == "local":
        from flownav.campaigns.engines.local import Local

        return Local()
    if name == "ray":
        from flownav.campaigns.engines.ray_cluster import RayCluster

        return RayCluster()
    from flownav.campaigns.engines.cuda import Cuda

    return Cuda(processes=os.cpu_count() or 1)
