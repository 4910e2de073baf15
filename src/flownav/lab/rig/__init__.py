"""The paper's experiment, simulated from pixels: a pendulum over a pad, an encoder, a PX4FLOW, a log."""
