"""explain: why a log's autopilot drifted, and the parameters that cure it."""

from __future__ import annotations

from collections.abc import Mapping
from pathlib import Path
from typing import TYPE_CHECKING

from flownav.api.arguments import checked
from flownav.core.errors import InputError, arg

if TYPE_CHECKING:
    from flownav.studies.explain.judge import Explanation

AUTOPILOTS = ("px4", "ardupilot", "inav")


@checked
def explain(
    log: str | Path,
    *,
    autopilot: str | None = None,
    flow_instance: int | None = None,
    topics: Mapping[str, str] | None = None,
) -> Explanation:
    """Why a recorded flight drifted: the causes with their seconds, how sure each is, and what cures it.

    log: any log that `flownav info` reads. autopilot: px4, ardupilot or inav, whose parameters cure it, where the log
    has none of its own that say. flow_instance: which of several flow sensors. topics: of a ROS bag, which topic
    serves as what. An `Explanation` has `verdict` (one sentence), `first` and `findings` (each with sentence, window_s,
    probability, figures, pictures and cure), `checked` (every hypothesis that was looked into) and `missing` (what
    the log lacks for the others). InputError, one line, where the log or an option cannot serve.

    Example:
        >>> import flownav
        >>> explained = flownav.explain(log)
        >>> explained.first is None
        True
    """
    if autopilot is not None and autopilot not in AUTOPILOTS:
        raise InputError(f"{arg('autopilot')} {autopilot}: px4, ardupilot or inav are possible")

    from flownav.core.compile import announce_compilation
    from flownav.logs.open_log import open_log
    from flownav.studies.explain.judge import explain as explained

    with announce_compilation("explanation"):
        return explained(open_log(Path(log), flow_instance=flow_instance, topics=topics), dialect=autopilot or "")
