"""A log through a filter of somebody else's, in our navigator's place."""

from flownav.core.compile import ONE_LANE
from flownav.core.errors import InputError
from flownav.logs.log import Log
from flownav.navigation.loop import Running
from flownav.navigation.settings import NavigatorSettingsFile
from flownav.parts.calling import Mistakes
from flownav.parts.equations import EquationFilter
from flownav.parts.flying import fresh
from flownav.parts.protocols import Filter, Told
from flownav.parts.taking import Taker
from flownav.replays.prepare import ReplayOptions
from flownav.replays.session import Replay, replay


def replay_with(log: Log, options: ReplayOptions, settings: NavigatorSettingsFile, part: Filter) -> Replay:
    """A log's readings, prepared as for ours, through this filter, which begins anew.

    InputError as `replay`, and where the filter makes a mistake.
    """
    mistakes, kept = Mistakes(), []

    def instead(running: Running) -> int:
        if isinstance(part, EquationFilter):
            return part.unit(ONE_LANE).address
        kept.append(Taker(fresh(part), Told(running.told), running.work, running.tape, mistakes))
        return kept[-1].address

    try:
        flown = replay(log, options, settings, instead=instead)
    except InputError:
        mistakes.tell()  # its own mistake says more than that it never started
        raise
    mistakes.tell()
    return flown
