"""An image-level PX4FLOW: pads, the camera above them, the firmware's block matching, from frames to flow."""
