"""The league of every log in a folder, written as a page: `make league`.

python tools/league.py FOLDER PAGE
"""

from __future__ import annotations

import sys
from pathlib import Path

from flownav.core.errors import FlownavError
from flownav.core.files import written_whole
from flownav.studies.compare.job import logs_in, page, play


def main(folder: Path, out: Path) -> None:
    """Play, print and write. FlownavError where there is nothing to play with."""
    text = page(*play(logs_in(folder), lambda name: print(f"league: {name}", file=sys.stderr)))
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
