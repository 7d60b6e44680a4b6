"""Is a rectified pair what stereo takes it for? Left eye's picture first, and matches in the same rows.

Exchanged eyes turn the sign of every disparity. A bumped camera moves matches off their rows, in the way the
camera was turned; depth is then wrong long before pictures look wrong. Both show in a few dozen matches.

To first order, a right eye turned by small angles from where the calibration has it sees a point of
normalised coordinates x, y (right eye) lower by

    (v_right - v_left) / f = pitch (1 + y^2) + roll x + stretch y + yaw x y

(the derivative of the rotation's homography); stretch is the ratio of the focal lengths less 1. Depth has no
part in it, so near and far matches speak alike.
"""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from calib.model import StereoRig
from robot.messages import Image
from robot.vision.pair_input import grey_pair, refuse_other_size
from robot.vision.pair_matches import PairMatches, pair_matches

Vector = NDArray[np.float64]
Matrix = NDArray[np.float64]
Mask = NDArray[np.bool_]

LEAST_MATCHES = 16
"""Fewer in their rows tell nothing."""
LEAST_AGREEMENT = 0.75
"""Share of all matches that must fit one rotation; chance matches lie anywhere in the searched rows."""
WITHIN_PX = 1.5
"""Of the fit: a match that agrees with it."""
OFF_PX = 0.7
"""Matches so far off their rows (root mean square over the picture): the calibration is not the rig's."""
OFF_YAW = math.radians(0.7)
"""Moves matches along the rows above all: where this is reached, disparities are wrong by 3.7 px at
f = 305 px, while rows are off by 0.3 px only."""
SURE = 3.0
"""Standard deviations beyond a limit that make one look sure of it."""
SUSPECTED = 2.0
"""Standard deviations of yaw from which on what it may do to disparities accuses nobody of exchanged eyes."""
REST = (0.05, 0.05, 0.05, 0.05)
"""What is believed of pitch, roll, stretch and yaw beforehand (standard deviations): keeps at nought what the
matches do not show."""
MATCH_SIGMA_PX = 0.15
"""A match is never better than this."""
INDEPENDENT = 40.0
"""Corners in one place err together: all of them weigh as at most so many."""
SCALES_PX = (16.0, 8.0, 4.0, 2.0, 1.5, 1.5)
"""Tukey's biweight narrows: the rows may be far off at first, one in three matches may be wrong."""
BISQUARE = 4.685
"""No narrower than so many of the matches' standard deviations (Tukey's constant)."""

LEAST_SHIFT_PX = 2.0
"""Disparities up to this say nothing of the sign: far things, a small error of the principal points."""
LEAST_VOTES, MAJORITY = 8, 0.9
"""So many matches must say the eyes are exchanged, and such a share of all that say anything: a few chance
matches never do."""
ROLL_SCALE, STRETCH_SCALE = math.radians(0.35), 0.007
"""As wrong as OFF_PX of offset: what moves matches so far at half a picture's width or height."""


@dataclass(frozen=True, slots=True)
class SignVotes:
    """How many matches lie farther right in the left picture (as they must), how many farther left."""

    ordered: int
    exchanged: int

    @property
    def swapped(self) -> bool:
        """True if the eyes are exchanged beyond doubt."""
        said = self.ordered + self.exchanged
        return self.exchanged >= LEAST_VOTES and self.exchanged >= MAJORITY * said


