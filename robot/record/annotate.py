"""What the robot saw and thought, drawn on both eyes side by side. Pure: image in, image out.

`annotate_tick` draws a whole control tick; `annotate` draws whatever an `Overlay` holds.
"""

from __future__ import annotations

from dataclasses import dataclass, field
from typing import TypeVar

import cv2
import numpy as np

from calib.model import HeadMount, StereoRig
from robot.messages import (
    Box,
    Detection,
    FreeSpace,
    HeadPose,
    Image,
    Passage,
    Points,
    Pose2,
    Range,
    Sent,
    StereoFrame,
    Tick,
    Timed,
    Twist,
)
from robot.record import palette
from robot.record.canvas import chip, corners, text, text_width, wash
from robot.record.gate import draw_gate, gate_of, label_gate
from robot.record.projection import Eye, eyes

T = TypeVar("T")

CAPTION_HEIGHT = 48
"""Pixels of the bar below the pictures."""

TRACK_MAX_AGE_S = 0.5
"""Older boxes, ranges and passages are not drawn: they would lie about the picture they are drawn on."""

_OBSTACLE_NEAR_M, _OBSTACLE_FAR_M = 0.3, 2.0
_CLOSEST_FLOOR_M = 0.2


@dataclass(frozen=True, slots=True, eq=False)
class Overlay:
    """What to draw. Everything but state and time may be missing.

    box, candidates and passage in left-image pixels; target, free_space in the robot frame of their capture;
    `moved` is the robot's pose now as seen from where it was when free_space was captured.
    """

    state: str
    now: float
    head: HeadPose = field(default_factory=HeadPose)
    box: Box | None = None
    label: str = ""
    score: float | None = None
    confidence: float | None = None
    candidates: tuple[Detection, ...] = ()
    target: Range | None = None
    free_space: FreeSpace | None = None
    moved: Pose2 = field(default_factory=Pose2)
    sent: Sent = field(default_factory=lambda: Sent(Twist(), None, 0.0))
    faults: tuple[str, ...] = ()


def annotated_size(rig: StereoRig) -> tuple[int, int]:
    """(width, height) of what `annotate` returns.

    >>> annotated_size(StereoRig.parallel(352, 288, 305.0, 0.06))
    (704, 336)
    """
    return rig.left.width + rig.right.width, max(rig.left.height, rig.right.height) + CAPTION_HEIGHT


def annotate(frame: StereoFrame, overlay: Overlay, rig: StereoRig, mount: HeadMount) -> Image:
    """Draw the overlay on both eyes, side by side, with a caption bar below.

    Returns a new BGR uint8 image (H + CAPTION_HEIGHT, 2 W, 3); the frame is left as it is.
    """
    drawn = []
    for image, eye in zip((frame.left, frame.right), eyes(rig, mount, overlay.head), strict=True):
        canvas = np.ascontiguousarray(image).copy()
        _draw_floor(canvas, overlay, eye)
        _draw_passage(canvas, overlay, rig, eye)
        _draw_candidates(canvas, overlay, eye)
        _draw_target(canvas, overlay, eye)
        drawn.append(canvas)
    pictures = np.hstack(drawn)
    cv2.line(pictures, (drawn[0].shape[1], 0), (drawn[0].shape[1], pictures.shape[0]), (0, 0, 0), 1)
    return np.vstack([pictures, _caption(overlay, pictures.shape[1])])


def annotate_tick(tick: Tick, rig: StereoRig, mount: HeadMount) -> Image | None:
    """The picture of one control tick; None if the tick brought no new frame."""
    if tick.view is None:
        return None
    return annotate(tick.view.frame, overlay_of(tick), rig, mount)


