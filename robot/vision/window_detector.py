"""Finding a taught object by its whole shape: a small net looks at every window of a pyramid.

What ferns see in parts (`ferns`) is seen here at once, so that half an object is still told from what is
like a few of its parts. Windows about an object vote for its box (`box_votes`).

Sources: Rowley, Baluja, Kanade, "Neural network-based face detection" (PAMI 1998) for a net on every window;
Dalal and Triggs (CVPR 2005) for what it sees; Girshick et al. (CVPR 2014) for boxes told by the net.
"""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass

import cv2
import numpy as np
from numpy.typing import NDArray

from robot.messages import Box, Image
from robot.vision.box_votes import BoxVotes, counted
from robot.vision.gradient_histograms import CELL_PX
from robot.vision.named_arrays import below
from robot.vision.picture_patch import checked
from robot.vision.textures import texture
from robot.vision.view_warps import View, grey_bytes
from robot.vision.window_features import DIRECTIONS, edge_cells, windows_of
from robot.vision.window_net import WindowNet
from robot.vision.window_training import TrainingPlan, WindowShape, trained

Floats = NDArray[np.float32]

PER_OCTAVE = 4
DRAWN_SIZE = 352, 288
LEAST_VOTE = -4.0
"""Logit of a window from which it votes."""
MOST_OFF = 1.0
"""Of what a window tells of a box: windows beside the object were never asked for one."""
OVERHANG = 0.25
"""Of a window that may lie outside the picture."""


@dataclass(frozen=True, slots=True)
class WindowDetection:
    """An object found; score: 0..1, its probability among windows like those learnt from."""

    box: Box
    score: float


