"""What a webcam makes of a picture: blur, response curve, slow automatic exposure, vignette, noise.

`EyeEmulation` turns one rendered picture into one a webcam would give; `SimStereoCamera` is the device:
two eyes, one exposure for both, frames numbered by the world's ticks, faults.

Noise of a frame depends on the seed and the frame's number alone, so that pictures nobody asks for need
not be drawn and a run in which vision skips frames sees the same ones.
"""

from __future__ import annotations

import math
from collections.abc import Callable
from dataclasses import dataclass

import cv2
import numpy as np
from numpy.typing import NDArray

from robot.messages import Fault, Image, StereoFrame

FULL_WELL = 2500.0
"""Electrons at white with gain 1: sets the shot noise (1.1 grey levels at mid grey)."""
READ_NOISE = 0.9
"""Grey levels at gain 1."""
EXPOSURE_TARGET = 105.0
EXPOSURE_LIMITS = (0.35, 2.6)
EXPOSURE_TIME_S = 0.5
BUMPED_ROWS = 2  # the right eye sees everything so many pixels lower once it was bumped
_NO_NEW_PICTURE = frozenset({"stale", "unpaired", "link", "missing"})
_BANK = 48  # how far the noise bank can be shifted
FLOAT_LUT = NDArray[np.float32]


@dataclass(frozen=True, slots=True)
class EyeSettings:
    """Weaknesses of a pair: noise (1: a common webcam), blur in pixels, skew in seconds, dropped share."""

    noise: float = 1.0
    blur_px: float = 0.5
    skew_s: float = 0.0
    dropped: float = 0.004


class EyeEmulation:
    """One eye. The same picture, exposure and frame number give the same bytes.

    width, height in pixels; rng draws what is this eye's own: gain (1 %), vignette and noise pattern.
    """

    def __init__(self, width: int, height: int, settings: EyeSettings, rng: np.random.Generator) -> None:
        self._settings = settings
        self._gain = 1.0 + float(np.clip(rng.normal(0.0, 0.01), -0.02, 0.02))
        self._size = (width, height)
        y, x = np.mgrid[:height, :width].astype(np.float32)
        radius = np.hypot(x - width / 2, y - height / 2) / math.hypot(width / 2, height / 2)
        vignette = 1.0 - rng.uniform(0.1, 0.18) * radius**2
        self._vignette = np.repeat(vignette[..., None].astype(np.float32), 3, axis=2)
        self._bank = rng.standard_normal((height + _BANK, width + _BANK, 3), dtype=np.float32)
        self._seed = int(rng.integers(0, 2**63))

    def expose(self, rendered: Image, exposure: float, seq: int) -> Image:
        """What this eye makes of a rendered picture, both (H, W, 3) uint8 BGR, as frame number `seq`."""
        blur = self._settings.blur_px
        light = cv2.GaussianBlur(rendered, (5, 5), blur) if blur > 0.05 else rendered
        response, sigma = _response(exposure * self._gain, exposure, self._settings.noise)
        picture = cv2.multiply(cv2.LUT(light, response), self._vignette)
        noise = cv2.multiply(cv2.LUT(light, sigma), self._noise(seq))
        # Adding into 8 bits rounds and saturates at both ends.
        return cv2.add(picture, noise, dtype=cv2.CV_8U).astype(np.uint8, copy=False)

    def _noise(self, seq: int) -> NDArray[np.float32]:
        # A shifted, perhaps mirrored view of one bank: as good as fresh noise to the eye and to any matcher,
        # at a hundredth of the cost.
        draw = np.random.default_rng([self._seed, seq])
        top, left, flip_v, flip_h = (int(n) for n in draw.integers(0, (_BANK, _BANK, 2, 2)))
        width, height = self._size
        view = self._bank[top : top + height, left : left + width]
        return np.ascontiguousarray(view[:: 1 - 2 * flip_v, :: 1 - 2 * flip_h])


def _response(gain: float, exposure: float, noise: float) -> tuple[FLOAT_LUT, FLOAT_LUT]:
    """Lookup tables of 256: grey level and its noise for each rendered level.

    A soft shoulder keeps highlights from clipping hard: y = 255 (1 - e^-s) / (1 - e^-k), s = k x.
    Shot noise grows with the root of the light, both grow with the exposure's gain.
    """
    shoulder = 1.1
    x = np.arange(256, dtype=np.float64) / 255.0 * gain
    grey = 255.0 * (1.0 - np.exp(-shoulder * x)) / (1.0 - math.exp(-shoulder))
    slope = shoulder * np.exp(-shoulder * x) / (1.0 - math.exp(-shoulder))
    analogue = max(exposure, 1.0)
    shot = 255.0 * np.sqrt(np.maximum(x, 0.0) * analogue / FULL_WELL)
    sigma = noise * np.hypot(shot, READ_NOISE * analogue) * np.maximum(slope, 0.15)
    return np.minimum(grey, 255.0).astype(np.float32), sigma.astype(np.float32)


