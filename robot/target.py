"""The target as perception knows it: tracker, range and last place, joined into one estimate a frame."""

from __future__ import annotations

import math
from dataclasses import dataclass

from calib.model import StereoRig
from robot.looker import Recognizes
from robot.messages import Box, Detection, Range, Track, View, wrap
from robot.target_range import TargetRanger
from robot.vision.tracker import OnlineTracker

CONFIRM_EVERY = 0.4  # seconds of picture time between looks of the recogniser at the tracked box
DOUBTS_ALLOWED = 3  # so many looks in a row may fail before the track counts as lost


@dataclass(frozen=True, slots=True)
class TargetSight:
    """One frame's word on the target: its track, its range if one could be measured."""

    track: Track
    range: Range | None


class TargetFollower:
    """Follows the target from a first detection on; the recogniser looks at the box now and then."""

    def __init__(self, rig: StereoRig, recognizer: Recognizes, ranger: TargetRanger) -> None:
        self._rig = rig
        self._recognizer = recognizer
        self._ranger = ranger
        self._tracker: OnlineTracker | None = None
        self._lost = False

    @property
    def active(self) -> bool:
        """True if there is something being followed."""
        return self._tracker is not None

    @property
    def box(self) -> Box | None:
        """Where the target was in the last view; None before the first or while it is lost."""
        return self._box if self.following else None

    @property
    def following(self) -> bool:
        """True if the target was still held in the last view."""
        return self._tracker is not None and not self._lost

    def start(self, view: View, detection: Detection) -> None:
        """Follow what was detected in this view."""
        self._tracker = OnlineTracker()
        self._tracker.start(view.frame.left, detection.box)
        self._lost = False
        self._box: Box | None = detection.box
        self._last_view = view
        self._confirmed_at = view.frame.captured_at
        self._doubts = 0
        self._distance: float | None = None
        self._closing = 1.0

    def drop(self) -> None:
        """Follow nothing any more."""
        self._tracker = None

    def update(self, view: View) -> TargetSight | None:
        """Find the target again in a newer view; None if nothing is followed."""
        if self._tracker is None:
            return None
        shift = self._shift(view)
        track = self._tracker.update(view.frame.left, scale=self._closing, shift=shift)
        self._last_view = view
        track = self._confirm(view, track)
        if track.lost:
            track = self._found_again(view, track)
        self._lost, self._box = track.lost, track.box
        if track.lost:
            return TargetSight(track, None)
        measured = self._ranger.measure(view, track.box)
        self._note_distance(measured)
        return TargetSight(track, measured)

    def _found_again(self, view: View, track: Track) -> Track:
        """A lost track taken up again if the recogniser is sure of the target where it must be by now.

        A glance at the floor or something passing before it loses the target for a moment; one look at its
        place costs a tenth of a search of the whole picture.
        """
        eye, image = self._rig.left, view.frame.left
        if track.box.clipped(eye.width, eye.height).area < 0.9 * track.box.area:
            return track
        judged = self._recognizer.refine(image, track.box)
        if judged.score < 0.5 or not self._ranger.plausible(view, judged.box):
            return track
        assert self._tracker is not None
        self._tracker.start(image, judged.box)
        self._doubts = 0
        self._confirmed_at = view.frame.captured_at
        return Track(judged.box, (0.0, 0.0), judged.score, lost=False)

    def _shift(self, view: View) -> tuple[float, float]:
        """How far the picture moved because head and base turned (left turn: things move right)."""
        before = self._last_view
        turned = wrap(view.head.pan - before.head.pan + view.base.yaw - before.base.yaw)
        nodded = view.head.tilt - before.head.tilt
        return self._rig.left.fx * math.tan(turned), -self._rig.left.fy * math.tan(nodded)

    def _note_distance(self, measured: Range | None) -> None:
        """Expected growth of the box in the next frame, from the last two distances."""
        if measured is None:
            self._closing = 1.0
            return
        if self._distance is not None:
            smoothed = 0.7 * self._distance + 0.3 * measured.distance
            self._closing = max(0.97, min(1.03, self._distance / smoothed))
            self._distance = smoothed
        else:
            self._distance = measured.distance

    def _confirm(self, view: View, track: Track) -> Track:
        """Let the recogniser look now and then; several doubts in a row end the track."""
        at = view.frame.captured_at
        if not track.lost and at - self._confirmed_at >= CONFIRM_EVERY:
            self._confirmed_at = at
            sure = self._recognizer.score(view.frame.left, track.box) >= 0.5
            sure = sure and self._ranger.plausible(view, track.box)
            self._doubts = 0 if sure else self._doubts + 1
        if self._doubts >= DOUBTS_ALLOWED:
            return Track(track.box, track.velocity_px, 0.0, lost=True)
        return track
