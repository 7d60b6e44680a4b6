"""Obstacle map, planner and next view. Pure: time is an argument."""
