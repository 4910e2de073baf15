"""What hatchling asks for when it builds a wheel: compiled kernels come along if `FLOWNAV_KERNELS` names their folder.

Such a wheel is for one version of Python and one kind of machine, and is named so. Without, it is for all.
"""

from __future__ import annotations

import os
from typing import Any

from hatchling.builders.hooks.plugin.interface import BuildHookInterface


class CarriedKernels(BuildHookInterface):
    """Puts the kernels to where `flownav.core.compiling.cache.SHIPPED` looks for them."""

    PLUGIN_NAME = "custom"

    def initialize(self, version: str, build_data: dict[str, Any]) -> None:
        """Before the files are gathered; an editable install carries none."""
        folder = os.environ.get("FLOWNAV_KERNELS")
        if folder and version == "standard":
            build_data["force_include"][folder] = "flownav/kernels"
            build_data["pure_python"], build_data["infer_tag"] = False, True
