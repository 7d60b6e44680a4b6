"""Sparse, local and class-aware factorisation, and the rank chosen by recognition."""

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from scipy.optimize import minimize

from robot.vision.nmf import NMF
from robot.vision.nmf_objectives import EUCLIDEAN, divergence_cost
from robot.vision.nmf_rank import choose_rank_by_recognition, nearest_label, recognition_curve
from robot.vision.nmf_variants import LOCAL, fisher, projected, sparse, sparseness_of


def classes(seed: int, people: int = 4, views: int = 6, pixels: int = 40) -> tuple[np.ndarray, list[int]]:
    """Noisy views of a few prototypes, in columns, and whose they are."""
    rng = np.random.default_rng(seed)
    prototypes = rng.random((pixels, people)) ** 3
    V = np.repeat(prototypes, views, axis=1) + 0.15 * rng.random((pixels, people * views))
    return V, [person for person in range(people) for _ in range(views)]


@given(seed=st.integers(0, 10_000), sparseness=st.floats(0.1, 0.9), count=st.integers(3, 60))
@settings(max_examples=40, deadline=None)
def test_projection_keeps_length_and_gives_the_sparseness(seed, sparseness, count):
    values = np.random.default_rng(seed).normal(0.3, 1.0, count)
    found = projected(values, sparseness)
    assert (found >= 0.0).all()
    assert np.linalg.norm(found) == pytest.approx(np.linalg.norm(values), rel=1e-6)
    assert sparseness_of(found) == pytest.approx(sparseness, abs=1e-6)


def test_projection_is_the_nearest_such_vector():
    """Against a general optimiser started from many places."""
    values, sparseness = np.array([0.9, 0.4, -0.2, 0.6]), 0.5
    length = np.linalg.norm(values)
    total = length * (2.0 - sparseness)
    rules = [
        {"type": "eq", "fun": lambda x: x.sum() - total},
        {"type": "eq", "fun": lambda x: x @ x - length**2},
    ]
    starts = np.random.default_rng(0).random((20, 4))
    tries = [
        minimize(lambda x: np.sum((x - values) ** 2), start, constraints=rules, bounds=[(0, None)] * 4)
        for start in starts
    ]
    best = min((one for one in tries if one.success), key=lambda one: one.fun)
    assert np.sum((projected(values, sparseness) - values) ** 2) <= best.fun + 1e-6


@pytest.mark.parametrize("sparseness", [0.3, 0.7])
def test_sparse_basis_images_have_it_and_the_cost_never_rises_after_the_first_round(sparseness):
    V, _ = classes(1)
    model = NMF(4, sparse(sparseness), max_iterations=60, tolerance=0.0, seed=0, cost_every=1).fit(V)
    assert [sparseness_of(c) for c in model.basis_.T] == pytest.approx([sparseness] * 4, abs=1e-6)
    assert np.all(np.diff(model.errors_[1:]) <= 1e-9 * model.errors_[1])


def test_local_basis_images_overlap_less_than_plain_ones():
    V, _ = classes(2, people=6)
    plain, local = (
        NMF(6, objective, max_iterations=200, tolerance=None, seed=0).fit(V).basis_
        for objective in (EUCLIDEAN, LOCAL)
    )

    def overlap(W):
        unit = W / np.linalg.norm(W, axis=0)
        return np.abs(unit.T @ unit - np.eye(W.shape[1])).mean()

    assert overlap(local) < overlap(plain)
    np.testing.assert_allclose(local.sum(axis=0), 1.0, rtol=1e-9)


def test_fisher_encodings_scatter_less_within_classes_for_what_they_scatter_between():
    V, labels = classes(3)

    def ratio(objective):
        H = NMF(4, objective, max_iterations=100, tolerance=None, seed=0).fit(V).encodings_
        means = np.stack([H[:, np.array(labels) == one].mean(axis=1) for one in range(4)], axis=1)
        within = sum(((H[:, np.array(labels) == one] - means[:, [one]]) ** 2).sum() for one in range(4))
        return within / ((means - means.mean(axis=1, keepdims=True)) ** 2).sum()

    assert ratio(fisher(labels, 0.2, 0.02)) < 0.7 * ratio(fisher(labels, 1e-9, 0.0))


def test_fisher_without_weight_is_the_divergence():
    V, labels = classes(4)
    told = NMF(4, fisher(labels, 1e-9, 0.0), max_iterations=300, tolerance=None, seed=0).fit(V)
    errors = told.errors_
    assert errors[-1] < 0.2 * errors[0]
    assert divergence_cost(V, told.basis_ @ told.encodings_) == pytest.approx(errors[-1])


def test_unfit_settings_are_refused():
    with pytest.raises(ValueError, match="sparseness"):
        sparse(1.5)
    with pytest.raises(ValueError, match="between"):
        fisher([0, 0, 0, 1, 1, 1], 0.1, 0.1)
    with pytest.raises(ValueError, match="more than"):
        fisher([0, 0, 0, 1])
    with pytest.raises(ValueError, match="cost_every"):
        NMF(2, cost_every=3)


def test_float32_stays_float32_and_agrees_with_float64():
    V, _ = classes(5)
    wide, narrow = (
        NMF(4, max_iterations=100, tolerance=None, seed=0).fit(v) for v in (V, V.astype(np.float32))
    )
    assert narrow.basis_.dtype == np.float32
    assert narrow.reconstruction_err_ == pytest.approx(wide.reconstruction_err_, rel=1e-3)
    assert narrow.components_.shape == (4, 40)


def test_classes_are_recognised_and_the_curve_finds_the_rank_that_does_it():
    V, labels = classes(6, people=5, views=9)
    curve = recognition_curve(V, labels, [1, 5])
    errors = {point.rank: point.error for point in curve}
    assert errors[1] > errors[5] + 0.2
    assert errors[5] < 0.05
    assert choose_rank_by_recognition(curve) == 5
    model = NMF(5, seed=0).fit(V[:, ::2])
    assert nearest_label(model, V[:, ::2], labels[::2], V[:, 1::2]) == labels[1::2]
