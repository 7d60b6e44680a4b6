"""How far a head turns."""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import Final

from robot.messages import HeadPose


@dataclass(frozen=True, slots=True)
class HeadLimits:
    """Largest angles in radians (pan to either side, tilt up, tilt down) and the servos' rate in rad/s."""

    pan: float = math.radians(80.0)
    tilt_up: float = math.radians(20.0)
    tilt_down: float = math.radians(50.0)
    rate: float = math.radians(180.0)

    def applied(self, pose: HeadPose) -> HeadPose:
        """The nearest pose within the limits; an angle that is no number becomes 0.

        >>> HeadLimits(pan=1.0).applied(HeadPose(pan=3.0, tilt=math.nan))
        HeadPose(pan=1.0, tilt=0.0)
        """
        return HeadPose(
            _within(pose.pan, -self.pan, self.pan), _within(pose.tilt, -self.tilt_up, self.tilt_down)
        )


DEFAULT_LIMITS: Final = HeadLimits()


def _within(value: float, low: float, high: float) -> float:
    return 0.0 if math.isnan(value) else max(low, min(high, value))