def overlay_of(tick: Tick) -> Overlay:
    """What there is to draw about a tick; percepts too old for its frame are left out."""
    at = tick.view.frame.captured_at if tick.view is not None else tick.now
    percepts = tick.percepts
    track = _fresh(percepts.track, at)
    followed = track if track is not None and not track.lost else None
    candidates = _fresh(percepts.detections, at) or ()
    best = max(candidates, key=lambda d: d.score, default=None)
    free_space = _fresh(percepts.free_space, at)
    return Overlay(
        state=tick.state,
        now=tick.now,
        head=tick.view.head if tick.view is not None else tick.head,
        box=followed.box if followed is not None else None,
        label=best.label if best is not None else "target",
        score=best.score if best is not None else None,
        confidence=followed.confidence if followed is not None else None,
        candidates=candidates if followed is None else (),
        target=_fresh(percepts.target, at) if followed is not None else None,
        free_space=free_space,
        moved=_moved_since(percepts.free_space, at, tick.odometry.twist),
        sent=tick.sent,
        faults=tuple(fault.key for fault in tick.faults),
    )


def _fresh(percept: Timed[T] | None, at: float) -> T | None:
    if percept is None or percept.age(at) > TRACK_MAX_AGE_S:
        return None
    return percept.value


def _moved_since(percept: Timed[FreeSpace] | None, at: float, twist: Twist) -> Pose2:
    """How far the robot went between the percept's frame and this one, at its present speed."""
    if percept is None:
        return Pose2()
    age = max(percept.age(at), 0.0)
    return Pose2(twist.v * age, 0.0, twist.w * age)


# ----------------------------------------------------------------------------------------- in the pictures


def _draw_floor(canvas: Image, overlay: Overlay, eye: Eye) -> None:
    space = overlay.free_space
    if space is None:
        return
    wedges = [eye.project(overlay.moved.to_local(floor)) for floor in _free_wedges(space)]
    wash(canvas, [w for w in wedges if w is not None], palette.FREE, opacity=0.22)
    points = overlay.moved.to_local(space.obstacles)
    distances = np.hypot(points[:, 0], points[:, 1])
    for index in np.argsort(-distances):  # near ones on top
        _draw_obstacle(canvas, points[index], float(distances[index]), eye)


def _free_wedges(space: FreeSpace) -> list[Points]:
    """Floor quadrilaterals (4, 2) between near and free, half-way to the neighbouring bearings."""
    if len(space.bearings) < 2:
        return []
    edges = np.concatenate(
        [space.bearings[:1], 0.5 * (space.bearings[1:] + space.bearings[:-1]), space.bearings[-1:]]
    )
    wedges = []
    for right, left, near, free in zip(edges[:-1], edges[1:], space.near, space.free, strict=True):
        start = max(float(near), _CLOSEST_FLOOR_M)
        if free <= start:
            continue
        radii = np.array([start, start, free, free])
        angles = np.array([right, left, left, right])
        wedges.append(np.column_stack([radii * np.cos(angles), radii * np.sin(angles)]))
    return wedges


def _draw_obstacle(canvas: Image, point: Points, distance: float, eye: Eye) -> None:
    pixel = eye.project(point.reshape(1, 2))
    if pixel is None:
        return
    share = (distance - _OBSTACLE_NEAR_M) / (_OBSTACLE_FAR_M - _OBSTACLE_NEAR_M)
    colour = palette.bgr(palette.mixed(palette.OBSTACLE_NEAR, palette.OBSTACLE_FAR, share))
    u, v = (round(float(c)) for c in pixel[0])
    radius = int(np.clip(round(2.0 / max(distance, 0.3)), 1, 4))
    cv2.circle(canvas, (u, v), radius + 1, (0, 0, 0), -1, cv2.LINE_AA)
    cv2.circle(canvas, (u, v), radius, colour, -1, cv2.LINE_AA)


def _draw_passage(canvas: Image, overlay: Overlay, rig: StereoRig, eye: Eye) -> None:
    passage = overlay.free_space.passage if overlay.free_space is not None else None
    if passage is None:
        return
    shift = eye.column_shift(_passage_disparity(passage, rig, overlay.head, eye))
    gate = gate_of(passage)
    gate = Box(gate.x + shift, gate.y, gate.w, gate.h)
    draw_gate(canvas, gate, passage)
    if eye.is_left:
        label_gate(canvas, gate, passage)


