"""The picture of README and front page: the command that README names is run, and its landing drawn from its record.

`readme_picture.py [OUT.svg]` writes docs/pictures/landing.svg and beside it landing-narrow.svg, for phones. It is
run by hand when the picture or the flight changes.
"""

from __future__ import annotations

import re
import shlex
import subprocess
import sys
from pathlib import Path
from tempfile import TemporaryDirectory

PROJECT = Path(__file__).parents[2]
PICTURE = PROJECT / "docs" / "pictures" / "landing.svg"
NAMED = re.compile(r"\*The landing of `flownav ([^`]+)`")


def command() -> list[str]:
    """The arguments of the command that the README names under its picture. ValueError where it names none."""
    found = NAMED.search((PROJECT / "README.md").read_text(encoding="utf-8"))
    if found is None:
        raise ValueError("README.md names no command under its picture")
    return shlex.split(found[1])


def main(out: Path) -> None:
    """Run the command in an empty folder and draw the landing of the record that it writes."""
    from flownav.core.record import Record
    from flownav.report.landing import landing_picture

    with TemporaryDirectory() as folder:
        record = Path(folder) / "flight.fnr"
        order = [sys.executable, "-m", "flownav", *command(), "--out", str(record), "--no-report"]
        subprocess.run(order, cwd=folder, check=True)
        flown = Record.load(record)
    for place, narrow in ((out, False), (out.with_stem(f"{out.stem}-narrow"), True)):
        picture = landing_picture(flown, alone=True, narrow=narrow)
        if picture is None:
            raise ValueError(f"flownav {shlex.join(command())} did not land")
        place.write_text(picture.svg, encoding="utf-8")


if __name__ == "__main__":
    main(Path(sys.argv[1]) if len(sys.argv) > 1 else PICTURE)
