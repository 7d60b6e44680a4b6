"""One colour for each thing, the same in the video, in the plot and on paper."""

from __future__ import annotations

Rgb = tuple[int, int, int]

STATES: dict[str, Rgb] = {
    "idle": (138, 146, 158),
    "search": (86, 140, 236),
    "recognize": (160, 110, 226),
    "range": (22, 168, 178),
    "track": (44, 166, 92),
    "avoid": (236, 138, 30),
    "teleop": (224, 92, 166),
    "halted": (214, 56, 58),
}
"""The robot's states."""

UNKNOWN_STATE: Rgb = (120, 120, 120)
TARGET: Rgb = (255, 204, 51)
CANDIDATE: Rgb = (190, 160, 240)
FREE: Rgb = (70, 200, 120)
OBSTACLE_NEAR: Rgb = (240, 70, 60)
OBSTACLE_FAR: Rgb = (250, 180, 70)
PASSAGE: Rgb = (90, 210, 240)
WARNING: Rgb = (255, 170, 60)
FAULT: Rgb = (240, 80, 76)
INK: Rgb = (34, 39, 48)
PAPER: Rgb = (236, 239, 244)
MUTED: Rgb = (150, 158, 170)


def state_colour(state: str) -> Rgb:
    """The colour of a state, grey for one that is not in the list.

    >>> state_colour("track")
    (44, 166, 92)
    """
    return STATES.get(state, UNKNOWN_STATE)


def bgr(colour: Rgb) -> tuple[int, int, int]:
    """The colour as OpenCV orders it."""
    return colour[2], colour[1], colour[0]


def mixed(first: Rgb, second: Rgb, share: float) -> Rgb:
    """`share` 0..1 of the second colour, the rest of the first.

    >>> mixed((0, 0, 0), (100, 200, 50), 0.5)
    (50, 100, 25)
    """
    share = min(max(share, 0.0), 1.0)
    r, g, b = (round(a + (c - a) * share) for a, c in zip(first, second, strict=True))
    return r, g, b
