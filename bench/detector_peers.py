"""What people take from OpenCV to find a taught thing: SIFT with a homography, matchTemplate in scales."""

from __future__ import annotations

from collections.abc import Sequence

import cv2
import numpy as np

from bench.detector_uiuc import Found
from robot.messages import Box, Image

RATIO, LEAST_MATCHES, INLIER_PX = 0.75, 8, 4.0
SCALES = tuple(2.0 ** (step / 4) for step in range(-3, 6))
TEMPLATES = 12
TEMPLATE_PX = 48


class SiftHomography:
    """Lowe's ratio test and a homography by RANSAC, against each view; the view with most inliers tells."""

    name = "SIFT + homography"

    def __init__(self, views: Sequence[Image]) -> None:
        self._sift = cv2.SIFT.create()
        self._matcher = cv2.BFMatcher(cv2.NORM_L2)
        self._views = [(view.shape, *self._sift.detectAndCompute(view, None)) for view in views]

    def find(self, name: str, image: Image) -> list[Found]:
        """At most one detection; its score is the number of inliers."""
        points, descriptors = self._sift.detectAndCompute(image, None)
        best: Found | None = None
        for shape, own, described in self._views:
            if described is None or descriptors is None or len(descriptors) < 2:
                continue
            pairs = [p for p in self._matcher.knnMatch(described, descriptors, k=2) if len(p) == 2]
            good = [a for a, b in pairs if a.distance < RATIO * b.distance]
            if len(good) < LEAST_MATCHES:
                continue
            here = np.array([own[m.queryIdx].pt for m in good], np.float32)
            there = np.array([points[m.trainIdx].pt for m in good], np.float32)
            mapped, inlier = cv2.findHomography(here, there, cv2.RANSAC, INLIER_PX)
            if mapped is None:
                continue
            height, width = shape[:2]
            corners = np.array([[[0, 0]], [[width, 0]], [[width, height]], [[0, height]]], np.float32)
            x, y, w, h = cv2.boundingRect(cv2.perspectiveTransform(corners, mapped))
            score = float(inlier.sum())
            if best is None or score > best.score:
                best = Found(name, Box(float(x), float(y), float(w), float(h)), score)
        return [best] if best else []


class TemplateScales:
    """Normalised correlation with a few views in a pyramid of sizes."""

    name = "matchTemplate"

    def __init__(self, views: Sequence[Image]) -> None:
        chosen = [views[int(i)] for i in np.linspace(0, len(views) - 1, min(TEMPLATES, len(views)))]
        self._views = [cv2.resize(v, None, fx=s, fy=s) for v in chosen for s in [TEMPLATE_PX / max(v.shape)]]

    def find(self, name: str, image: Image) -> list[Found]:
        """The best place of each size; scores -1 .. 1."""
        found = []
        for scale in SCALES:
            small = cv2.resize(image, None, fx=1 / scale, fy=1 / scale, interpolation=cv2.INTER_AREA)
            for view in self._views:
                if small.shape[0] < view.shape[0] or small.shape[1] < view.shape[1]:
                    continue
                _, score, _, (x, y) = cv2.minMaxLoc(cv2.matchTemplate(small, view, cv2.TM_CCOEFF_NORMED))
                height, width = view.shape
                found.append(Found(name, Box(x * scale, y * scale, width * scale, height * scale), score))
        found.sort(key=lambda f: -f.score)
        return found[:1]
