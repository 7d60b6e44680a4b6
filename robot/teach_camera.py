"""Teaching from the robot's own eyes: a person holds the object before them and turns it.

Depth says which pixels are the object's (`robot.vision.held_object`). A view is kept every third of a second;
what hinders is told in words, as it changes.
"""

from __future__ import annotations

from collections.abc import Callable, Iterator
from dataclasses import dataclass

from calib.model import StereoRig
from robot.clock import Clock
from robot.hal.interfaces import StereoCamera
from robot.teach_views import TeachingView
from robot.vision.disparity import Matcher
from robot.vision.held_object import HeldObject, held_object

BETWEEN_S = 0.33
"""From view to view: the object is to have turned a little."""
STILL_S = 3.0
"""Without a new pair for so long the eyes have stopped."""


@dataclass(frozen=True, slots=True)
class Sitting:
    """How long it takes at most: views kept, seconds."""

    views: int = 60
    seconds: float = 60.0


def views_from_camera(
    camera: StereoCamera,
    rig: StereoRig,
    matcher: Matcher,
    clock: Clock,
    pause: Callable[[], bool],
    say: Callable[[str], None],
    sitting: Sitting = Sitting(),
) -> Iterator[TeachingView]:
    """Views of what is held before a rectified camera, with masks and depths, until the sitting is over.

    pause: waits until there may be a new pair; False ends the sitting. say: told what the person should know.
    """
    say("hold the object 0.3 to 0.8 m before the eyes and turn it slowly, also nearer and farther")
    begun = now = fresh_at = clock.now()
    newest, kept_at, kept, said = -1, begun - BETWEEN_S, 0, ""
    while kept < sitting.views and now - begun < sitting.seconds and now - fresh_at < STILL_S:
        frame = camera.latest(now)
        if frame is not None and frame.seq != newest and now - kept_at >= BETWEEN_S:
            newest, fresh_at = frame.seq, now
            found = held_object(matcher(frame.left, frame.right), rig)
            if isinstance(found, HeldObject):
                kept, kept_at, said = kept + 1, now, ""
                yield TeachingView(frame.left, found.box, found.depth_m, found.mask)
            elif found.words != said:
                said = found.words
                say(said)
        if not pause():
            return
        now = clock.now()
