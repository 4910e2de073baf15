"""The size of an installation, distribution by distribution: `python tools/install_size.py SITE-PACKAGES`.

Blocks on the disk as `du` counts them, compiled Python (`.pyc`) among them, in MiB; pip and setuptools, which every
environment has before flownav comes, stand apart.
"""

from __future__ import annotations

import sys
from importlib.metadata import Distribution, distributions
from pathlib import Path

BEFORE = ("pip", "setuptools")
BLOCK, MIB = 512, 1 << 20


def blocks_of(distribution: Distribution) -> float:
    """MiB on the disk of a distribution's files."""
    paths = {Path(str(distribution.locate_file(file))) for file in distribution.files or ()}
    return sum(path.stat().st_blocks for path in paths if path.is_file()) * BLOCK / MIB


def main(site: str) -> None:
    """A table, the heaviest first."""
    sizes = {found.metadata["Name"]: blocks_of(found) for found in distributions(path=[site])}
    own = {name: size for name, size in sizes.items() if name not in BEFORE}
    for name, size in sorted(own.items(), key=lambda one: -one[1]):
        print(f"| {name} | {size:.1f} |")
    print(f"| together | {sum(own.values()):.1f} |")


if __name__ == "__main__":
    main(sys.argv[1])