@dataclass(frozen=True, slots=True)
class PairCheck:
    """What one look at a pair says.

    matches: how many there are; agreement: share of them that fit one rotation; votes: their signs.
    pitch, roll, yaw: how far the right picture is turned against the left, radians: positive pitch moves it
    down, positive roll its right side; yaw shears rows towards the corners; stretch: focal lengths' ratio
    less 1. offset_px: how much lower the right picture lies in the middle.
    parts_px: what pitch, roll, stretch and yaw each move matches off their rows, root mean square over the
    picture, signed; error_px: all of them together; error_sigma_px, yaw_sigma: standard deviations.
    sigma_px: of one match about the fit.
    """

    matches: int
    agreement: float
    votes: SignVotes
    pitch: float = 0.0
    roll: float = 0.0
    stretch: float = 0.0
    yaw: float = 0.0
    offset_px: float = 0.0
    parts_px: tuple[float, float, float, float] = (0.0, 0.0, 0.0, 0.0)
    error_px: float = 0.0
    error_sigma_px: float = math.inf
    yaw_sigma: float = math.inf
    sigma_px: float = math.inf

    @property
    def tells(self) -> bool:
        """True if the matches are many enough, and agree well enough, to judge the rows at all."""
        return self.agreement >= LEAST_AGREEMENT and self.agreement * self.matches >= LEAST_MATCHES

    @property
    def swapped(self) -> bool:
        """True if left and right picture are exchanged beyond doubt."""
        return self.votes.swapped

    @property
    def misrectified(self) -> bool:
        """True if this one look is sure that the rows are off, or the eyes turned to one another.

        One look may be fooled by eyes that look at different moments; `robot.vision.misrectified` is not.
        """
        rows_off = self.error_px - OFF_PX > SURE * self.error_sigma_px
        turned = abs(self.yaw) - OFF_YAW > SURE * self.yaw_sigma
        return self.tells and (rows_off or turned)


def check_pair(left: Image, right: Image, rig: StereoRig) -> PairCheck:
    """Look at one rectified pair.

    left, right: (H, W, 3) BGR or (H, W) grey uint8; rig: the parallel rig whose pair this is meant to be.

    Raises:
        ValueError: pictures of different size, of another type, empty, or not of the rig's size.

    >>> import cv2
    >>> rig = StereoRig.parallel(240, 120, 210.0, 0.06)
    >>> noise = np.random.default_rng(1).integers(0, 255, (124, 260), np.uint8)
    >>> scene = cv2.GaussianBlur(noise, (0, 0), 2.0)
    >>> bumped = check_pair(scene[2:122, :240], scene[:120, 12:252], rig)
    >>> round(bumped.offset_px, 1), bumped.misrectified, bumped.swapped
    (2.0, True, False)
    """
    greys = grey_pair(left, right)
    refuse_other_size(greys[0], rig)
    return check_matches(pair_matches(*greys), rig)


def check_matches(matches: PairMatches, rig: StereoRig) -> PairCheck:
    """The same from matches already made."""
    if len(matches) < LEAST_VOTES:
        return PairCheck(len(matches), 0.0, SignVotes(0, 0))
    eye = rig.right
    x, y = (matches.right - (eye.cx, eye.cy)).T / eye.fx
    basis = np.stack([1.0 + y * y, x, y, x * y]) * eye.fx
    drop = matches.right[:, 1] - matches.left[:, 1]
    fitted, covariance, sigma = _fit(basis, drop)
    near = np.abs(drop - fitted @ basis) <= WITHIN_PX
    agreement = float(near.mean())
    yaw_sigma = math.sqrt(float(covariance[3, 3]))
    # Eyes turned to one another shift all disparities: no wonder then if some are negative.
    turned_px = eye.fx * abs(float(fitted[3])) if abs(float(fitted[3])) > SUSPECTED * yaw_sigma else 0.0
    kept = PairMatches(matches.left[near], matches.right[near])
    agreed = agreement >= LEAST_AGREEMENT
    votes = sign_votes(kept, rig.doffs, LEAST_SHIFT_PX + turned_px) if agreed else SignVotes(0, 0)
    spread = _spread(rig)
    parts = fitted * np.sqrt(np.diag(spread))
    error = math.sqrt(float(fitted @ spread @ fitted))
    slope = spread @ fitted / max(error, 1e-9)
    error_sigma = math.sqrt(float(slope @ covariance @ slope))
    pitch, roll, stretch, yaw = (float(angle) for angle in fitted)
    return PairCheck(
        len(matches), agreement, votes, pitch, roll, stretch, yaw, pitch * eye.fx,
        (float(parts[0]), float(parts[1]), float(parts[2]), float(parts[3])),
        error, error_sigma, yaw_sigma, sigma,
    )  # fmt: skip


