"""Runs of unmeasured pixels: their ends, their sums and their cheapest cuts against plain loops."""

import itertools

import hypothesis.extra.numpy as arrays
import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from robot.vision.row_runs import Runs, at

SHAPES = st.tuples(st.integers(1, 4), st.integers(1, 14))
MASKS = SHAPES.flatmap(lambda shape: arrays.arrays(np.bool_, shape))
PROPERTY = settings(deadline=None, max_examples=150)


def bounded_runs(known_row):
    """(before, after) of every run of this row with something known to both sides: the plain way."""
    columns = np.flatnonzero(known_row)
    return [
        (int(a), int(b)) for a, b in itertools.pairwise(columns) if b - a > 1
    ]  # two known neighbours have no run between them


def with_costs(masks, elements):
    return masks.flatmap(
        lambda known: st.tuples(st.just(known), arrays.arrays(np.float32, known.shape, elements=elements))
    )


WHOLE = st.integers(-9, 9)
FRACTIONS = st.floats(-4.0, 4.0, width=16)


@PROPERTY
@given(MASKS)
def test_every_pixel_knows_what_bounds_it(known):
    runs = Runs.of(known)
    width = known.shape[1]
    for v, u in np.ndindex(known.shape):
        to_left = [c for c in range(u + 1) if known[v, c]]
        to_right = [c for c in range(u, width) if known[v, c]]
        before, after = max(to_left, default=-1), min(to_right, default=width)
        assert (runs.before[v, u], runs.after[v, u]) == (before, after)
        assert runs.length[v, u] == after - before
        assert runs.inside[v, u] == (not known[v, u])
        assert runs.has_before[v, u] == bool(to_left)
        assert runs.has_after[v, u] == bool(to_right)
        assert runs.between[v, u] == (not known[v, u] and bool(to_left) and bool(to_right))


@PROPERTY
@given(with_costs(MASKS, WHOLE))
def test_totals_are_sums_over_the_run_alone(drawn):
    known, counted = drawn
    total = Runs.of(known).total(counted)
    for v, row in enumerate(known):
        for before, after in bounded_runs(row):
            expected = counted[v, before + 1 : after].sum()
            assert (total[v, before + 1 : after] == expected).all()


def test_masks_are_counted_too():
    known = np.array([[True, False, False, False, True, False]])
    runs = Runs.of(known)
    assert runs.total(np.array([[True, True, False, True, True, True]]))[0, 1:4].tolist() == [2.0] * 3


@PROPERTY
@given(with_costs(MASKS, WHOLE))
def test_the_cheapest_cut_of_every_run_reaches_the_least_sum_there_is(drawn):
    known, cost = drawn
    cut, least, total = Runs.of(known).cheapest_cut(cost)
    for v, row in enumerate(known):
        for before, after in bounded_runs(row):
            inside = slice(before + 1, after)
            sums = [float(cost[v, before + 1 : end + 1].sum()) for end in range(before, after)]
            assert (least[v, inside] == min(sums)).all()
            assert (total[v, inside] == sums[-1]).all()
            (place,) = set(cut[v, inside].tolist())  # one cut for all of the run
            assert before <= place < after
            assert sums[place - before] == min(sums)


@PROPERTY
@given(with_costs(MASKS, FRACTIONS))
def test_costs_need_not_be_whole_numbers(drawn):
    known, cost = drawn
    cut, least, total = Runs.of(known).cheapest_cut(cost)
    exact = cost.astype(np.float64)
    for v, row in enumerate(known):
        for before, after in bounded_runs(row):
            sums = [float(exact[v, before + 1 : end + 1].sum()) for end in range(before, after)]
            place = int(cut[v, before + 1])
            assert before <= place < after
            assert least[v, before + 1] == pytest.approx(min(sums), abs=1e-6)
            assert sums[place - before] == pytest.approx(min(sums), abs=1e-6)
            assert total[v, before + 1] == pytest.approx(sums[-1], abs=1e-6)


def test_a_costly_run_is_cut_at_its_beginning_and_a_gainful_one_at_its_end():
    known = np.array([[True, False, False, False, True, False, False, True]])
    cost = np.array([[-9.0, 2.0, 3.0, 1.0, -9.0, -2.0, -1.0, -9.0]], np.float32)
    cut, least, total = Runs.of(known).cheapest_cut(cost)
    assert cut[0, 1:4].tolist() == [0, 0, 0]
    assert cut[0, 5:7].tolist() == [6, 6]
    assert least[0, [1, 5]].tolist() == [0.0, -3.0]
    assert total[0, [1, 5]].tolist() == [6.0, -3.0]


def test_a_run_far_cheaper_than_its_neighbours_leaves_them_alone():
    """Sums run on along the row: what one run gains must not be lent to the next."""
    known = np.zeros((1, 60), np.bool_)
    known[0, ::6] = True
    cost = np.tile(np.array([-1000.0, 0.0, 1.0], np.float32), 20)[None]
    cost[0, 30:] = np.where(cost[0, 30:] < 0, 5.0, -1.0)
    cut, least, _ = Runs.of(known).cheapest_cut(cost)
    for before, after in bounded_runs(known[0]):
        sums = [float(cost[0, before + 1 : end + 1].sum()) for end in range(before, after)]
        assert least[0, before + 1] == min(sums)
        assert sums[int(cut[0, before + 1]) - before] == min(sums)


@PROPERTY
@given(with_costs(MASKS, WHOLE), st.data())
def test_some_rows_alone_say_the_same(drawn, data):
    known, cost = drawn
    rows = np.array(data.draw(st.lists(st.integers(0, len(known) - 1), min_size=1, max_size=3)), np.intp)
    runs = Runs.of(known)
    some, between = runs.of_rows(rows), runs.between[rows]
    for whole, part in zip(runs.cheapest_cut(cost), some.cheapest_cut(cost[rows]), strict=True):
        assert (whole[rows][between] == part[between]).all()
    assert (some.total(cost[rows])[between] == runs.total(cost)[rows][between]).all()


@PROPERTY
@given(MASKS, st.data())
def test_values_at_columns_outside_are_the_nearest_ones(known, data):
    height, width = known.shape
    plane = np.arange(height * width).reshape(height, width)
    columns = data.draw(arrays.arrays(np.int32, known.shape, elements=st.integers(-3, width + 2)))
    found = at(plane, columns)
    for v, u in np.ndindex(known.shape):
        assert found[v, u] == plane[v, min(max(int(columns[v, u]), 0), width - 1)]
    assert (at(plane.T.copy().T, columns) == found).all()  # a plane need not lie row by row in memory