class SimStereoCamera:
    """A `StereoCamera` that takes a pair at every tick of the world.

    render(skew_s) draws both eyes of this moment, the right one `skew_s` later. `capture` is called by the
    world once a tick; the picture is drawn when it is asked for, at the latest before the world moves on if
    a fault needs it. `broken` holds the kinds of fault at work.
    """

    def __init__(
        self, render: Callable[[float], tuple[Image, Image]], width: int, height: int,
        settings: EyeSettings, rng_left: np.random.Generator, rng_right: np.random.Generator,
    ) -> None:  # fmt: skip
        self._render = render
        self._settings = settings
        self._left = EyeEmulation(width, height, settings, rng_left)
        self._right = EyeEmulation(width, height, settings, rng_right)
        self._drop_seed = int(rng_left.integers(0, 2**63))
        self._black = np.zeros((height, width, 3), np.uint8)
        self._frame: StereoFrame | None = None
        self._pending: tuple[int, float] | None = None
        self._exposure: float | None = None
        self._exposed_at = 0.0
        self._broken: dict[str, float] = {}

    @property
    def exposure(self) -> float:
        """Gain the automatic exposure has settled on, 1 before the first picture."""
        return 1.0 if self._exposure is None else self._exposure

    def break_with(self, kinds: frozenset[str], now: float) -> None:
        """Set the faults at work from now on."""
        self._broken = {kind: self._broken.get(kind, now) for kind in sorted(kinds)}

    def capture(self, seq: int, now: float) -> None:
        """A new moment: the pair of this tick exists from now on (drawn when asked for)."""
        no_new = not _NO_NEW_PICTURE.isdisjoint(self._broken)
        self._pending = None if no_new or self._dropped(seq) else (seq, now)

    def latest(self, now: float) -> StereoFrame | None:
        """The newest pair; the one before if this tick's was dropped; None while there is none at all."""
        if "missing" in self._broken:
            return None
        if self._pending is not None:
            seq, captured_at = self._pending
            self._pending = None
            left, right = self._pictures(seq, captured_at)
            self._frame = StereoFrame(left, right, captured_at, seq)
        return self._frame

    def faults(self, now: float) -> tuple[Fault, ...]:
        """What a driver notices by itself: an eye that does not answer, eyes that no longer come as pairs."""
        told = {"link": "the left eye does not answer", "unpaired": "one eye lags more than half a period"}
        return tuple(
            Fault("camera", kind, self._broken[kind], words)
            for kind, words in told.items()
            if kind in self._broken
        )

    def close(self) -> None:
        """No new pictures from here on."""
        self._pending = None

    def _dropped(self, seq: int) -> bool:
        share = 0.5 if "dropped" in self._broken else self._settings.dropped
        return bool(seq > 1 and np.random.default_rng([self._drop_seed, seq]).random() < share)

    def _pictures(self, seq: int, now: float) -> tuple[Image, Image]:
        if "frozen" in self._broken and self._frame is not None:
            return self._frame.left, self._frame.right
        if "black" in self._broken:
            return self._black, self._black
        left, right = self._render(self._settings.skew_s)
        self._adapt(left, now)
        pair = (self._left.expose(left, self.exposure, seq), self._right.expose(right, self.exposure, seq))
        if "size" in self._broken:
            pair = (np.ascontiguousarray(pair[0][::2, ::2]), np.ascontiguousarray(pair[1][::2, ::2]))
        if "misrectified" in self._broken:
            pair = (pair[0], np.roll(pair[1], BUMPED_ROWS, axis=0))
        return (pair[1], pair[0]) if "swapped" in self._broken else pair

    def _adapt(self, rendered: Image, now: float) -> None:
        """Move the exposure towards a well-lit picture, slowly and within the sensor's limits."""
        mean = max(float(cv2.mean(rendered[::4, ::4])[1]), 1.0)
        wanted = min(max(EXPOSURE_TARGET / mean, EXPOSURE_LIMITS[0]), EXPOSURE_LIMITS[1])
        if self._exposure is None:
            self._exposure = wanted  # a camera that has been running for a while
        else:
            share = 1.0 - math.exp(-max(now - self._exposed_at, 0.0) / EXPOSURE_TIME_S)
            self._exposure *= (wanted / self._exposure) ** share
        self._exposed_at = now
