"""Teaching: which views are used, what is said about the others, and that the model works."""

from __future__ import annotations

from collections import Counter
from pathlib import Path

import cv2
import numpy as np
import pytest

from robot.errors import UserError
from robot.messages import Box, Image
from robot.teach import Lesson, drawn_negatives, found_words, teach, warnings_for, warnings_of
from robot.teach_sources import views_from_folder, views_from_video
from robot.teach_views import BLURRED, TeachingView, choose, fault_of, sharpness, view_of
from robot.vision.finder_training import Validation
from robot.vision.textures import texture
from robot.vision.window_training import TrainingPlan
from robot.vision.windows import grey_of


def printed(seed: int) -> Image:
    """A label of 5 x 4 fields in strong colours, 150 x 200 px."""
    fields = np.random.default_rng(seed).integers(0, 256, (5, 4, 3), np.uint8)
    return cv2.resize(fields, (150, 200), interpolation=cv2.INTER_NEAREST)


SHORT = TrainingPlan(30.0, places=1500, drawn=6)
SHORTEST = TrainingPlan(30.0, places=300, drawn=3, rounds=1)
"""Lessons of which less is asked than of one for the robot, and nothing."""

SIDES = [printed(50 + k) for k in range(3)]


def room(seed: int) -> Image:
    return texture((352, 288), np.random.default_rng(seed))


def view(k: int, height: int = 0, depth: float | None = None) -> TeachingView:
    """The k-th look at a three-sided object: side, size, light and place vary."""
    height = height or (60, 90, 130)[k % 3]
    side = np.roll(SIDES[k % len(SIDES)], 5 * k, axis=1)
    # The far edge shrinks as the side turns away.
    turn = 6 * (k % 5)
    corners = np.float32([[0, 0], [150, 2 * turn], [150, 200 - 2 * turn], [0, 200]])
    whole = np.float32([[0, 0], [150, 0], [150, 200], [0, 200]])
    turned = cv2.warpPerspective(
        side, cv2.getPerspectiveTransform(whole, corners), (150, 200), borderValue=90
    )
    small = cv2.resize(turned, (round(0.75 * height), height), interpolation=cv2.INTER_AREA)
    image = room(300 + k)
    x, y = 40 + 7 * (k % 12), 50
    image[y : y + height, x : x + small.shape[1]] = small
    gain = 1.0 - 0.04 * (k % 9)
    return TeachingView(cv2.convertScaleAbs(image, alpha=gain), Box(x, y, small.shape[1], height), depth)


def blurred(v: TeachingView) -> TeachingView:
    return TeachingView(cv2.GaussianBlur(v.image_bgr, (0, 0), v.box.h / 8), v.box)


@pytest.fixture(scope="module")
def lesson(once) -> Lesson:
    views = [view(k, depth=305 * 0.22 / (60, 90, 130)[k % 3]) for k in range(30)]
    told = {"focal_px": 305.0, "created_from": "30 views"}
    return once.value("lesson", lambda: teach(views, "box", seed=0, lesson=SHORT, **told))


def test_the_taught_model_finds_its_target_and_nothing_else(lesson) -> None:
    new = view(31, 75)
    found = lesson.model.finder.predict(new.image_bgr)
    assert found[0].box.iou(new.box) > 0.6
    assert found[0].label == "box"
    assert lesson.model.finder.predict(room(999)) == []


def test_the_lesson_says_what_was_learnt(lesson) -> None:
    assert lesson.used == lesson.model.views == 30
    assert lesson.refused == {}
    assert lesson.model.name == "box"
    assert lesson.model.height_m == pytest.approx(0.22, rel=0.02)
    assert lesson.model.created_from == "30 views"
    assert lesson.contact_sheet.shape == (2 * 22 + 3 * 72, 10 * 72, 3), "two lines of words, three rows"
    assert lesson.contact_sheet.std() > 20
    preview = cv2.imdecode(np.frombuffer(lesson.model.preview_png, np.uint8), cv2.IMREAD_COLOR)
    assert preview.shape == (144, 144, 3)
    assert lesson.warnings == ()


