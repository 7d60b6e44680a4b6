"""Taught objects are found where they are, at their size, half hidden, in other light; nothing else is."""

import cv2
import numpy as np
import pytest

from robot.messages import Box
from robot.vision.fern_learning import places_of
from robot.vision.ferns import FernDetector, FernSettings, Sample

SIZE = (176, 144)
OBJECT = (60, 80)


def clutter(seed, size=SIZE):
    """Blobs, edges and fine grain, as rooms have them."""
    rng = np.random.default_rng(seed)
    coarse = cv2.resize(rng.integers(30, 200, (9, 11), np.uint8), size, interpolation=cv2.INTER_CUBIC)
    for _ in range(12):
        x, y = rng.integers(0, size[0] - 20), rng.integers(0, size[1] - 20)
        shade = int(rng.integers(20, 220))
        cv2.rectangle(
            coarse, (int(x), int(y)), (int(x + rng.integers(8, 60)), int(y + rng.integers(8, 50))), shade, -1
        )
    return np.clip(coarse + rng.normal(0, 3, coarse.shape), 0, 255).astype(np.uint8)


def poster(seed):
    rng = np.random.default_rng([seed, 9])
    return cv2.resize(rng.integers(0, 255, (8, 6), np.uint8), OBJECT, interpolation=cv2.INTER_LINEAR)


NEGATIVES = [clutter(seed) for seed in range(6)]


@pytest.fixture(scope="module")
def detector():
    samples = [Sample(poster(k), Box(0, 0, *OBJECT), f"poster{k}") for k in (1, 2) for _ in range(3)]
    return FernDetector.fit(samples, NEGATIVES, seed=0)


def shown(which, place, seed=20, size=1.0):
    picture = clutter(seed)
    view = cv2.resize(poster(which), None, fx=size, fy=size, interpolation=cv2.INTER_AREA)
    x, y = place
    picture[y : y + view.shape[0], x : x + view.shape[1]] = view
    return picture, Box(x, y, view.shape[1], view.shape[0])


def test_pixels_that_vote_for_a_known_box_lie_in_it(detector):
    picture, true = shown(1, (70, 30))
    inside = np.zeros(picture.shape, np.bool_)
    inside[30:110, 70:130] = True
    mine = detector.support(picture, "poster1", true)
    assert (mine & inside).sum() / (mine | inside).sum() > 0.6
    beside = detector.support(picture, "poster1", Box(10, 60, 50, 70))
    assert (beside & inside).sum() < 0.3 * inside.sum()
    with pytest.raises(ValueError, match="empty box"):
        detector.support(picture, "poster1", Box(10, 10, 0, 20))


@pytest.mark.parametrize("which", [1, 2])
@pytest.mark.parametrize(("place", "size"), [((70, 30), 1.0), ((20, 50), 0.85), ((60, 8), 1.5)])
def test_each_of_two_objects_is_found_at_its_place_and_size(detector, which, place, size):
    picture, true = shown(which, place, size=size)
    best = detector.predict(picture)[0]
    assert best.label == f"poster{which}"
    assert best.box.iou(true) > 0.75
    assert best.score > 0.6
    inside = np.zeros(picture.shape, np.bool_)
    inside[int(true.y) : int(true.y + true.h), int(true.x) : int(true.x + true.w)] = True
    assert (best.support & inside).sum() / (best.support | inside).sum() > 0.6


def test_what_was_not_taught_scores_far_less(detector):
    empty = [detector.predict(clutter(seed), least_score=0.0)[0].score for seed in range(30, 36)]
    other = [detector.predict(shown(which, (50, 40))[0], least_score=0.0)[0].score for which in (5, 6)]
    taught = [detector.predict(shown(which, (50, 40))[0])[0].score for which in (1, 2)]
    assert max(*empty, *other) < 0.6 * min(taught)


@pytest.mark.parametrize(
    "hidden", [np.s_[:40], np.s_[40:], (slice(None), np.s_[:30]), (slice(None), np.s_[30:])]
)
def test_an_object_half_hidden_is_found(detector, hidden):
    picture, true = shown(1, (70, 30))
    picture[30:110, 70:130][hidden] = clutter(50)[:80, :60][hidden]
    best = detector.predict(picture)[0]
    assert best.label == "poster1"
    assert best.box.iou(true) > 0.5


@pytest.mark.parametrize("gain", [0.25, 0.5, 1.3])
def test_other_light_changes_little(detector, gain):
    picture, true = shown(2, (60, 40))
    lit = np.clip(picture * gain, 0, 255).astype(np.uint8)
    best = detector.predict(lit)[0]
    assert best.label == "poster2"
    assert best.box.iou(true) > 0.7


