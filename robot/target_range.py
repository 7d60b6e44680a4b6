"""How far the target is: by stereo, held against its known size; by its size where stereo has no answer."""

from __future__ import annotations

import numpy as np

from calib.model import HeadMount, StereoRig
from robot.messages import Box, Range, View
from robot.vision.ranging import range_box

SMALLEST_RATIO, LARGEST_RATIO = 0.6, 1.6  # of the height a box shows at its distance to the target's real one
SIZE_SIGMA = 0.1  # share of the distance: a box is seldom truer than a tenth of its height
SMALLEST_PX = 8.0
RIM_PX = 2.0  # a box nearer than this to the picture's rim may be cut: its height says nothing


class TargetRanger:
    """Measures boxes that show the target. height_m is its real height, None if it is not known."""

    def __init__(self, rig: StereoRig, mount: HeadMount, height_m: float | None = None) -> None:
        self._rig = rig
        self._mount = mount
        self._height_m = height_m

    def measure(self, view: View, box: Box) -> Range | None:
        """The target's range; None where it cannot be told.

        Stereo in the middle of the box; beside it where something thin stands before the middle; by the
        target's size where one eye cannot see it. Without a known size only the middle counts.
        """
        middle = self._stereo(view, box)
        if self._height_m is None or (middle is not None and self.fits(box, middle)):
            return middle
        for side in _sides(box):
            beside = self._stereo(view, side)
            if beside is not None and self.fits(box, beside):
                return beside
        return self._by_size(view, box)

    def fits(self, box: Box, measured: Range) -> bool:
        """True if a thing that high at this distance can be the target, or if its size is not known."""
        if self._height_m is None:
            return True
        ratio = box.h * measured.distance / (self._rig.left.fy * self._height_m)
        return SMALLEST_RATIO <= ratio <= LARGEST_RATIO

    def plausible(self, view: View, box: Box) -> bool:
        """False if stereo tells the box's distance and the target would have another size there.

        A print on the floor or on a wall may look like the target; seldom is it as large as the target would
        be at that distance.
        """
        if self._height_m is None:
            return True
        measured = [one for part in (box, *_sides(box)) if (one := self._stereo(view, part)) is not None]
        return not measured or any(self.fits(box, one) for one in measured)

    def _stereo(self, view: View, box: Box) -> Range | None:
        frame, head = view.frame, view.head
        return range_box(frame.left, frame.right, box, self._rig, self._mount, head.pan, head.tilt)

    def _by_size(self, view: View, box: Box) -> Range | None:
        eye = self._rig.left
        if self._height_m is None or box.h < SMALLEST_PX or _cut(box, eye.width, eye.height):
            return None
        distance = eye.fy * self._height_m / box.h
        u, v = box.centre
        ray = np.array([(u - eye.cx) / eye.fx, (v - eye.cy) / eye.fy, 1.0])
        rotation, position = self._mount.left_eye(view.head.pan, view.head.tilt)
        x, y, z = (float(c) for c in rotation @ (distance * ray) + position)
        disparity = eye.fx * self._rig.baseline / distance
        return Range(distance, SIZE_SIGMA * distance, (x, y, z), disparity, "size")


def _sides(box: Box) -> tuple[Box, Box]:
    half = box.w / 2
    return Box(box.x, box.y, half, box.h), Box(box.x + half, box.y, half, box.h)


def _cut(box: Box, width: int, height: int) -> bool:
    return (
        box.x < RIM_PX or box.y < RIM_PX or box.x + box.w > width - RIM_PX or box.y + box.h > height - RIM_PX
    )
