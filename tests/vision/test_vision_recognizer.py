"""Recognition: found at all ranges and in other light, nothing found where the target is not."""

from __future__ import annotations

import cv2
import numpy as np
import pytest
import skimage.data

from robot.messages import Box, Image
from robot.vision.colour import LAYOUT_LENGTH, ColourSums, layout_similarity
from robot.vision.nmf_objectives import EUCLIDEAN
from robot.vision.prepared_view import FlatViewError
from robot.vision.recognizer import Recognizer
from robot.vision.recognizer_training import in_other_light, learn_judge, look_alike, shape_groups
from robot.vision.textures import texture
from robot.vision.view_matching import Evidence, Judge
from robot.vision.viewspace import ViewSpace, window_size
from robot.vision.windows import crop, grey_of, local_mean_std, suppress_overlaps, windows_near


def printed(seed: int) -> Image:
    """A label of 4 x 3 fields in strong colours, 120 x 160 px."""
    fields = np.random.default_rng(seed).integers(0, 256, (4, 3, 3), np.uint8)
    return cv2.resize(fields, (120, 160), interpolation=cv2.INTER_NEAREST)


SIDES = [printed(seed) for seed in (1, 2)]
OTHERS = [printed(seed) for seed in (3, 4)]


def wall(seed: int) -> Image:
    return texture((352, 288), np.random.default_rng(seed))


def seen(sides: list[Image], turn: float, height: int) -> Image:
    """A two-sided upright board turned by `turn` radians, `height` px tall; it narrows as it turns."""
    side = sides[int(np.cos(turn) < 0)]
    width = max(6, round(height * 0.75 * max(abs(np.cos(turn)), 0.6)))
    return cv2.resize(side, (width, height), interpolation=cv2.INTER_AREA)


def before_wall(view: Image, u: int, v: int, seed: int) -> tuple[Image, Box]:
    picture = wall(seed)
    picture[v : v + view.shape[0], u : u + view.shape[1]] = view
    light = in_other_light(picture, np.random.default_rng(seed))
    return light, Box(u, v, view.shape[1], view.shape[0])


@pytest.fixture(scope="module")
def recognizer() -> Recognizer:
    views = [
        seen(SIDES, turn, (60, 100, 150)[k % 3])
        for k, turn in enumerate(np.linspace(0, 2 * np.pi, 24, endpoint=False))
    ]
    rng = np.random.default_rng(0)
    lit = [in_other_light(view, rng) for view in views]
    return Recognizer.fit(lit, [wall(seed) for seed in range(900, 920)], "board", seed=0)


@pytest.mark.parametrize("height", [20, 28, 45, 80, 130, 165])
def test_the_target_is_found_at_every_range(recognizer: Recognizer, height: int) -> None:
    for seed, turn in ((1, 0.15), (2, 2.9)):
        picture, box = before_wall(seen(SIDES, turn, height), 90 + 20 * seed, 60, seed)
        found = recognizer.predict(picture)
        assert found, f"nothing found at {height} px, turn {turn}"
        assert found[0].box.iou(box) > 0.6
        assert found[0].label == "board"
        assert 0.5 <= found[0].score <= 1.0


def test_nothing_is_found_where_the_target_is_not(recognizer: Recognizer) -> None:
    for seed in range(20, 30):
        assert recognizer.predict(wall(seed)) == []
    for picture in (skimage.data.astronaut(), skimage.data.coffee(), skimage.data.chelsea()):
        assert recognizer.predict(cv2.resize(picture[..., ::-1], (352, 288))) == []


def test_a_look_alike_of_the_same_shape_with_another_print_is_refused(recognizer: Recognizer) -> None:
    for seed in range(6):
        picture, box = before_wall(seen(OTHERS, 0.5 * seed, 60 + 15 * seed), 120, 70, seed)
        assert recognizer.predict(picture) == []
        assert recognizer.score(picture, box) < 0.5


def test_black_white_and_grey_pictures_hold_nothing(recognizer: Recognizer) -> None:
    for value in (0, 128, 255):
        assert recognizer.predict(np.full((288, 352, 3), value, np.uint8)) == []
        assert recognizer.score(np.full((288, 352, 3), value, np.uint8), Box(100, 100, 60, 80)) < 0.5


def test_one_box_is_confirmed_or_refused_though_it_is_a_little_off(recognizer: Recognizer) -> None:
    picture, box = before_wall(seen(SIDES, 0.1, 70), 140, 90, 3)
    near = Box(box.x + 4, box.y - 4, box.w * 1.1, box.h * 1.1)
    assert recognizer.score(picture, box) > 0.5
    assert recognizer.score(picture, near) > 0.5
    assert recognizer.score(picture, Box(20, 10, box.w, box.h)) < 0.5
    assert recognizer.refine(picture, near).box.iou(box) > near.iou(box)


def test_boxes_beyond_the_border_are_no_error(recognizer: Recognizer) -> None:
    picture, _ = before_wall(seen(SIDES, 0.1, 70), 140, 90, 4)
    for box in (Box(-30, -30, 60, 80), Box(340, 280, 60, 80), Box(-500, 100, 40, 60), Box(0, 0, 352, 288)):
        assert 0.0 <= recognizer.score(picture, box) <= 1.0


