"""The league of every log in a folder, written as a page: `make league`.

python tools/league.py FOLDER PAGE
"""

from __future__ import annotations

import sys
from pathlib import Path

from flownav.core.errors import FlownavError
from flownav.core.files import written_whole
from flownav.studies.compare.job import logs_in, names_of, page, play
from made.gps_free import markdown, rows_of

WITHOUT_GPS = """
## Without GPS, beside the raw gyro

Flights with a truth and without GPS, from take-off to landing, the truth laid on each path at take-off by place and
heading. Dead reckoning here is flow times range by the raw gyro's heading, and knows nothing of the filter; that of the
table above takes the filter's heading where the log has none. The level is the horizontal protection level.

"""


def main(folder: Path, out: Path) -> None:
    """Play, print and write. FlownavError where there is nothing to play with."""
    paths = logs_in(folder)
    text = page(*play(paths, lambda name: print(f"league: {name}", file=sys.stderr)))
    text += WITHOUT_GPS + markdown(rows_of(names_of(paths), paths))
    with written_whole(out) as temporary:
        temporary.write_text(text, encoding="utf-8", newline="\n")
    print(text)


if __name__ == "__main__":
    if len(sys.argv) != 3:
        sys.exit("usage: python tools/league.py FOLDER PAGE")
    try:
        main(Path(sys.argv[1]), Path(sys.argv[2]))
    except (FlownavError, OSError) as error:
        sys.exit(f"flownav: {error}")