@dataclass(frozen=True, slots=True, eq=False)
class WindowDetector:
    """Finds one taught object in pictures. Make it with `WindowDetector.fit`; it never changes.

    >>> rng = np.random.default_rng(0)
    >>> poster = cv2.resize(rng.integers(0, 255, (8, 6), np.uint8), (60, 80))
    >>> walls = [cv2.resize(rng.integers(0, 255, (18, 22), np.uint8), (176, 144)) for _ in range(4)]
    >>> views = [View(poster, Box(0, 0, 60, 80))] * 2
    >>> detector = WindowDetector.fit(views, walls[:3], seed=0, plan=TrainingPlan(places=400))
    >>> picture = walls[3].copy(); picture[30:110, 70:130] = poster
    >>> detector.predict(picture)[0].box.iou(Box(70, 30, 60, 80)) > 0.7
    True
    """

    shape: WindowShape
    net: WindowNet

    @classmethod
    def fit(
        cls,
        views: Sequence[View],
        negatives: Sequence[Image],
        *,
        seed: int,
        plan: TrainingPlan | None = None,
    ) -> WindowDetector:
        """Learn an object.

        Args:
            views: of it, at least one.
            negatives: BGR or grey uint8 pictures without it; drawn ones are added.
            seed: of all that is random.
            plan: how much is learnt from; None: as much as a target taught to the robot.

        Raises:
            ValueError: no view; a box outside its image or smaller than 4 px.
        """
        if not views:
            raise ValueError("needs a view of the object")
        plan = plan or TrainingPlan()
        rng = np.random.default_rng([seed, 5])
        shape = WindowShape.of([view.box for view in views], plan.reference_px)
        drawn = [grey_bytes(texture(DRAWN_SIZE, rng)) for _ in range(plan.drawn)]
        others = [grey_bytes(image) for image in negatives] + drawn
        return cls(shape, trained(views, others, shape, plan, rng))

    def predict(
        self, image: Image, scales: Sequence[float] | None = None, *, least_score: float = 0.1, most: int = 10
    ) -> list[WindowDetection]:
        """Places where the object seems to be, best first.

        Args:
            image: (H, W[, 3]) uint8, BGR or grey.
            scales: sizes looked for, of the object over `shape.extent`; None: from 1 to where it would fill
                the picture. A net tells sizes between them too.
            least_score: what scores less is not told.
            most: how many at most.

        Raises:
            ValueError: the image is not uint8, or neither grey nor BGR.
        """
        grey = grey_bytes(checked(image))
        votes = [self._votes(grey, scale) for scale in self._scales(grey, scales)]
        boxes, logits = (np.concatenate(part) for part in zip(*votes, strict=True))
        found = counted(BoxVotes(boxes, logits), most)
        told = []
        for box, logit in zip(found.boxes, found.logits, strict=True):
            score = 1.0 / (1.0 + math.exp(-float(logit)))
            if score >= least_score:
                left, top, right, bottom = (float(edge) for edge in box)
                told.append(WindowDetection(Box(left, top, right - left, bottom - top), score))
        return told

    def _scales(self, grey: Image, scales: Sequence[float] | None) -> Sequence[float]:
        if scales is not None:
            return scales
        largest = max(1.0, 1.2 * max(grey.shape) / math.sqrt(math.prod(self.shape.extent)))
        return [2.0 ** (k / PER_OCTAVE) for k in range(1 + math.floor(PER_OCTAVE * math.log2(largest)))]

    def _votes(self, grey: Image, scale: float) -> tuple[Floats, Floats]:
        """Boxes (n, 4) in pixels of the picture and logits (n,) of the windows of one size."""
        down, across = (max(round(OVERHANG * edge), 1) for edge in (self.shape.rows, self.shape.columns))
        size = [max(round(edge / scale), CELL_PX) for edge in grey.shape]
        small = cv2.resize(grey, size[::-1], interpolation=cv2.INTER_AREA)
        rims = down * CELL_PX, down * CELL_PX, across * CELL_PX, across * CELL_PX
        framed = cv2.copyMakeBorder(small, *rims, cv2.BORDER_REPLICATE)
        cells = edge_cells(np.asarray(framed, np.uint8))
        if cells.shape[0] < self.shape.rows or cells.shape[1] < self.shape.columns:
            return np.zeros((0, 4), np.float32), np.zeros(0, np.float32)
        windows = windows_of(cells, self.shape.rows, self.shape.columns)
        answers = self.net.answers(windows.reshape(-1, windows.shape[2])).reshape(*windows.shape[:2], -1)
        rows, columns = np.nonzero(answers[..., 0] > LEAST_VOTE)
        logits = answers[rows, columns, 0]
        x, y, wide, tall = answers[rows, columns, 1:].clip(-MOST_OFF, MOST_OFF).T
        width, height = self.shape.extent
        u = (columns - across + self.shape.columns / 2) * CELL_PX + x * width
        v = (rows - down + self.shape.rows / 2) * CELL_PX + y * height
        half = width / 2 * np.exp(wide), height / 2 * np.exp(tall)
        to_picture = grey.shape[1] / size[1], grey.shape[0] / size[0]
        edges = u - half[0], v - half[1], u + half[0], v + half[1]
        boxes = np.stack([edge * to_picture[i % 2] for i, edge in enumerate(edges)], axis=1)
        return np.asarray(boxes, np.float32), logits

    def arrays(self) -> dict[str, NDArray[np.generic]]:
        """Everything learnt as plain arrays, keyed 'shape', 'net.first', ..."""
        shape = np.array([self.shape.rows, self.shape.columns, *self.shape.extent], np.float64)
        return {"shape": shape} | {f"net.{key}": value for key, value in self.net.arrays().items()}

    @classmethod
    def from_arrays(cls, arrays: Mapping[str, NDArray[np.generic]]) -> WindowDetector:
        """The inverse of `arrays`. Raises KeyError or ValueError where they do not fit together."""
        rows, columns, width, height = (float(value) for value in arrays["shape"])
        net = WindowNet.from_arrays(below("net.", arrays))
        filled = all(
            cells.is_integer() and abs(edge - cells * CELL_PX) <= CELL_PX and edge >= 1.0
            for edge, cells in ((width, columns), (height, rows))
        )
        if not filled or len(net.first) != rows * columns * DIRECTIONS:
            raise ValueError("the window net does not fit its windows")
        return cls(WindowShape(int(rows), int(columns), (width, height)), net)
