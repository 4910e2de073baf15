"""ROS 2 bags (folders, .db3, .mcap), ROS 1 bags (.bag) and flownav's own MCAP files as a Log.

`containers` finds the messages in a file, `mcap_records` and `sqlite_bag` in one of each kind; `decoding` makes
objects of them, `columns` columns of numbers; `clock` puts them on one clock; `standard` (sensor_msgs, mavros_msgs ...)
and `px4` (px4_msgs) make streams of them; `choice` says which topic serves; `reader` the Log.
"""
