"""A picture for people: where ferns vote for a cup's middle, who voted, and what is found."""

from __future__ import annotations

from collections.abc import Sequence

import cv2
import numpy as np

from bench.detector_composites import Shown
from robot.messages import Box, Image
from robot.vision.ferns import FernDetector

LEAST = 0.1
TRUE, FOUND, OTHER = (0, 200, 0), (0, 0, 255), (0, 160, 255)


def sheet(
    detector: FernDetector, label: str, shown: Sequence[tuple[str, Shown]], scales: Sequence[float]
) -> Image:
    """A row for each picture: its detections, the vote map, the pixels that voted for the best one."""
    return np.asarray(np.vstack([_row(detector, label, *one, scales) for one in shown]), np.uint8)


def _row(detector: FernDetector, label: str, name: str, shown: Shown, scales: Sequence[float]) -> Image:
    found = detector.predict(shown.image, scales, least_score=LEAST)
    picture = np.asarray(cv2.cvtColor(shown.image, cv2.COLOR_GRAY2BGR), np.uint8)
    boxes = picture.copy()
    _draw(boxes, shown.box, TRUE)
    for number, one in enumerate(found[:3]):
        _draw(boxes, one.box, OTHER if number else FOUND)
    told = f"true green, found red {found[0].score:.2f}" if found else "nothing found"
    _words(boxes, f"{name}: {told}")
    votes = detector.vote_map(shown.image, label, scales)
    grey = np.clip(255.0 * votes / max(float(votes.max()), 1e-6), 0, 255).astype(np.uint8)
    heat = np.asarray(cv2.applyColorMap(grey, cv2.COLORMAP_INFERNO), np.uint8)
    _words(heat, f"votes for a middle, at most {votes.max():.2f}")
    backs = np.where(found[0].support[..., None], picture, picture // 4) if found else picture
    backs = np.asarray(backs, np.uint8)
    _words(backs, "who voted for the best")
    return np.asarray(np.hstack([boxes, heat, backs]), np.uint8)


def _draw(image: Image, box: Box, colour: tuple[int, int, int]) -> None:
    corners = (round(box.x), round(box.y)), (round(box.x + box.w), round(box.y + box.h))
    cv2.rectangle(image, *corners, colour, 2)


def _words(image: Image, words: str) -> None:
    cv2.rectangle(image, (0, 0), (image.shape[1], 18), (30, 30, 30), cv2.FILLED)
    cv2.putText(image, words, (5, 13), cv2.FONT_HERSHEY_SIMPLEX, 0.42, (230, 230, 230), 1, cv2.LINE_AA)
