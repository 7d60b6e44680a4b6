"""Teaching before the robot's eyes: views while something is held, words while nothing is."""

from __future__ import annotations

from pathlib import Path

import cv2
import pytest
from click.testing import CliRunner
from rendered_pairs import RIG, Block, Pair, Room, render

from robot.cli import commands
from robot.messages import StereoFrame
from robot.model_file import load
from robot.teach_camera import BETWEEN_S, STILL_S, Sitting, views_from_camera
from robot.vision.stereo import AdaptiveWeightMatcher

MATCHER = AdaptiveWeightMatcher.floors(96)


def held(k: int) -> Pair:
    """The k-th look at a box that is turned and moved to and fro before the eyes."""
    far = 0.42 + 0.02 * (k % 5)
    block = Block(far, 0.01 * (k % 3 - 1), 0.07, 0.10, 0.31, 0.17, yaw=0.35 * k, seed=4)
    return render(Room((block,), size=2.0 + 0.2 * (k % 4)), tilt=0.05, seed=k, gain=0.8 + 0.02 * k)


@pytest.fixture(scope="module")
def pairs() -> list[Pair]:
    return [held(k) for k in range(10)]


class Eyes:
    """Pairs at ten a second of a clock that `pause` moves on; the last one stays."""

    def __init__(self, pairs: list[Pair], pauses: int = 1000) -> None:
        self.pairs, self.time, self.pauses = pairs, 0.0, pauses

    def now(self) -> float:
        return self.time

    def pause(self) -> bool:
        self.time, self.pauses = round(self.time + 0.05, 9), self.pauses - 1
        return self.pauses >= 0

    def latest(self, now: float) -> StereoFrame:
        seq = min(int(now / BETWEEN_S / 1.02), len(self.pairs) - 1)
        return StereoFrame(self.pairs[seq].left, self.pairs[seq].right, now, seq)

    def faults(self, now: float) -> tuple[()]:
        return ()

    def close(self) -> None:
        pass


LONG = Sitting()


def sitting(eyes: Eyes, limits: Sitting = LONG):
    said: list[str] = []
    return list(views_from_camera(eyes, RIG, MATCHER, eyes, eyes.pause, said.append, limits)), said


def test_views_with_masks_and_depths_are_kept_while_it_is_held(pairs: list[Pair]) -> None:
    eyes = Eyes(pairs[:4])
    views, said = sitting(eyes)
    assert len(views) == 4
    assert all(view.mask is not None and view.mask.sum() > 0.6 * view.box.area for view in views)
    assert all(0.3 < view.depth_m < 0.6 for view in views)
    assert said[0].startswith("hold the object")
    assert eyes.time == pytest.approx(4 * BETWEEN_S + STILL_S, abs=0.6), "it ends when the pictures stop"


def test_what_hinders_is_said_once(pairs: list[Pair]) -> None:
    empty = render(Room(()), tilt=0.05)
    views, said = sitting(Eyes([empty, empty, empty, pairs[0], empty]))
    assert len(views) == 1
    assert [words.startswith("nothing is held") for words in said] == [False, True, True]


@pytest.mark.parametrize(("limits", "count"), [(Sitting(views=2), 2), (Sitting(seconds=0.5), 2)])
def test_a_sitting_ends(pairs: list[Pair], limits: Sitting, count: int) -> None:
    views, _ = sitting(Eyes(pairs[:6]), limits)
    assert len(views) == count


def test_it_ends_when_told_to(pairs: list[Pair]) -> None:
    eyes = Eyes(pairs, pauses=1)
    assert len(sitting(eyes)[0]) == 1, "the second pause is not waited for"


@pytest.mark.usefixtures("short_lessons")
def test_a_target_is_taught_before_the_robots_own_cameras(
    pairs: list[Pair], tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.chdir(tmp_path)
    for side in ("left", "right"):
        (tmp_path / side).mkdir()
        for k, pair in enumerate(pairs):
            cv2.imwrite(str(tmp_path / side / f"{k:02d}.png"), getattr(pair, side))
    Path("robot.toml").write_text(
        '[cameras]\ndriver = "folder"\nleft = "left"\nright = "right"\nrate_hz = 2.0\n'
    )
    done = CliRunner().invoke(
        commands, ["teach", "--from", "cameras", "--config", "robot.toml", "--name", "tin", "--seconds", "6"]
    )
    assert done.exit_code == 0, done.output
    model = load("models/tin.model")
    assert model.views >= 8
    assert model.height_m == pytest.approx(0.14, rel=0.15)
    assert "the robot's own eyes" in model.created_from
    assert Path("models/tin.png").exists()
    assert "cross-validated" in done.output


def test_which_cameras_must_be_said() -> None:
    done = CliRunner().invoke(commands, ["teach", "--from", "cameras", "--name", "tin"])
    assert done.exit_code != 0
    assert "--config FILE" in str(done.exception)