def test_two_targets_give_two_detections_best_first(recognizer: Recognizer) -> None:
    picture, first = before_wall(seen(SIDES, 0.1, 90), 40, 90, 5)
    second = Box(240, 120, 60, 80)
    picture[120:200, 240:300] = seen(SIDES, 0.0, 80)
    found = recognizer.predict(picture)
    assert len(found) == 2
    assert {max((0, 1), key=lambda i, b=b: found[i].box.iou(b)) for b in (first, second)} == {0, 1}
    assert found[0].score >= found[1].score


def test_a_part_of_the_target_is_not_detected_beside_the_whole(recognizer: Recognizer) -> None:
    for seed in range(8):
        picture, box = before_wall(seen(SIDES, 0.1 + 3 * (seed % 2), 150), 100, 60, 40 + seed)
        found = recognizer.predict(picture)
        assert [detection.box.iou(box) > 0.6 for detection in found] == [True]


def test_only_the_wanted_heights_are_searched(recognizer: Recognizer) -> None:
    picture, box = before_wall(seen(SIDES, 0.1, 120), 140, 90, 6)
    assert recognizer.predict(picture, heights_px=[120.0])[0].box.iou(box) > 0.6
    assert recognizer.predict(picture, heights_px=[25.0]) == []
    assert recognizer.predict(picture, heights_px=[]) == []


def test_pictures_too_small_for_any_window_hold_nothing(recognizer: Recognizer) -> None:
    assert recognizer.predict(np.zeros((5, 5, 3), np.uint8)) == []


def test_arrays_carry_everything(recognizer: Recognizer) -> None:
    again = Recognizer.from_arrays("board", recognizer.arrays())
    picture, _ = before_wall(seen(SIDES, 0.1, 70), 140, 90, 3)
    assert again.predict(picture) == recognizer.predict(picture)
    broken = recognizer.arrays()
    del broken["0.fine.columns"]
    with pytest.raises(KeyError):
        Recognizer.from_arrays("board", broken)
    for key in ("0.layouts", "0.coarse.gauge", "0.fine.columns"):
        with pytest.raises(ValueError, match="fit"):
            Recognizer.from_arrays("board", recognizer.arrays() | {key: np.zeros((3, 4), np.float32)})


def test_the_same_views_and_seed_teach_the_same() -> None:
    views = [seen(SIDES, turn, 80) for turn in np.linspace(0, 6, 8)]
    first, second = (Recognizer.fit(views, [wall(1)], "x", seed=3).arrays() for _ in range(2))
    assert all(first[key].tobytes() == second[key].tobytes() for key in first)


def test_what_cannot_be_learnt_is_refused() -> None:
    with pytest.raises(ValueError, match="at least 4 views"):
        Recognizer.fit([SIDES[0]] * 3, [], "x", seed=0)
    with pytest.raises(FlatViewError):
        Recognizer.fit([np.full((60, 40, 3), 99, np.uint8)] * 4, [], "x", seed=0)


# ------------------------------------------------------------------------------------------ the pieces


def test_scanning_by_filtering_equals_comparing_every_window() -> None:
    views = [grey_of(seen(SIDES, turn, 80)) for turn in np.linspace(0, 6, 10)]
    space = ViewSpace.learn(views, (8, 11), 5, 0, EUCLIDEAN)
    grey = cv2.resize(grey_of(wall(8)), (40, 30), interpolation=cv2.INTER_AREA)
    values = space.similarity_map(grey)
    assert values.shape == (30 - 11 + 1, 40 - 8 + 1)
    for y, x in ((0, 0), (7, 20), (19, 32)):
        window = grey[y : y + 11, x : x + 8].ravel().astype(float)
        unit = (window - window.mean()) / window.std()
        assert values[y, x] == pytest.approx(float((space.gauge @ (space.inverse @ unit)).max()), abs=1e-3)


def test_a_views_own_window_has_similarity_near_one_and_a_flat_one_has_none() -> None:
    views = [grey_of(seen(SIDES, turn, 80)) for turn in np.linspace(0, 6, 10)]
    space = ViewSpace.learn(views, (8, 11), 5, 0, EUCLIDEAN)
    own = cv2.resize(views[0], (8, 11), interpolation=cv2.INTER_AREA)
    assert space.similarity_map(own)[0, 0] > 0.85
    assert space.similarity_map(np.full((20, 20), 70.0, np.float32)).max() == -1.0
    prepared, textured = space.prepared(np.stack([own.ravel(), np.full(88, 70.0, np.float32)]))
    assert textured.tolist() == [True, False]
    assert space.correlation(prepared)[0].max() > 0.999
    assert space.encoding_similarity(prepared)[0].max() > 0.999


