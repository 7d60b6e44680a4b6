"""Which pixels of a box belong to the target: clusters of colour and place, each taken or left as a whole.

A box holds background too; learnt from, it becomes part of the target and pulls it away. The pixels in and
about the box fall into clusters of like colour close together; a cluster is the target's if its pixels have
the target's colours and lie in the box. Clusters have sharper borders than single pixels' likelihoods.

Source: after [T] by METHODS 9 (clustering-based segmentation of the tracked region); the colour likelihoods
that choose among the clusters are ours.
"""

from __future__ import annotations

import cv2
import numpy as np
from numpy.typing import NDArray

from robot.messages import Box, Image
from robot.vision.colour_model import ColourModel
from robot.vision.picture_patch import patch_of

Mask = NDArray[np.bool_]
Floats = NDArray[np.float32]

PATCH_PX = 64
"""Longer edge at which is clustered."""
ROOM = 1.5
"""Of the box's edges: so large a rectangle about it is clustered."""
GRID = 4
"""Clusters begin as the cells of such a grid, so that no chance is needed."""
ROUNDS = 8
PLACE_WEIGHT = 0.6
"""Of a pixel's distance in the patch against a grey level's in L, a or b: near pixels belong together."""
LEAST_LIKELIHOOD, LEAST_INSIDE = 0.5, 0.6
"""A target's cluster: mean likelihood, and share of its pixels in the box."""
LEAST_SHARE = 0.15
"""Of the box: with less found the colours tell nothing, and the whole box is taken."""


def support_of(image: Image, box: Box, colours: ColourModel) -> Mask:
    """Pixels (H, W) of a BGR picture that belong to the target in the box.

    Where its colours do not tell it from its surroundings: all of the box.

    >>> picture = np.full((120, 160, 3), (200, 120, 30), np.uint8)
    >>> cv2.circle(picture, (80, 60), 20, (20, 30, 220), -1) is picture
    True
    >>> target = ColourModel.learnt(picture[20:100, 40:120], (40.0, 40.0))
    >>> found = support_of(picture, Box(60, 40, 41, 41), target)
    >>> abs(int(found.sum()) - 1256) < 130, bool(found[60, 80]), bool(found[42, 62])
    (True, True, False)
    """
    shrink = PATCH_PX / (ROOM * max(box.w, box.h))
    columns, rows = (max(round(ROOM * edge * shrink), 8) for edge in (box.w, box.h))
    patch = patch_of(image, box.centre, (ROOM * box.w, ROOM * box.h), (columns, rows))
    cluster = _clusters(patch)
    inside = _inside(rows, columns)
    size = np.maximum(np.bincount(cluster.ravel(), minlength=GRID * GRID), 1)
    likely, within = (
        np.bincount(cluster.ravel(), values.ravel().astype(np.float64), GRID * GRID) / size
        for values in (colours.likelihood(patch), inside)
    )
    mine = ((likely > LEAST_LIKELIHOOD) & (within > LEAST_INSIDE))[cluster] & inside
    if mine.sum() < LEAST_SHARE * inside.sum():
        mine = inside
    return _in_picture(_whole(mine), image.shape, box)


def _clusters(patch: Image) -> NDArray[np.int32]:
    """Cluster of every pixel (rows, columns), by k-means on colour and place."""
    rows, columns = patch.shape[:2]
    lab = cv2.cvtColor(cv2.GaussianBlur(patch, (0, 0), 0.8), cv2.COLOR_BGR2LAB).astype(np.float32)
    y, x = np.mgrid[:rows, :columns].astype(np.float32)
    place = np.stack([y, x], axis=2) * np.float32(PLACE_WEIGHT)
    features = np.concatenate([lab, place], axis=2).reshape(-1, 5)
    first = (y * GRID // rows) * GRID + x * GRID // columns
    _, found, _ = cv2.kmeans(
        features,
        GRID * GRID,
        first.astype(np.int32).reshape(-1, 1),
        (cv2.TERM_CRITERIA_MAX_ITER, ROUNDS, 0.0),
        1,
        cv2.KMEANS_USE_INITIAL_LABELS,
    )
    return np.asarray(found, np.int32).reshape(rows, columns)


def _inside(rows: int, columns: int) -> Mask:
    """Pixels of the patch within the box."""
    y, x = np.ogrid[:rows, :columns]
    down, across = (np.abs(c + 0.5 - n / 2) <= n / (2 * ROOM) for c, n in ((y, rows), (x, columns)))
    return np.asarray(down & across, np.bool_)


def _whole(mask: Mask) -> Mask:
    """The mask without specks and holes."""
    disc = cv2.getStructuringElement(cv2.MORPH_ELLIPSE, (5, 5))
    closed = cv2.morphologyEx(mask.view(np.uint8), cv2.MORPH_CLOSE, disc)
    return np.asarray(cv2.morphologyEx(closed, cv2.MORPH_OPEN, disc) > 0, np.bool_)


def _in_picture(mask: Mask, shape: tuple[int, ...], box: Box) -> Mask:
    """The patch's mask at its place in the picture."""
    rows, columns = mask.shape
    per_px = ROOM * box.w / columns, ROOM * box.h / rows
    (u, v) = box.centre
    left, top = u - 0.5 * ROOM * box.w, v - 0.5 * ROOM * box.h
    placing = np.array(
        [[per_px[0], 0.0, left + 0.5 * per_px[0] - 0.5], [0.0, per_px[1], top + 0.5 * per_px[1] - 0.5]]
    )
    drawn = cv2.warpAffine(mask.astype(np.float32), placing, (shape[1], shape[0]))
    return np.asarray(drawn > 0.5, np.bool_)
