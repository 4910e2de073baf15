# %% [markdown]
# # From a certificate to a flight controller and back
#
# A certificate says how well a navigator lands, and it says so of the navigator in the simulator. What flies is a
# library on a processor. Here the one becomes the other: a requirement is certified, the navigator of its worst
# flight is built for a Cortex-M7, that library flies the same readings on an emulated core, and what it says is held
# against the certificate's own record, digest by digest.
#
# ## Certify
#
# This requirement is small, so that the tutorial stays short: 90 % of all landings at 80 % confidence.
# [Certify a landing](certify.md) has a real one.

# %%
from pathlib import Path

Path("my-landing.toml").write_text("""
schema_version = 1
name = "my_landing"
description = "The landing in up to 2 m/s of wind: two metres at the touchdown"
scenario = "landing"

[conditions]
wind.speed_20ft_m_s = [0, 2]

[[requirement]]
measure = "touchdown.horizontal_m"
at_most = 2.0
probability = 0.9
confidence = 0.8
""")

# %% language="bash"
# flownav certify my-landing.toml --ranking 0 --records 1 --again 4 --out certificate
# ls certificate/records

# %% [markdown]
# The folder holds the record of the worst flight. It says with which settings the navigator flew, which sensors it
# had, and every reading that it was fed.
#
# ## Build
#
# The library takes settings and sensors from that record. Nothing of the navigator is written a second time: the same
# equations are compiled for another processor.

# %%
record = next(Path("certificate/records").glob("*.fnr"))
worst = record.rename("worst.fnr")

# %% language="bash"
# flownav build --target cortex-m7 --record worst.fnr --out m7
# ls m7

# %% [markdown]
# `libflownav.a`, `flownav.h` and the two files of constants go into your firmware. `main.c` shows the calls, and the
# README in the folder explains them.
#
# ## Fly it on the board
#
# No board is at hand here, so unicorn emulates the core (`tools/emulated_board.py`, in a clone of flownav). It calls
# the library that was just built as firmware would, a reading at a time, and writes down what your board should
# write down as well: after every 500 readings how many there were, and the 64 bits of `flownav_digest`.

# %%
import subprocess
import sys

import flownav

board = Path(flownav.__file__).parents[2] / "tools" / "emulated_board.py"


def fly(*options: str) -> str:
    told = subprocess.run([sys.executable, board, "m7", "worst.fnr", *options], capture_output=True, text=True)
    assert told.returncode == 0, told.stderr
    return told.stdout


lines = fly()
Path("said.txt").write_text(lines)
print(lines)

# %% [markdown]
# ## And back
#
# `flownav verify` replays the record here and compares it with each line. The status is 0 where all are the same.

# %% language="bash"
# flownav verify said.txt worst.fnr

# %% [markdown]
# What was certified is what the processor computes, to the last bit of everything that it knows.
#
# ## What a wrong driver looks like
#
# Now the hundredth flow reading reaches the board with its axes swapped, once. Nobody would see that in flight. The
# digests differ from the next line on, and `verify` says between which readings it happened.

# %%
Path("wrong.txt").write_text(fly("--swapped", "100"))

# %% language="bash"
# flownav verify wrong.txt worst.fnr || echo "the status is $?"

# %% [markdown]
# Write a line after every reading to find the very one. [The navigator on board](../how-to/onboard.md) goes on from
# here: a companion computer, ROS 2 and the browser. [What it takes and how it is proven](../explanation/onboard.md)
# has code size, RAM and instructions, and what was not measured: an emulator counts instructions, and no board has
# counted cycles.
