"""The tracker's bench: sequences changed as said, figures, the whole run on a small film."""

import cv2
import numpy as np
import pytest

from bench import tracker
from bench.tracker_figures import after_cover, false_locks, found_again_s, overlaps, success_auc
from bench.tracker_sequences import AFTER, AWAY, BEFORE, COVERED, Filmed, gone, half_covered, sequence
from robot.errors import UserError
from robot.messages import Box, Track
from robot.vision.textures import texture

WALL = texture((200, 120), np.random.default_rng(1))
PRINT = texture((30, 40), np.random.default_rng(2))
FRAMES = BEFORE + COVERED + AFTER + 5


def film() -> Filmed:
    frames, truth = [], []
    for i in range(FRAMES):
        x, y = 20 + i, 40
        picture = WALL.copy()
        picture[y : y + 40, x : x + 30] = PRINT
        frames.append(picture)
        truth.append(Box(x, y, 30, 40))
    return Filmed("film", tuple(frames), tuple(truth))


def held(box: Box) -> Track:
    return Track(box, (0.0, 0.0), 1.0, lost=False)


def test_half_of_the_box_is_covered_for_30_frames_and_no_other():
    changed = half_covered(film(), 0)
    begin = next(i for i in range(6) if film().truth[i] == changed.truth[0])
    for i, (frame, box) in enumerate(zip(changed.frames, changed.truth, strict=True)):
        differs = (frame != film().frames[begin + i]).any(axis=2)
        inside = differs[int(box.y) : int(box.y + box.h), int(box.x) : int(box.x + box.w)].mean()
        assert (0.35 < inside < 0.65) if BEFORE <= i < BEFORE + COVERED else not differs.any()


def test_the_target_is_out_of_view_for_100_frames_and_back():
    changed = gone(film(), 0)
    assert [box is None for box in changed.truth] == [False] * BEFORE + [True] * AWAY + [False] * AFTER
    for frame in changed.frames[BEFORE : BEFORE + AWAY]:
        fits = cv2.matchTemplate(frame, PRINT, cv2.TM_CCOEFF_NORMED)
        assert fits.max() < 0.7


def test_a_film_too_short_is_not_changed():
    short = Filmed("short", film().frames[:20], film().truth[:20])
    assert half_covered(short, 0) is None
    assert gone(short, 0) is None


def test_figures():
    box, far = Box(0, 0, 10, 10), Box(50, 50, 10, 10)
    truth = [box, box, None, box]
    tracks = [held(box), Track(box, (0.0, 0.0), 0.0, lost=True), held(box), held(far)]
    overlap = overlaps(tracks, truth)
    np.testing.assert_array_equal(overlap, [1.0, 0.0, np.nan, 0.0])
    assert success_auc(overlap) == pytest.approx(20 / 21 / 3)
    assert false_locks(tracks, truth) == 1
    back = np.r_[np.ones(BEFORE), np.full(AWAY, np.nan), np.zeros(10), np.ones(AFTER - 10)]
    assert found_again_s(back) == pytest.approx(0.4)
    assert found_again_s(np.zeros(BEFORE + AWAY + AFTER)) == np.inf
    assert after_cover(np.r_[np.zeros(BEFORE + COVERED), np.full(COVERED, 0.8)]) == pytest.approx(0.8)


def test_the_bench_runs_without_peers_and_says_what_it_found(tmp_path, capsys):
    folder = tmp_path / "tracking" / "film" / "frames"
    folder.mkdir(parents=True)
    for i, frame in enumerate(film().frames):
        cv2.imwrite(str(folder / f"{i:04d}.jpg"), frame)
    lines = [f"{i},{b.x},{b.y},{b.w},{b.h}" for i, b in enumerate(film().truth)]
    (folder.parent / "truth.csv").write_text("\n".join(["frame,x,y,w,h", *lines]))
    assert len(sequence(folder.parent).frames) == FRAMES
    rows = tracker.measured(tmp_path, lambda names: {}, 1)
    assert rows[0]["auc"] > 0.8
    assert rows[1]["after_ours"] > 0.65
    assert rows[2]["found_s_ours"] <= 1.0
    assert rows[2]["false_ours"] == 0
    told = {bar.name: bar.holds for bar in tracker.bars(rows)}
    assert not told["mean success AUC over CSRT's"]  # no peer, no comparison
    assert told["runs with a false lock"]


def test_missing_data_is_said_in_a_line(tmp_path, capsys):
    assert tracker.main(["--data", str(tmp_path)]) == 2
    assert "holds no sequences" in capsys.readouterr().err
    with pytest.raises(UserError, match="no tracking case"):
        sequence(tmp_path)
