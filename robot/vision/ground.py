"""interim"""
from __future__ import annotations
import numpy as np
def obstacle_points(left, right, rig, mount, pan, tilt):
    return np.zeros((0, 3))
