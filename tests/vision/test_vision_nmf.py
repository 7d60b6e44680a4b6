"""Non-negative matrix factorisation: preparation of views, both updates, rank choice."""

from __future__ import annotations

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from sklearn import decomposition

from robot.vision.nmf import NMF
from robot.vision.nmf_objectives import (
    DIVERGENCE,
    EUCLIDEAN,
    Objective,
    divergence_cost,
    euclidean_cost,
)
from robot.vision.nmf_rank import RankPoint, choose_rank, largest_rank, rank_curve
from robot.vision.prepared_view import FlatViewError, normalise, prepare

OBJECTIVES = [EUCLIDEAN, DIVERGENCE]


def low_rank(seed: int, n: int = 40, m: int = 18, r: int = 5, noise: float = 0.05) -> np.ndarray:
    rng = np.random.default_rng(seed)
    return rng.random((n, r)) @ rng.random((r, m)) + noise * rng.random((n, m))


def test_prepared_values_have_mean_and_spread_of_a_quarter_before_clipping() -> None:
    # Values within +-1 standard deviation below the mean are never clipped.
    pixels = np.array([[0.0, 1.0], [1.0, 0.0]])
    assert normalise(pixels).mean() == pytest.approx(0.25)
    assert normalise(pixels).std() == pytest.approx(0.25)


@given(gain=st.floats(0.3, 3.0), offset=st.floats(-20, 20), seed=st.integers(0, 99))
@settings(max_examples=20, deadline=None)
def test_prepared_view_does_not_depend_on_linear_light(gain: float, offset: float, seed: int) -> None:
    view = np.random.default_rng(seed).uniform(50, 200, (20, 15)).astype(np.float32)
    expected = prepare(view, (6, 8))
    assert expected.min() >= 0.0
    assert expected.max() <= 1.0
    np.testing.assert_allclose(prepare(view * gain + offset, (6, 8)), expected, atol=2e-3)


def test_prepare_keeps_rows_together_and_takes_uint8_and_float() -> None:
    view = np.zeros((4, 6), np.uint8)
    view[0] = 200
    column = prepare(view, (6, 4))
    assert np.all(column[:6] > column[6:].max())
    np.testing.assert_array_equal(column, prepare(view.astype(np.float64), (6, 4)))


def test_prepare_refuses_what_shows_nothing() -> None:
    with pytest.raises(FlatViewError, match="flat"):
        prepare(np.full((20, 20), 90, np.uint8), (8, 8))
    with pytest.raises(ValueError, match="grey view"):
        prepare(np.zeros((20, 20, 3), np.uint8), (8, 8))
    with pytest.raises(ValueError, match="not numbers"):
        prepare(np.full((8, 8), np.nan), (4, 4))


@pytest.mark.parametrize("objective", OBJECTIVES, ids=lambda o: o.name)
@given(seed=st.integers(0, 10_000), rank=st.integers(1, 6))
@settings(max_examples=15, deadline=None)
def test_cost_never_increases_and_factors_stay_non_negative(
    objective: Objective, seed: int, rank: int
) -> None:
    V = np.random.default_rng(seed).random((12, 9)) ** 3
    model = NMF(rank, objective, max_iterations=60, tolerance=0.0, seed=seed, cost_every=1).fit(V)
    errors = np.array(model.errors_)
    assert len(errors) > 10
    assert np.all(np.diff(errors) <= 1e-9 * errors[0])
    assert errors[-1] < errors[0]
    assert (model.basis_ >= 0).all()
    assert (model.encodings_ >= 0).all()


@pytest.mark.parametrize(
    ("objective", "loss"), [(EUCLIDEAN, "frobenius"), (DIVERGENCE, "kullback-leibler")], ids=["L2", "KL"]
)
def test_final_error_is_that_of_an_independent_implementation(objective: Objective, loss: str) -> None:
    V = low_rank(1, noise=0.4)
    ours = NMF(5, objective, max_iterations=3000, tolerance=0.0, seed=3).fit(V).errors_[-1]
    reference = decomposition.NMF(
        5, solver="mu", beta_loss=loss, init="random", random_state=3, max_iter=3000, tol=0
    )
    W = reference.fit_transform(V)
    theirs = objective.cost(V, W @ reference.components_)
    assert ours == pytest.approx(theirs, rel=0.005)


def test_known_costs() -> None:
    V, WH = np.array([[2.0, 0.0]]), np.array([[1.0, 3.0]])
    assert euclidean_cost(V, WH) == pytest.approx(10.0)
    assert divergence_cost(V, WH) == pytest.approx(2 * np.log(2) - 1 + 3)


def test_transform_is_the_pseudo_inverse_and_finds_known_encodings() -> None:
    model = NMF(4, max_iterations=300, seed=0).fit(low_rank(2, r=4))
    encodings = np.random.default_rng(1).random((4, 3))
    np.testing.assert_allclose(model.transform(model.basis_ @ encodings), encodings, atol=1e-8)
    with pytest.raises(ValueError, match="40 pixels"):
        model.transform(np.zeros((7, 2)))


def test_the_same_seed_gives_the_same_bytes_and_another_seed_another_start() -> None:
    V = low_rank(3)
    first, second, other = (NMF(3, max_iterations=20, seed=s).fit(V).basis_.tobytes() for s in (5, 5, 6))
    assert first == second
    assert first != other


def test_fitting_stops_when_the_cost_has_settled() -> None:
    V = low_rank(4, r=3)
    model = NMF(3, max_iterations=5000, tolerance=1e-2, seed=0).fit(V)
    assert model.n_iter_ < 2000
    assert model.errors_[-2] - model.errors_[-1] < 0.01 * model.errors_[-2]


@pytest.mark.parametrize("bad", [-np.ones((3, 3)), np.full((3, 3), np.nan), np.zeros((0, 3)), np.zeros(4)])
def test_unfit_matrices_are_refused(bad: np.ndarray) -> None:
    with pytest.raises(ValueError, match="V must"):
        NMF(2).fit(bad)


def test_unfit_settings_are_refused() -> None:
    with pytest.raises(ValueError, match="rank"):
        NMF(0)
    with pytest.raises(ValueError, match="max_iterations"):
        NMF(1, max_iterations=0)


def test_held_out_reconstruction_stops_improving_at_the_true_rank() -> None:
    V = low_rank(5, n=60, m=36, r=4, noise=0.1)
    curve = rank_curve(V, [1, 2, 4, 8], max_iterations=400)
    errors = {point.rank: point.error for point in curve}
    assert errors[1] > errors[2] > 1.5 * errors[4]
    # Beyond the true rank only noise is left to explain.
    assert errors[2] - errors[4] > 1.5 * (errors[4] - errors[8])


@given(n=st.integers(3, 500), m=st.integers(3, 200))
@settings(max_examples=50, deadline=None)
def test_largest_rank_is_the_last_that_compresses(n: int, m: int) -> None:
    r = largest_rank(n, m)
    assert r >= 1
    assert (n + m) * (r + 1) >= n * m
    assert r == 1 or (n + m) * r < n * m


def test_rank_choice_needs_points_and_views() -> None:
    with pytest.raises(ValueError, match="no points"):
        choose_rank([])
    with pytest.raises(ValueError, match="two views"):
        rank_curve(np.ones((4, 1)), [1])
    assert choose_rank([RankPoint(8, 0.2), RankPoint(3, 0.205)]) == 3
