"""Rectification: two real pictures become the pair an ideal rig (parallel axes, no distortion) would see."""

from __future__ import annotations

from dataclasses import dataclass

import cv2
import numpy as np
from numpy.typing import NDArray

from calib.model import Camera, Matrix, StereoRig

Image = NDArray[np.uint8]
Map = NDArray[np.float32]


@dataclass(frozen=True, slots=True, eq=False)
class Rectifier:
    """Turns pairs of a real rig into pairs of `rig`, a parallel one. Made by `rectifier`.

    rotation: 3x3 from the real left camera's frame into the rectified one's (identity for an ideal pair).
    """

    source: StereoRig
    rig: StereoRig
    rotation: Matrix
    maps: tuple[tuple[Map, Map], tuple[Map, Map]] | None

    def __call__(self, left: Image, right: Image) -> tuple[Image, Image]:
        """Both pictures rectified, (H, W) or (H, W, 3) uint8; the very same arrays if nothing is to be done.

        Raises ValueError for pictures that are not of the calibrated size.
        """
        wanted = (self.source.left.height, self.source.left.width)
        for name, image in (("left", left), ("right", right)):
            if image.shape[:2] != wanted:
                raise ValueError(
                    f"the {name} picture is {image.shape[1]}x{image.shape[0]}, "
                    f"the calibration {wanted[1]}x{wanted[0]}"
                )
        if self.maps is None:
            return left, right
        first, second = (
            np.asarray(cv2.remap(image, *maps, cv2.INTER_LINEAR), dtype=np.uint8)
            for image, maps in zip((left, right), self.maps, strict=True)
        )
        return first, second

    def left_points(self, points: NDArray[np.float64]) -> NDArray[np.float64]:
        """Where pixels (N, 2) of the real left picture lie in the rectified one."""
        pixels = np.asarray(points, dtype=np.float64).reshape(-1, 2)
        if self.maps is None:
            return pixels
        eye = self.source.left
        moved = cv2.undistortPoints(
            pixels.reshape(-1, 1, 2), eye.matrix, _distortion(eye), R=self.rotation, P=self.rig.left.matrix
        )
        return np.asarray(moved, dtype=np.float64).reshape(-1, 2)


def rectifier(rig: StereoRig) -> Rectifier:
    """The rectification of a rig: Bouguet's, both principal points alike, no pixel without a picture.

    >>> ideal = StereoRig.parallel(352, 288, 305.0, 0.06)
    >>> rectifier(ideal).rig is ideal
    True
    """
    if rig.is_parallel():
        return Rectifier(rig, rig, np.eye(3), None)
    left, right = rig.left, rig.right
    size = (left.width, left.height)
    rotation_left, rotation_right, new_left, new_right, *_ = cv2.stereoRectify(
        left.matrix, _distortion(left), right.matrix, _distortion(right), size, rig.R,
        np.array(rig.translation).reshape(3, 1), flags=cv2.CALIB_ZERO_DISPARITY, alpha=0.0,
    )  # fmt: skip
    first, second = np.asarray(new_left, np.float64), np.asarray(new_right, np.float64)
    maps = _maps(left, rotation_left, first), _maps(right, rotation_right, second)
    sideways = float(second[0, 3] / second[0, 0])
    ideal = StereoRig(_camera(first, size), _camera(second, size), translation=(sideways, 0.0, 0.0))
    return Rectifier(rig, ideal, np.asarray(rotation_left, np.float64), maps)


def _maps(eye: Camera, rotation: object, projection: Matrix) -> tuple[Map, Map]:
    """Where every pixel of the rectified eye lies in the real one: columns and rows, (H, W) float32."""
    columns, rows = cv2.initUndistortRectifyMap(
        eye.matrix, _distortion(eye), np.asarray(rotation, np.float64), projection[:, :3],
        (eye.width, eye.height), cv2.CV_32FC1,
    )  # fmt: skip
    return np.asarray(columns, np.float32), np.asarray(rows, np.float32)


def _camera(projection: Matrix, size: tuple[int, int]) -> Camera:
    k = projection
    return Camera(size[0], size[1], float(k[0, 0]), float(k[1, 1]), float(k[0, 2]), float(k[1, 2]))


def _distortion(eye: Camera) -> NDArray[np.float64]:
    return np.array(eye.distortion if eye.distortion else (0.0,) * 5, dtype=np.float64)
