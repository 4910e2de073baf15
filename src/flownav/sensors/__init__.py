"""The sensors of a flight as equations: GPS/INS, optical flow, rangefinder, IMU, and the flow sensor's file."""
