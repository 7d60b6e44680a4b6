"""The detector's bench: the set's rules, recall at a rate of false alarms, words for missing data."""

import cv2
import numpy as np
import pytest

from bench import detector
from bench.detector import recall_at
from bench.detector_uiuc import Found, crops, equal_error_rate, right, truths
from robot.errors import UserError
from robot.messages import Box

CAR = Box(50.0, 20.0, 100.0, 40.0)


@pytest.mark.parametrize(
    ("found", "single", "multi"),
    [
        (CAR, True, True),
        (Box(74.0, 20.0, 100.0, 40.0), True, True),
        (Box(76.0, 20.0, 100.0, 40.0), False, False),
        (Box(50.0, 31.0, 100.0, 40.0), False, False),
        (Box(38.0, 15.2, 124.0, 49.6), True, True),
        (Box(37.0, 14.8, 126.0, 50.4), True, False),
        (Box(58.0, 18.0, 124.0, 49.6), True, False),
    ],
    ids=["itself", "aside", "too far aside", "too low", "larger", "too large", "larger and aside"],
)
def test_a_detection_is_right_within_a_quarter_of_the_car_in_each_direction(found, single, multi):
    assert right(found, CAR, scales=False) == single
    assert right(found, CAR, scales=True) == multi


def test_a_car_found_twice_is_one_hit_and_one_false_alarm():
    true = {"a": [CAR], "b": [CAR]}
    twice = [Found("a", CAR, 0.9), Found("a", CAR, 0.8), Found("b", CAR, 0.7)]
    rate, recall = equal_error_rate(twice, true, scales=False)
    assert (rate, recall) == (pytest.approx(2 / 3), 1.0)
    rate, recall = equal_error_rate(twice[::2], true, scales=False)
    assert (rate, recall) == (1.0, 1.0)


def test_recall_counts_hits_above_all_but_the_allowed_false_alarms():
    assert recall_at([0.9, 0.6, -np.inf], [0.7, 0.5], images=10) == pytest.approx(2 / 3)
    assert recall_at([0.9, 0.6, -np.inf], [0.7, 0.65, 0.5], images=10) == pytest.approx(1 / 3)
    assert recall_at([0.2], [], images=10) == 1.0


def test_the_set_is_read_as_it_lies(tmp_path):
    for kind in ("pos", "neg"):
        (tmp_path / "train" / kind).mkdir(parents=True)
        for i in range(3):
            picture = np.full((40, 100), 10 * i, np.uint8)
            cv2.imwrite(str(tmp_path / "train" / kind / f"{i}.png"), picture)
    (tmp_path / "single.csv").write_text("image,x,y,w,h\na.png,-3,4,100,40\na.png,9,9,100,40\n")
    cars, without = crops(tmp_path, 2, seed=0)
    assert [len(cars), len(without)] == [2, 2]
    assert truths(tmp_path, "single") == {"a.png": [Box(-3, 4, 100, 40), Box(9, 9, 100, 40)]}
    with pytest.raises(UserError, match="4 are needed"):
        crops(tmp_path, 4, seed=0)


def test_missing_data_is_said_in_a_line(tmp_path, capsys):
    assert detector.main([]) == 2
    assert "--data DIR" in capsys.readouterr().err
    assert detector.main(["--data", str(tmp_path)]) == 2
    assert "are needed" in capsys.readouterr().err