def test_the_lesson_says_how_well_by_views_it_did_not_learn_from(lesson) -> None:
    told = lesson.validation
    assert (told.scenes, told.pictures) == (30, 60), "each view once, each picture without it once"
    assert told.recall > 0.7, "with 20 of the 30 views"
    assert 0.0 < told.half_recall <= told.recall
    assert told.false_alarms < 0.05
    assert found_words(told).startswith("cross-validated in other pictures")


def test_a_poor_cross_validation_is_warned_about() -> None:
    good, poor = Validation(0.95, 0.5, 0.0, 30, 60), Validation(0.4, 0.05, 0.5, 30, 60)
    assert warnings_of(good) == []
    first, second, third = warnings_of(poor)
    assert "only 40% of the views" in first
    assert "half hidden" in second
    assert "0.50 false alarms a picture" in third


def test_many_blurred_views_are_warned_about() -> None:
    views = [view(k) for k in range(9)]
    assert not any("blurred" in words for words in warnings_for(views, Counter({BLURRED: 2})))
    assert any("5 views are blurred" in words for words in warnings_for(views, Counter({BLURRED: 5})))


@pytest.fixture(scope="module")
def mixed(once) -> tuple[Lesson, list[tuple[int, str]]]:
    """A lesson from good views and views of no use, and what was told of it on the way."""
    good = [view(k) for k in range(9)]
    edge = TeachingView(good[0].image_bgr, Box(-30, 50, 60, 80))
    flat = TeachingView(np.full((100, 100, 3), 80, np.uint8), Box(10, 10, 50, 50))
    tiny = TeachingView(good[0].image_bgr, Box(60, 60, 20, 60))
    told: list[tuple[int, str]] = []
    views = [*good, good[3], good[4], blurred(good[2]), edge, flat, tiny]

    def tell(count: int, words: str) -> None:
        told.append((count, words))

    return once.value("mixed", lambda: (teach(views, "x", 4, tell, lesson=SHORTEST), told))


def test_every_refused_view_is_counted_with_its_reason(mixed) -> None:
    lesson, told = mixed
    assert lesson.used == 9
    assert sum(lesson.refused.values()) == 6
    counts = {why.split()[0]: number for why, number in lesson.refused.items()}
    assert counts == {"the": 2, "blurred": 1, "cut": 1, "without": 1, "smaller": 1}
    assert "9 views used, 2 refused: the same as another view" in lesson.summary()
    assert told[:2] == [(1, "looking at views"), (2, "looking at views")]
    assert told[-1] == (9, "done")


def test_too_few_views_name_the_reasons_and_the_cure() -> None:
    views = [view(0), view(1), *(blurred(view(k)) for k in range(2, 9))]
    with pytest.raises(
        UserError, match=r"2 of 9 views can be used, 8 are needed; 7 blurred.*: take more"
    ) as caught:
        teach(views, "x", 0)
    assert "\n" not in str(caught.value)


@pytest.mark.parametrize("name", ["", "  ", "a\nb", "x" * 65])
def test_unfit_names_are_refused(name: str) -> None:
    with pytest.raises(UserError, match="--name"):
        teach([], name, 0)


def test_one_size_one_light_and_few_views_are_warned_about() -> None:
    whole = [TeachingView(view(k, 100).image_bgr, view(k, 100).box) for k in range(0, 15)]
    chosen = choose(whole, lambda count, words: None)
    warnings = " ".join(warnings_for(chosen.views, chosen.refused))
    assert "same distance" in warnings
    assert "only 15 views" in warnings


@pytest.mark.parametrize("height", [40, 60, 130, 200])
def test_blur_is_judged_relative_to_the_views_size(height: int) -> None:
    sharp = view(1, height)
    assert fault_of(sharp) is None
    assert "blurred" in (fault_of(blurred(sharp)) or "")
    assert sharpness(grey_of(view_of(sharp))) > 2 * sharpness(grey_of(view_of(blurred(sharp))))


def test_noise_does_not_pass_for_sharpness() -> None:
    soft = blurred(view(1, 130))
    noise = np.random.default_rng(0).normal(0, 3, soft.image_bgr.shape)
    noisy = np.clip(soft.image_bgr + noise, 0, 255).astype(np.uint8)
    assert "blurred" in (fault_of(TeachingView(noisy, soft.box)) or "")