def _passage_disparity(passage: Passage, rig: StereoRig, head: HeadPose, eye: Eye) -> float:
    depth = eye.left_depth(np.asarray(passage.position, dtype=np.float64))
    return rig.left.fx * rig.baseline / depth if depth > 0.05 else 0.0


def _draw_candidates(canvas: Image, overlay: Overlay, eye: Eye) -> None:
    if not eye.is_left:
        return
    for candidate in overlay.candidates:
        corners(canvas, candidate.box, palette.CANDIDATE, thickness=1)
        chip(canvas, f"{candidate.label} {candidate.score:.2f}", candidate.box, palette.CANDIDATE)


def _draw_target(canvas: Image, overlay: Overlay, eye: Eye) -> None:
    box = overlay.box
    if box is None:
        return
    if not eye.is_left:
        if overlay.target is None:
            return
        box = Box(box.x + eye.column_shift(overlay.target.disparity_px), box.y, box.w, box.h)
    corners(canvas, box, palette.TARGET, thickness=2)
    if eye.is_left:
        chip(canvas, _target_words(overlay), box, palette.TARGET)


def _target_words(overlay: Overlay) -> str:
    words = [overlay.label] if overlay.label else []
    if overlay.target is not None:
        words.append(f"{overlay.target.distance:.2f} m +-{overlay.target.sigma:.3f}")
    return "  ".join(words) or "target"


# ---------------------------------------------------------------------------------------------- the caption


def _caption(overlay: Overlay, width: int) -> Image:
    bar = np.empty((CAPTION_HEIGHT, width, 3), dtype=np.uint8)
    bar[:] = palette.bgr(palette.INK)
    colour = palette.state_colour(overlay.state)
    cv2.rectangle(bar, (0, 0), (116, CAPTION_HEIGHT), palette.bgr(colour), -1)
    text(bar, overlay.state.upper(), (10, 21), (255, 255, 255), size=0.46, bold=True)
    text(bar, f"{overlay.now:.2f} s", (10, 39), (255, 255, 255), size=0.4)
    text(bar, _first_line(overlay), (130, 20), palette.PAPER, size=0.4)
    _second_line(bar, overlay)
    _lamp(bar, overlay.sent.lamp, width)
    return bar


def _first_line(overlay: Overlay) -> str:
    words = [f"{overlay.sent.twist.v:+.2f} m/s", f"{np.degrees(overlay.sent.twist.w):+4.0f} deg/s"]
    words.append(f"head {np.degrees(overlay.head.pan):+.0f} / {np.degrees(overlay.head.tilt):+.0f} deg")
    if overlay.score is not None:
        words.append(f"score {overlay.score:.2f}")
    if overlay.confidence is not None:
        words.append(f"confidence {overlay.confidence:.2f}")
    return "    ".join(words)


def _second_line(bar: Image, overlay: Overlay) -> None:
    x = 130
    if overlay.faults:
        words = "fault: " + ", ".join(overlay.faults)
        text(bar, words, (x, 39), palette.FAULT, size=0.4, bold=True)
        x += text_width(words, size=0.4, bold=True) + 16
    if overlay.sent.limited_by:
        text(bar, f"held back by {overlay.sent.limited_by}", (x, 39), palette.WARNING, size=0.4)
    elif not overlay.faults:
        text(bar, "way free", (x, 39), palette.MUTED, size=0.4)


def _lamp(bar: Image, level: float, width: int) -> None:
    centre = (width - 58, CAPTION_HEIGHT // 2)
    glow = palette.mixed(palette.INK, palette.TARGET, level)
    cv2.circle(bar, centre, 9, palette.bgr(glow), -1, cv2.LINE_AA)
    cv2.circle(bar, centre, 9, palette.bgr(palette.MUTED), 1, cv2.LINE_AA)
    text(bar, "lamp", (width - 44, CAPTION_HEIGHT // 2 + 5), palette.MUTED, size=0.38)
