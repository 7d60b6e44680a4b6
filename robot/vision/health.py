"""interim"""
from __future__ import annotations
import numpy as np
def brightness(image) -> float:
    return float(image[::8, ::8].mean())
def picture_fault(frame, previous):
    if frame.left.shape != frame.right.shape: return "size"
    if max(int(frame.left[::8, ::8].max()), int(frame.right[::8, ::8].max())) < 8: return "black"
    if previous is not None and np.array_equal(previous.left[::8, ::8], frame.left[::8, ::8]): return "frozen"
    return None
def eyes_swapped(left, right) -> bool:
    return False
