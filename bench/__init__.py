"""Figures of the robot, each measured by one command: `python -m bench.NAME [--json]`."""
