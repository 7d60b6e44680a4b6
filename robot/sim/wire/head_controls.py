"""The pan-tilt head as a camera's controls: arc-seconds, pan + right, tilt + up, as UVC counts them."""

from __future__ import annotations

import math
from collections.abc import Callable, Sequence

from robot.messages import HeadPose
from robot.sim.head import PAN_LIMIT, TILT_DOWN_LIMIT, TILT_UP_LIMIT, SimHead

PAN_ABSOLUTE, TILT_ABSOLUTE, ZOOM_ABSOLUTE = 10094856, 10094857, 10094861
"""V4L2_CID_*_ABSOLUTE of the camera class."""
STEP = 36
"""Arc-seconds: a hundredth of a degree."""
_INTEGER = 1
_GROUP = 1
_ZOOM = 100


class HeadControls:
    """`Controls` that move a `SimHead`; what is read back is where its encoders say it is.

    A value beyond the range or between the steps is taken as the nearest allowed one, as a camera does.
    broken: every access fails.

    >>> import numpy as np
    >>> head = SimHead(np.random.default_rng(1))
    >>> controls = HeadControls(head, now=lambda: 0.0)
    >>> controls.set(PAN_ABSOLUTE, 36_000), controls.set(1, 0)     # 10 degrees to the right; no such control
    (True, False)
    >>> head.advance(1.0, 1.0)
    >>> -11.0 < math.degrees(head.true_pose.pan) < -9.0
    True
    """

    def __init__(self, head: SimHead, now: Callable[[], float]) -> None:
        self._head = head
        self._now = now
        self._goal = HeadPose()
        self._zoom = _ZOOM
        self.broken = False

    def listing(self) -> Sequence[dict[str, int | str]]:
        """Pan, tilt and zoom. Raises ConnectionError while broken."""
        self._check()
        pose = self._head.read(self._now())
        return (
            _control("Pan, Absolute", PAN_ABSOLUTE, -PAN_LIMIT, PAN_LIMIT, -pose.pan),
            _control("Tilt, Absolute", TILT_ABSOLUTE, -TILT_DOWN_LIMIT, TILT_UP_LIMIT, -pose.tilt),
            _described("Zoom, Absolute", ZOOM_ABSOLUTE, 100, 400, 1, _ZOOM, self._zoom),
        )

    def set(self, control: int, value: int) -> bool:
        """Go there. Raises ConnectionError while broken."""
        self._check()
        if control == ZOOM_ABSOLUTE:
            self._zoom = min(max(value, 100), 400)
            return True
        angle = -math.radians(round(value / STEP) * STEP / 3600)
        if control == PAN_ABSOLUTE:
            wanted = HeadPose(angle, self._goal.tilt)
        elif control == TILT_ABSOLUTE:
            wanted = HeadPose(self._goal.pan, angle)
        else:
            return False
        self._goal = self._head.send(wanted, self._now())
        return True

    def _check(self) -> None:
        if self.broken:
            raise ConnectionError("the camera does not answer")


def _control(name: str, number: int, low: float, high: float, value: float) -> dict[str, int | str]:
    """An angle's control; low, high and value in radians."""
    return _described(name, number, _arc_seconds(low), _arc_seconds(high), STEP, 0, _arc_seconds(value))


def _described(
    name: str, number: int, low: int, high: int, step: int, default: int, value: int
) -> dict[str, int | str]:
    return {
        "name": name, "id": number, "type": _INTEGER, "min": low, "max": high, "step": step,
        "default": default, "value": value, "dest": 0, "flags": 0, "group": _GROUP,
    }  # fmt: skip


def _arc_seconds(radians: float) -> int:
    return round(math.degrees(radians) * 3600)
