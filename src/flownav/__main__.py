"""`flownav`, and `python -m flownav`: the command line, loaded so that Ctrl-C ends it at once, without a word."""

import gc
import os
import signal
import sys
import warnings
from typing import Any

COLLECT_AFTER = 50_000  # objects; Python's own 700 costs an eighth of a warm flight, to find next to nothing
BROKEN_OFF = 130  # as shells have it


def main() -> None:
    """Load the command line and run it. Until it is there, Ctrl-C finds nothing begun that would have to be ended."""
    before = signal.getsignal(signal.SIGINT)
    if before is signal.default_int_handler:  # not where whoever started us has it ignored
        signal.signal(signal.SIGINT, _leave)
    if not sys.warnoptions:  # Python's own lines about our source help no user; -W shows them
        warnings.simplefilter("ignore")
        sys.warnoptions.append("ignore")  # which Python gives to the processes that it starts
    gc.set_threshold(COLLECT_AFTER)
    os.environ.setdefault("ARROW_DEFAULT_MEMORY_POOL", "system")  # a pool of Arrow's own keeps 14 MB of a flight's 160
    from flownav.cli import asked, run

    app = asked()
    signal.signal(signal.SIGINT, before)
    try:
        run(app)
    finally:
        gc.freeze()  # what is left goes with the process: to look through it takes a fifth of a second


def _leave(number: int, frame: Any) -> None:
    os._exit(BROKEN_OFF)


if __name__ == "__main__":
    main()
