"""Setting a vehicle up: its parameters read over MAVLink and held against what flownav needs of them."""
