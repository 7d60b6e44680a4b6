"""NMF's bench: beside scikit-learn on a small matrix, faces recognised, bars."""

import cv2
import numpy as np
import pytest

from bench import nmf, nmf_faces
from robot.errors import UserError
from robot.vision.nmf_objectives import EUCLIDEAN


def test_both_reach_the_same_error_from_the_same_start(monkeypatch):
    monkeypatch.setattr(nmf, "ROUNDS", 60)
    row = nmf.beside_sklearn((60, 30, 4), EUCLIDEAN, "frobenius")
    assert row["error over"] == pytest.approx(1.0, abs=0.01)
    assert row["time over"] > 0.0


def test_faces_are_read_and_told_apart(tmp_path, monkeypatch):
    rng = np.random.default_rng(0)
    for person in range(1, 5):
        (tmp_path / f"s{person}").mkdir()
        face = cv2.resize(rng.integers(0, 255, (7, 6), np.uint8), (92, 112))
        for picture in range(1, 11):
            noisy = np.clip(face + rng.normal(0, 10, face.shape), 0, 255).astype(np.uint8)
            cv2.imwrite(str(tmp_path / f"s{person}" / f"{picture}.pgm"), noisy)
    monkeypatch.setattr(nmf_faces, "RANKS", (2, 6))
    monkeypatch.setattr(nmf_faces, "SPLITS", 1)
    rows = nmf_faces.recognised(nmf_faces.faces(tmp_path))
    assert [row["variant"] for row in rows] == list(nmf_faces.VARIANTS)
    assert all(row["best"] > 0.9 for row in rows)


def test_no_faces_are_said_in_a_line(tmp_path):
    with pytest.raises(UserError, match="no faces"):
        nmf_faces.faces(tmp_path)
