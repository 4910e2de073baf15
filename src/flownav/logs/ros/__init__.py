"""ROS 2 bags (folders, .db3, .mcap), ROS 1 bags (.bag) and flownav's own MCAP files as a Log.

`containers` finds the messages in a file, `bag` has what a bag holds and makes objects of messages; `topics` makes
columns of numbers, chooses the topics, and puts them on one clock; `standard` (sensor_msgs, mavros_msgs ...) makes
streams of them, and `reader` the Log, with px4_msgs as the topics of a ULog.
"""