def test_local_statistics_are_those_of_every_window() -> None:
    grey = np.random.default_rng(0).uniform(0, 255, (20, 30)).astype(np.float32)
    mean, std = local_mean_std(grey, (7, 5))
    assert mean.shape == std.shape == (16, 24)
    assert mean[3, 4] == pytest.approx(grey[3:8, 4:11].mean(), rel=1e-4)
    assert std[3, 4] == pytest.approx(grey[3:8, 4:11].std(), rel=1e-4)


def test_windows_near_a_box_lie_where_they_say() -> None:
    ramp = np.add.outer(np.arange(100.0), 1000 * np.arange(120.0)).astype(np.float32)
    stack = windows_near(ramp, Box(40, 30, 20, 30), (10, 15), (1.0,), 2)
    assert len(stack.pixels) == len(stack.boxes) == 25
    for pixels, (x, y, w, h) in zip(stack.pixels, stack.boxes, strict=True):
        assert pixels.mean() == pytest.approx(1000 * (x + w / 2 - 0.5) + y + h / 2 - 0.5, rel=2e-3)


def test_crops_repeat_the_rim() -> None:
    picture = np.arange(12, dtype=np.uint8).reshape(3, 4)
    np.testing.assert_array_equal(crop(picture, -1, -1, 3, 2), [[0, 0, 1], [0, 0, 1]])
    np.testing.assert_array_equal(crop(picture, 2, 1, 4, 4)[-1], [10, 11, 11, 11])
    assert crop(picture, 50, 50, 2, 3).tolist() == [[11, 11]] * 3
    assert crop(picture, -50, 1, 2, 1).tolist() == [[4, 4]]


def test_suppression_keeps_the_best_of_every_place() -> None:
    boxes = np.array([[0, 0, 10, 10], [1, 0, 10, 10], [30, 0, 10, 10.0]])
    assert suppress_overlaps(boxes, np.array([0.5, 0.9, 0.7]), 0.3, 9) == [1, 2]
    assert suppress_overlaps(boxes, np.array([0.5, 0.9, 0.7]), 0.3, 1) == [1]
    assert suppress_overlaps(np.empty((0, 4)), np.empty(0), 0.3, 9) == []


@pytest.mark.parametrize("gain", [0.35, 0.6, 1.0])
def test_the_colour_layout_survives_brightness_but_not_another_print(gain: float) -> None:
    whole = np.array([[0.0, 0.0, 120.0, 160.0]])
    own, other = (ColourSums(side).layouts(whole) for side in (SIDES[0], OTHERS[1]))
    darker = ColourSums(cv2.convertScaleAbs(SIDES[0], alpha=gain)).layouts(whole)
    assert own.shape == (1, LAYOUT_LENGTH)
    assert layout_similarity(darker, own)[0, 0] > 0.93
    assert layout_similarity(own, other)[0, 0] < 0.8
    assert layout_similarity(own, -own)[0, 0] < -0.3


def test_colour_cells_are_means_of_their_pixels() -> None:
    picture = np.random.default_rng(0).integers(0, 255, (40, 30, 3), np.uint8)
    layout = ColourSums(picture).layouts(np.array([[6.0, 8.0, 12.0, 16.0]]))[0]
    blue, green, _ = picture[8:10, 6:8].reshape(-1, 3).mean(axis=0) + 6.0
    assert layout[0] == pytest.approx(np.log(blue / green), abs=1e-5)
    outside = ColourSums(picture).layouts(np.array([[-90.0, -90.0, 12.0, 16.0], [99.0, 99.0, 0.5, 0.5]]))
    assert np.isfinite(outside).all()


def test_views_are_grouped_by_shape() -> None:
    def view(width: int) -> Image:
        return np.zeros((100, width, 3), np.uint8)

    assert shape_groups([view(w) for w in (60, 62, 58)]) == [[0, 1, 2]]
    groups = shape_groups([view(w) for w in (40, 100, 42, 98, 63)])
    assert groups == [[0, 2], [4], [1, 3]]
    assert window_size(2.0, 200) == (20, 10)


def test_the_threshold_separates_and_no_evidence_counts_against() -> None:
    rng = np.random.default_rng(0)
    good = [Evidence(*row) for row in rng.normal((0.9, 0.9, 0.5), 0.03, (60, 3))]
    bad = [Evidence(*row) for row in rng.normal((0.7, 0.5, 0.6), 0.05, (400, 3))]
    judge = learn_judge(good, bad)
    assert min(judge.weights) >= 0.0
    assert max(judge.score(evidence) for evidence in bad) < 0.5
    assert np.mean([judge.score(evidence) > 0.5 for evidence in good]) > 0.9
    assert np.median([judge.score(evidence) for evidence in good]) == pytest.approx(0.9, abs=0.02)
    assert Judge((1e3, 0.0, 0.0), 0.0).score(Evidence(1.0, 0.0, 0.0)) == pytest.approx(1.0)


def test_look_alikes_keep_the_shape_and_change_the_print() -> None:
    rng = np.random.default_rng(0)
    for _ in range(6):
        other = look_alike(SIDES[0], rng)
        assert other.shape == SIDES[0].shape
        assert np.abs(other.astype(int) - SIDES[0]).mean() > 5
