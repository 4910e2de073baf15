"""The sensor from its logs: output-error fits, their intervals and verdicts, and the sensor file they become."""