def test_the_same_views_and_seed_give_the_same_model(mixed) -> None:
    again = teach([view(k) for k in range(9)], "x", 4, lesson=SHORTEST)
    first, second = mixed[0].model.finder.arrays(), again.model.finder.arrays()
    assert all(first[key].tobytes() == second[key].tobytes() for key in first)
    assert np.array_equal(drawn_negatives(1, 2)[1], drawn_negatives(1, 2)[1])
    assert not np.array_equal(drawn_negatives(1, 2)[1], drawn_negatives(2, 2)[1])


# ------------------------------------------------------------------------------------ folder and video


def test_a_folder_of_whole_pictures(tmp_path: Path) -> None:
    for k in range(3):
        cv2.imwrite(str(tmp_path / f"{k}.png"), view_of(view(k)))
    (tmp_path / "notes.txt").write_text("not a picture")
    views = list(views_from_folder(tmp_path))
    assert len(views) == 3
    assert np.array_equal(views[1].image_bgr, view_of(view(1)))
    assert views[1].box == Box(0, 0, view(1).box.w, view(1).box.h)
    assert views[1].depth_m is None


def test_a_folder_with_boxes(tmp_path: Path) -> None:
    cv2.imwrite(str(tmp_path / "a.png"), view(0).image_bgr)
    (tmp_path / "boxes.csv").write_text("file,x,y,w,h\na.png,40,50,45,60\n")
    (only,) = views_from_folder(tmp_path)
    assert only.box == Box(40, 50, 45, 60)


@pytest.mark.parametrize(
    ("table", "words"),
    [
        ("file,x,y\na.png,1,2\n", "first line"),
        ("", "first line"),
        ("file,x,y,w,h\na.png,1,2,three,4\n", "line 2: x, y, w, h must be numbers"),
        ("file,x,y,w,h\na.png,900,2,30,40\n", "inside the picture of 352 x 288"),
        ("file,x,y,w,h\na.png,1,2,nan,40\n", "inside the picture"),
        ("file,x,y,w,h\nb.png,1,2,30,40\n", "cannot read"),
    ],
)
def test_unfit_boxes_are_refused(tmp_path: Path, table: str, words: str) -> None:
    cv2.imwrite(str(tmp_path / "a.png"), view(0).image_bgr)
    (tmp_path / "boxes.csv").write_text(table)
    with pytest.raises(UserError, match=words):
        list(views_from_folder(tmp_path))


def test_unfit_folders_are_refused(tmp_path: Path) -> None:
    with pytest.raises(UserError, match="no folder"):
        list(views_from_folder(tmp_path / "none"))
    with pytest.raises(UserError, match="no pictures"):
        list(views_from_folder(tmp_path))
    (tmp_path / "broken.png").write_bytes(b"\x89PNG no more")
    with pytest.raises(UserError, match="no readable picture"):
        list(views_from_folder(tmp_path))


def test_a_video_is_cut_by_the_tracker(tmp_path: Path) -> None:
    path = tmp_path / "walk.avi"
    writer = cv2.VideoWriter(str(path), cv2.VideoWriter.fourcc(*"MJPG"), 25, (352, 288))
    background = room(1)
    print_ = cv2.resize(SIDES[0], (75, 100), interpolation=cv2.INTER_AREA)
    for k in range(31):
        picture = background.copy()
        picture[80:180, 60 + 3 * k : 135 + 3 * k] = print_
        writer.write(picture)
    writer.release()
    views = list(views_from_video(path, Box(60, 80, 75, 100)))
    assert len(views) == 7
    assert views[-1].box.iou(Box(150, 80, 75, 100)) > 0.85


def test_unfit_videos_are_refused(tmp_path: Path) -> None:
    with pytest.raises(UserError, match="no readable video"):
        list(views_from_video(tmp_path / "none.avi", Box(0, 0, 50, 50)))
    (tmp_path / "broken.avi").write_bytes(b"RIFF nothing")
    with pytest.raises(UserError, match="no readable video"):
        list(views_from_video(tmp_path / "broken.avi", Box(0, 0, 50, 50)))
