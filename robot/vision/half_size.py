"""Pictures of half size, searched at a quarter of the cost, and where their pixels lie.

Pixel k of the half-size picture covers pixels 2k and 2k + 1 of the full one: its middle lies at 2k + 0.5.
"""

from __future__ import annotations

from typing import TypeVar

import cv2
import numpy as np
from numpy.typing import NDArray

from calib.model import Camera, Matrix

Pixels = NDArray[np.float64]
Grey = TypeVar("Grey", NDArray[np.uint8], NDArray[np.float32])


def half_size(picture: Grey) -> Grey:
    """The mean of every 2 x 2 pixels of a grey picture (H, W), at least one pixel high and wide.

    >>> half_size(np.array([[0, 4], [8, 12]], np.float32)).tolist()
    [[6.0]]
    """
    size = max(picture.shape[1] // 2, 1), max(picture.shape[0] // 2, 1)
    return np.asarray(cv2.resize(picture, size, interpolation=cv2.INTER_AREA), picture.dtype)


def to_half(points: Pixels) -> Pixels:
    """Where pixels (...) of the full picture lie in the half-size one.

    >>> to_half(to_full(np.array([7.0, 3.5]))).tolist()
    [7.0, 3.5]
    """
    return np.asarray(0.5 * (points - 0.5))


def to_full(points: Pixels) -> Pixels:
    """Where pixels (...) of the half-size picture lie in the full one.

    >>> to_full(np.array([[0.0, 10.0]])).tolist()
    [[0.5, 20.5]]
    """
    return np.asarray(2.0 * points + 0.5)


def homography_to_half(homography: Matrix) -> Matrix:
    """A homography (3, 3) between pixels of full pictures, between those of half-size ones."""
    up = np.array([[2.0, 0.0, 0.5], [0.0, 2.0, 0.5], [0.0, 0.0, 1.0]])
    return np.asarray(np.linalg.inv(up) @ homography @ up)


def half_camera(camera: Camera) -> Camera:
    """The camera whose pictures are the half-size ones; undistorted.

    >>> half_camera(Camera(352, 288, 305.0, 305.0, 175.5, 143.5))
    Camera(width=176, height=144, fx=152.5, fy=152.5, cx=87.5, cy=71.5, distortion=())
    """
    u, v = to_half(np.array([camera.cx, camera.cy])).tolist()
    size = max(camera.width // 2, 1), max(camera.height // 2, 1)
    return Camera(*size, 0.5 * camera.fx, 0.5 * camera.fy, u, v)
