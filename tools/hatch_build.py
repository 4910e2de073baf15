"""The hook that hatchling calls when it builds a wheel: it adds files that no folder of the source holds.

Plotly's script, which draws the pages of campaigns, certificates and comparisons: taken, with its licence, from
Plotly's own package, so that who installs flownav need not install that (65 MB). Compiled kernels, if `FLOWNAV_KERNELS`
names their folder: such a wheel is for one version of Python and one kind of machine, is named so, and asks for no
compiler. Any other is for all machines and asks for Numba, as an editable install does.
"""

from __future__ import annotations

import os
from importlib.metadata import distribution
from pathlib import Path
from typing import Any

from hatchling.builders.hooks.plugin.interface import BuildHookInterface

VENDOR = "flownav/report/vendor"
SCRIPT = "plotly/package_data/plotly.min.js"
COMPILE = "compile"  # the extra that a wheel without kernels cannot do without


class Carried(BuildHookInterface):
    """Puts the script to where `flownav.report.html.plotly_script` looks for it, kernels to where the cache does."""

    PLUGIN_NAME = "custom"

    def initialize(self, version: str, build_data: dict[str, Any]) -> None:
        """Before the files are gathered; an editable install carries none."""
        folder = os.environ.get("FLOWNAV_KERNELS") if version == "standard" else None
        if not folder:
            build_data["dependencies"].extend(self.metadata.core.optional_dependencies[COMPILE])
        if version != "standard":
            return
        for source, name in _script_and_licence():
            build_data["force_include"][str(source)] = f"{VENDOR}/{name}"
        if folder:
            build_data["force_include"][folder] = "flownav/kernels"
            build_data["pure_python"], build_data["infer_tag"] = False, True


def _script_and_licence() -> list[tuple[Path, str]]:
    """Where Plotly's package has its script and its licence (MIT, both), and what each is called in the wheel."""
    plotly = distribution("plotly")
    licence = next(file for file in plotly.files or () if file.name.startswith("LICENSE") and ".dist-info" in str(file))
    script = Path(str(plotly.locate_file(SCRIPT)))
    if not script.is_file():
        raise FileNotFoundError(f"plotly {plotly.version} has no {SCRIPT}: flownav's pages are drawn by it")
    return [(script, "plotly.min.js"), (Path(str(plotly.locate_file(licence))), "plotly.LICENSE")]
