"""Camera models and calibration; usable without the robot."""
