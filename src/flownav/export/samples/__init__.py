"""Small logs of a simulated flight and of a simulated rig, in the formats that vehicles write: `flownav sample`.

`flight` flies them, a writer a format puts them into files, `kinds` lists what there is and writes it.
"""