def test_two_of_a_kind_are_two_detections_and_parts_of_them_none(detector):
    picture, first = shown(1, (5, 30))
    second = Box(105, 40, *OBJECT)
    picture[40:120, 105:165] = poster(1)
    found = [f for f in detector.predict(picture) if f.label == "poster1" and f.score > 0.5]
    assert len(found) == 2
    assert all(max(f.box.iou(first), f.box.iou(second)) > 0.7 for f in found)


def test_colour_pictures_are_as_good_as_grey_ones(detector):
    picture, true = shown(1, (70, 30))
    best = detector.predict(cv2.cvtColor(picture, cv2.COLOR_GRAY2BGR))[0]
    assert best.box.iou(true) > 0.75


def test_a_partial_fit_adds_a_class_and_leaves_the_first_detector_as_it_is(detector):
    more = detector.partial_fit([Sample(poster(3), Box(0, 0, *OBJECT), "new")] * 3, NEGATIVES[:1], seed=1)
    picture, _ = shown(3, (70, 30))
    assert more.predict(picture)[0].label == "new"
    assert set(detector.classes) == {"poster1", "poster2"}
    again, _ = shown(1, (70, 30))
    assert more.predict(again)[0].label == "poster1"


def test_the_same_seed_finds_the_same(detector):
    samples = [Sample(poster(k), Box(0, 0, *OBJECT), f"poster{k}") for k in (1, 2) for _ in range(3)]
    same = FernDetector.fit(samples, NEGATIVES, seed=0)
    picture, _ = shown(1, (33, 44))
    one, other = detector.predict(picture)[0], same.predict(picture)[0]
    assert (one.box, one.score, one.label) == (other.box, other.score, other.label)
    assert (one.support == other.support).all()


def test_a_mask_s_outside_is_not_learnt():
    """The object lies on plain ground in all views: on another ground it is found all the same."""
    ground = np.full((110, 90), 230, np.uint8)
    ground[15:95, 15:75] = poster(4)
    mask = np.zeros(ground.shape, np.bool_)
    mask[15:95, 15:75] = True
    sample = Sample(ground, Box(15, 15, *OBJECT), "cut", mask)
    detector = FernDetector.fit([sample] * 3, NEGATIVES, seed=0)
    picture, true = shown(4, (70, 30))
    assert detector.predict(picture)[0].box.iou(true) > 0.75
    places = places_of(ground, sample.box, mask, NEGATIVES, 48, 2, np.random.default_rng(0))
    assert len(places) == 3
    assert not any((place.image[:6] > 225).all() for place in places)


# --- bad input ---


def test_what_cannot_be_learnt_is_named():
    sample = Sample(poster(1), Box(0, 0, *OBJECT), "x")
    with pytest.raises(ValueError, match="needs samples"):
        FernDetector.fit([], NEGATIVES)
    with pytest.raises(ValueError, match="needs samples"):
        FernDetector.fit([sample], [])
    outside = Sample(poster(1), Box(500, 500, 40, 40), "x")
    with pytest.raises(ValueError, match="at least 4 px of its image"):
        FernDetector.fit([outside], NEGATIVES)


@pytest.mark.parametrize("shape", [(144, 176), (8, 8), (1, 300), (300, 1)])
@pytest.mark.parametrize("shade", [0, 255])
def test_pictures_without_anything_hold_nothing(detector, shape, shade):
    assert detector.predict(np.full(shape, shade, np.uint8)) == []


def test_settings_are_kept_within_bounds():
    with pytest.raises(ValueError, match="bits"):
        FernDetector.fit(
            [Sample(poster(1), Box(0, 0, *OBJECT), "x")], NEGATIVES, settings=FernSettings(bits=20)
        )


@pytest.mark.parametrize("which", [1, 2])
def test_the_vote_map_is_highest_at_the_objects_middle(detector, which):
    picture, true = shown(which, (70, 30))
    votes = detector.vote_map(picture, f"poster{which}")
    assert votes.shape == picture.shape
    row, column = np.unravel_index(int(votes.argmax()), votes.shape)
    assert (column, row) == (pytest.approx(true.centre[0], abs=5), pytest.approx(true.centre[1], abs=5))
    assert votes.max() == pytest.approx(detector.predict(picture)[0].score, rel=0.15)
    other = detector.vote_map(picture, f"poster{3 - which}")
    assert other.max() < 0.6 * votes.max()
    with pytest.raises(KeyError):
        detector.vote_map(picture, "cup")


def test_a_detector_comes_back_from_its_arrays(detector):
    again = FernDetector.from_arrays(["poster1", "poster2"], detector.arrays())
    picture, _ = shown(2, (70, 30))
    first, second = (one.predict(picture) for one in (detector, again))
    assert [(d.label, d.box, d.score) for d in first] == [(d.label, d.box, d.score) for d in second]
    more = again.partial_fit([Sample(poster(3), Box(0, 0, *OBJECT), "poster3")] * 2)
    assert set(more.classes) == {"poster1", "poster2", "poster3"}, "it goes on learning"
