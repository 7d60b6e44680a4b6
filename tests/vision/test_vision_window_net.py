"""What windows see, how a net learns from them, and how their boxes are counted, against slow oracles."""

from __future__ import annotations

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from robot.messages import Box
from robot.vision import window_net
from robot.vision.box_votes import APART, BoxVotes, counted, overlaps
from robot.vision.window_features import DIRECTIONS, edge_cells, windows_of
from robot.vision.window_net import ANSWERS, Course, Lessons, WindowNet, learnt

COURSE = Course(components=10, hidden=24, dropped=0.0, epochs=60, batch=64)


def loss(
    weights: list[window_net.Floats], inputs: window_net.Floats, shows: np.ndarray, boxes: np.ndarray
) -> float:
    first, first_bias, second, second_bias = (weight.astype(np.float64) for weight in weights)
    answers = WindowNet(first, first_bias, second, second_bias).answers(inputs).astype(np.float64)
    told = np.logaddexp(0.0, answers[:, 0]) - shows * answers[:, 0]
    off = 4.0 * (answers[:, 1:] - boxes)
    huber = np.where(np.abs(off) < 1.0, 0.5 * off**2, np.abs(off) - 0.5).sum(axis=1) / 4.0
    return float((told + COURSE.box_share * shows * huber).mean())


def test_slopes_are_those_of_the_loss() -> None:
    rng = np.random.default_rng(1)
    inputs = rng.normal(size=(12, 4)).astype(np.float32)
    shows, boxes = rng.random(12) < 0.5, rng.normal(0.0, 0.3, (12, 4)).astype(np.float32)
    weights = [
        rng.normal(0.0, 0.5, shape).astype(np.float32) for shape in ((4, 3), (3,), (3, ANSWERS), (ANSWERS,))
    ]
    slopes = window_net._slopes(weights, inputs, shows, boxes, COURSE, rng)
    for which, weight in enumerate(weights):
        for place in np.ndindex(weight.shape):
            moved = []
            for step in (1e-2, -1e-2):
                others = [one.copy() for one in weights]
                others[which][place] += step
                moved.append(loss(others, inputs, shows, boxes))
            assert slopes[which][place] == pytest.approx((moved[0] - moved[1]) / 2e-2, abs=3e-3)


def test_a_net_learns_objects_and_their_boxes() -> None:
    rng = np.random.default_rng(0)
    windows = rng.normal(size=(3000, 10)).astype(np.float32)
    shows = np.hypot(windows[:, 0], windows[:, 1]) < 1.0
    boxes = 0.2 * windows[:, 2:6]
    net = learnt(Lessons(windows, shows, boxes), COURSE, rng)
    fresh = rng.normal(size=(1000, 10)).astype(np.float32)
    answers = net.answers(fresh)
    assert ((answers[:, 0] > 0.0) == (np.hypot(fresh[:, 0], fresh[:, 1]) < 1.0)).mean() > 0.9
    mine = np.hypot(fresh[:, 0], fresh[:, 1]) < 0.8
    assert np.abs(answers[mine, 1:] - 0.2 * fresh[mine, 2:6]).mean() < 0.05


def test_windows_are_those_cut_one_by_one() -> None:
    cells = np.random.default_rng(0).random((6, 7, DIRECTIONS)).astype(np.float32)
    found = windows_of(cells, 3, 2)
    for row in range(4):
        for column in range(6):
            assert np.array_equal(found[row, column], cells[row : row + 3, column : column + 2].ravel())


@pytest.mark.parametrize(("gain", "offset"), [(0.5, 0.0), (0.6, 80.0), (1.0, -20.0)])
def test_light_changes_little_of_what_is_seen(gain: float, offset: float) -> None:
    rng = np.random.default_rng(3)
    picture = np.kron(rng.integers(60, 180, (8, 9)), np.ones((8, 8))).astype(np.uint8)
    other = np.clip(gain * picture + offset, 0, 255).astype(np.uint8)
    assert np.abs(edge_cells(picture) - edge_cells(other)).mean() < 0.01


BOXES = st.lists(
    st.tuples(st.floats(0, 200), st.floats(0, 200), st.floats(5, 80), st.floats(5, 80), st.floats(-3, 6)),
    min_size=1,
    max_size=30,
)


@given(BOXES, st.integers(1, 8))
@settings(max_examples=150, deadline=None)
def test_counted_boxes_are_apart_ordered_and_near_a_voter(
    given: list[tuple[float, float, float, float, float]], most: int
) -> None:
    rows = np.array(given, np.float32)
    boxes = np.column_stack([rows[:, :2], rows[:, :2] + rows[:, 2:4]])
    found = counted(BoxVotes(boxes, rows[:, 4]), most)
    assert 1 <= len(found.boxes) <= most
    assert (np.diff(found.logits) <= 1e-5).all()
    assert found.logits[0] >= rows[:, 4].max() - 1e-4
    for index, box in enumerate(found.boxes):
        assert (overlaps(box, found.boxes[:index]) <= APART + 1e-4).all()
        assert overlaps(box, boxes).max() > 0.3


@given(BOXES, st.randoms(use_true_random=False))
@settings(max_examples=60, deadline=None)
def test_the_order_of_boxes_changes_nothing(
    given: list[tuple[float, float, float, float, float]], random: st.DataObject
) -> None:
    logits = [round(one[4], 3) + 1e-2 * index for index, one in enumerate(given)]
    rows = np.array([(*one[:4], logit) for one, logit in zip(given, logits, strict=True)], np.float64)
    order = list(range(len(rows)))
    random.shuffle(order)
    told = []
    for some in (rows, rows[order]):
        boxes = np.column_stack([some[:, :2], some[:, :2] + some[:, 2:4]])
        told.append(counted(BoxVotes(boxes, some[:, 4]), 5))
    if len(set(rows[:, 4])) == len(rows):
        np.testing.assert_allclose(told[0].boxes, told[1].boxes, rtol=1e-5, atol=1e-4)


@given(*[st.tuples(st.floats(0, 50), st.floats(0, 50), st.floats(1, 60), st.floats(1, 60))] * 2)
@settings(max_examples=80, deadline=None)
def test_overlaps_are_those_of_boxes(one: tuple[float, ...], other: tuple[float, ...]) -> None:
    first, second = (np.array([x, y, x + w, y + h]) for x, y, w, h in (one, other))
    assert overlaps(first, second[None])[0] == pytest.approx(Box(*one).iou(Box(*other)), abs=1e-6)