def sign_votes(matches: PairMatches, doffs: float = 0.0, least_shift_px: float = LEAST_SHIFT_PX) -> SignVotes:
    """Count the matches possible in one order of the eyes only. doffs: cx_right - cx_left, px.

    least_shift_px: a disparity closer to 0 speaks for neither. In order, no u_left - u_right + doffs is
    negative; exchanged, no u_right - u_left + doffs.
    """
    shift = matches.left[:, 0] - matches.right[:, 0]
    in_order, in_exchange = shift + doffs >= -least_shift_px, doffs - shift >= -least_shift_px
    return SignVotes(int((in_order & ~in_exchange).sum()), int((in_exchange & ~in_order).sum()))


def complaint(check: PairCheck) -> str | None:
    """One line that names what is wrong with the pair and the likely cause; None if nothing is for sure."""
    if check.swapped:
        return (
            "left and right picture are exchanged (everything moved the wrong way; or both are mirrored): "
            "give LEFT first"
        )
    return misrectified_words(check) if check.misrectified else None


def misrectified_words(check: PairCheck) -> str:
    """How the right picture lies, by what is most off, and what to do about it."""
    wide = {
        "offset": abs(check.offset_px) / OFF_PX,
        "roll": abs(check.roll) / ROLL_SCALE,
        "stretch": abs(check.stretch) / STRETCH_SCALE,
        "yaw": abs(check.yaw) / OFF_YAW,
    }
    said = {
        "offset": f"the right picture lies {abs(check.offset_px):.1f} px too "
        f"{'low' if check.offset_px > 0 else 'high'}",
        "roll": f"the right picture is rolled by {math.degrees(abs(check.roll)):.1f} degrees "
        f"{'clockwise' if check.roll > 0 else 'counter-clockwise'}",
        "stretch": f"the right picture is {100 * abs(check.stretch):.1f} % "
        f"{'larger' if check.stretch > 0 else 'smaller'} (does it focus by itself?)",
        "yaw": f"the eyes are turned {math.degrees(abs(check.yaw)):.1f} degrees to one another",
    }
    most = max(wide, key=lambda cause: wide[cause])
    return f"{said[most]}: was a camera bumped? Calibrate again"


def _fit(basis: Matrix, drop: Vector) -> tuple[Vector, Matrix, float]:
    """Angles (4,) by a narrowing robust fit, their covariance (4, 4), and the matches' sigma in px."""
    rest = np.diag(1.0 / np.square(REST))
    fitted = np.array([float(np.median(drop)) / float(np.median(basis[0])), 0.0, 0.0, 0.0])
    normal, sigma = rest, MATCH_SIGMA_PX
    for narrow in SCALES_PX:
        off = drop - fitted @ basis
        sigma = max(_sigma(off), MATCH_SIGMA_PX)
        scale = max(narrow, BISQUARE * sigma)
        weight = np.where(np.abs(off) < scale, (1.0 - (off / scale) ** 2) ** 2, 0.0)
        weight *= min(1.0, INDEPENDENT / max(float(weight.sum()), 1e-9)) / sigma**2
        normal = (basis * weight) @ basis.T + rest
        fitted = np.asarray(np.linalg.solve(normal, basis @ (weight * drop)), np.float64)
    return fitted, np.asarray(np.linalg.inv(normal), np.float64), sigma


def _sigma(off: Vector) -> float:
    """Standard deviation from the median of the residuals: few chance matches do not make it large."""
    spent = len(REST) / len(off)
    return 1.4826 * float(np.median(np.abs(off))) / math.sqrt(max(1.0 - spent, 0.25))


def _spread(rig: StereoRig) -> Matrix:
    """(4, 4) Q: angles a move matches off their rows by sqrt(a Q a) px, root mean square over the picture."""
    eye = rig.right
    u, v = np.meshgrid(np.linspace(0, eye.width - 1, 9), np.linspace(0, eye.height - 1, 9))
    x, y = (u.ravel() - eye.cx) / eye.fx, (v.ravel() - eye.cy) / eye.fx
    basis = np.stack([1.0 + y * y, x, y, x * y]) * eye.fx
    return np.asarray(basis @ basis.T / basis.shape[1], np.float64)
