"""Looking from picture to picture, and the target's range held against its size."""

import math

import numpy as np
import pytest

from calib.model import HeadMount, StereoRig
from robot.looker import REMEMBERED, Looker
from robot.messages import Box, Detection, HeadPose, Pose2, Range, StereoFrame, View
from robot.target_range import TargetRanger

RIG = StereoRig.parallel(352, 288, 305.0, 0.06)
MOUNT = HeadMount()
HEIGHT = 0.22


def textured(seed=0):
    return np.repeat(np.random.default_rng(seed).integers(0, 255, (288, 480, 1), np.uint8), 3, axis=2)


def view(at=0.0, pan=0.0, tilt=0.0, yaw=0.0, disparity=20, blank=False):
    """A wall seen by both eyes at one disparity."""
    wall = np.full((288, 480, 3), 90, np.uint8) if blank else textured()
    left, right = wall[:, 100 : 100 + 352], wall[:, 100 + disparity : 100 + disparity + 352]
    frame = StereoFrame(np.ascontiguousarray(left), np.ascontiguousarray(right), at, round(at * 25))
    return View(frame, HeadPose(pan, tilt), Pose2(0, 0, yaw))


def box_of_height(height_px, u=176.0, v=144.0):
    return Box(u - height_px / 3, v - height_px / 2, 2 * height_px / 3, height_px)


class ScriptedRecognizer:
    """Finds what the script says; judges every box it is asked about with `refined`."""

    def __init__(self, *script, refined=0.0):
        self.script = list(script)
        self.refined = refined
        self.heights = []
        self.asked = []

    def predict(self, image, heights_px=None):
        self.heights.append(tuple(heights_px))
        return list(self.script.pop(0)) if self.script else []

    def refine(self, image, box):
        self.asked.append(box)
        return Detection(box, self.refined, "cup")

    def score(self, image, box):
        return self.refined


def looker(recognizer, height_m=None):
    return Looker(RIG, recognizer, TargetRanger(RIG, MOUNT, height_m))


def found(box, score=0.8):
    return Detection(box, score, "cup")


def test_each_detection_knows_the_direction_it_was_seen_in():
    (seen,) = looker(ScriptedRecognizer([found(box_of_height(60, u=100))])).look(view(pan=0.3, yaw=0.2))
    assert seen.azimuth == pytest.approx(0.5 + math.atan2(75.5, 305.0))


def test_sizes_alternate_from_look_to_look():
    recognizer = ScriptedRecognizer()
    eye = looker(recognizer)
    for k in range(4):
        eye.look(view(0.1 * k))
    first, second, third, _ = recognizer.heights
    assert first == third != second


def test_a_missed_candidate_is_judged_again_where_the_turned_head_must_see_it():
    recognizer = ScriptedRecognizer([found(box_of_height(60))], [], refined=0.7)
    eye = looker(recognizer)
    eye.look(view(0.0))
    (again,) = eye.look(view(0.2, pan=0.1, tilt=0.05))
    assert again.score == 0.7
    (asked,) = recognizer.asked
    assert asked.centre[0] == pytest.approx(176 + 305 * math.tan(0.1)), "a left turn moves things right"
    assert asked.centre[1] == pytest.approx(144 - 305 * math.tan(0.05)), "looking down moves things up"


def test_it_is_not_judged_again_when_unlike_old_or_out_of_the_picture():
    unlike = ScriptedRecognizer([found(box_of_height(60))], [], refined=0.4)
    eye = looker(unlike)
    eye.look(view(0.0))
    assert eye.look(view(0.2)) == ()
    for later in (view(REMEMBERED + 0.1), view(0.2, pan=0.7)):
        recognizer = ScriptedRecognizer([found(box_of_height(60))], [], refined=0.9)
        eye = looker(recognizer)
        eye.look(view(0.0))
        assert eye.look(later) == ()


def test_a_print_of_the_wrong_size_is_no_candidate():
    true_height = 305 * HEIGHT / (305 * 0.06 / 20)
    for factor, kept in ((1.0, 1), (0.4, 0), (2.2, 0)):
        recognizer = ScriptedRecognizer([found(box_of_height(factor * true_height))])
        assert len(looker(recognizer, HEIGHT).look(view())) == kept


def test_where_the_distance_cannot_be_told_the_size_cannot_either():
    recognizer = ScriptedRecognizer([found(box_of_height(30))])
    assert len(looker(recognizer, HEIGHT).look(view(blank=True))) == 1


class TestTargetRanger:
    def test_stereo_counts_where_it_fits(self):
        box = box_of_height(73.3)
        measured = TargetRanger(RIG, MOUNT, HEIGHT).measure(view(), box)
        assert measured.method == "stereo"
        assert measured.distance == pytest.approx(305 * 0.06 / 20, rel=0.01)

    def test_size_helps_out_where_one_eye_cannot_see_it(self):
        box = box_of_height(61.0)
        measured = TargetRanger(RIG, MOUNT, HEIGHT).measure(view(blank=True), box)
        assert measured.method == "size"
        assert measured.distance == pytest.approx(1.1, rel=0.001)
        assert measured.sigma == pytest.approx(0.11, rel=0.001)

    def test_a_box_cut_by_the_rim_tells_no_distance_by_its_size(self):
        assert TargetRanger(RIG, MOUNT, HEIGHT).measure(view(blank=True), Box(150, 0, 40, 61)) is None

    def test_without_a_known_height_only_stereo_counts(self):
        ranger = TargetRanger(RIG, MOUNT)
        assert ranger.measure(view(blank=True), box_of_height(61.0)) is None
        assert ranger.fits(box_of_height(5.0), Range(1.0, 0.1, (1, 0, 0), 18.3))
        assert ranger.plausible(view(), box_of_height(5.0))
