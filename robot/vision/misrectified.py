"""Whether the eyes' calibration no longer is the rig's: what several looks at the rows agree on.

Pure: `updated` takes the state so far and the newest check of a pair and gives the next state; `faults` words
it. One look may be wrong: eyes that look at different moments see a turning head, or a passing person, off
their rows. Only an error that is the same in look after look, while nothing turns, is the calibration's. It
stays until as many looks agree that the rows are right again; looks that tell nothing change nothing, for a
bumped camera does not mend itself in the dark.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np

from robot.messages import Fault
from robot.vision.pair_check import OFF_PX, OFF_YAW, PairCheck, misrectified_words

LOOKS = 6
EVERY_S = 0.5
"""Looks count at most so often: agreement within a moment proves nothing. At least 2.5 s are needed."""
DISSENTERS = 1
"""So many of the looks may say something else."""
AGREES_PX = 0.4
"""A look this near to the median, or within three of its standard deviations, agrees with it."""
FORGET_S = 20.0
"""Looks this much older than the newest count no more."""
CALM_RAD_S = math.radians(6.0)
"""Faster, eyes that are 20 ms apart look 0.12 degrees apart: 0.6 px at f = 305 px."""
SURE = 1.5
"""Standard deviations of one look by which the agreed error must exceed the limit."""
GOOD_SHARE = 0.8
"""Of the limits: an error below this is none any more."""


@dataclass(frozen=True, slots=True)
class Rectification:
    """What is known of it. since: when the fault began, None while there is none; looks: (time, check)."""

    since: float | None = None
    evidence: str = ""
    looks: tuple[tuple[float, PairCheck], ...] = ()

    @property
    def told(self) -> bool:
        """True while the fault holds."""
        return self.since is not None


def updated(before: Rectification, check: PairCheck, at: float, turning_rad_s: float = 0.0) -> Rectification:
    """The state after a look at the pair captured at `at`, seconds.

    turning_rad_s: how fast the eyes turned meanwhile, head and base together; where that is not known the
    looks themselves must show that it is no motion, by agreeing for long enough.

    >>> from robot.vision.pair_check import SignVotes
    >>> updated(Rectification(), PairCheck(0, 0.0, SignVotes(0, 0)), at=1.0).told
    False
    """
    newest = before.looks[-1][0] if before.looks else -math.inf
    # Exchanged eyes go through each other's rectification: what their rows show says nothing yet.
    if not check.tells or check.swapped or abs(turning_rad_s) > CALM_RAD_S or at - newest < EVERY_S:
        return before
    looks = (*(look for look in before.looks if at - look[0] <= FORGET_S), (at, check))[-LOOKS:]
    state = replace(before, looks=looks)
    typical = agreed([look for _, look in looks])
    if typical is None:
        return state
    if state.since is None and _off(typical):
        return replace(state, since=at, evidence=f"{misrectified_words(typical)} ({LOOKS} looks agree)")
    if state.since is not None and _good(typical):
        return replace(state, since=None, evidence="")
    return state


def faults(state: Rectification) -> tuple[Fault, ...]:
    """`camera.misrectified` while it holds."""
    return () if state.since is None else (Fault("camera", "misrectified", state.since, state.evidence),)


def agreed(looks: Sequence[PairCheck]) -> PairCheck | None:
    """The look nearest to the median of all; None if they are too few, or too many say something else."""
    if len(looks) < LOOKS:
        return None
    parts = np.array([look.parts_px for look in looks])
    apart = np.linalg.norm(parts - np.median(parts, axis=0), axis=1)
    near = apart <= np.maximum(AGREES_PX, [3.0 * look.error_sigma_px for look in looks])
    return looks[int(apart.argmin())] if (~near).sum() <= DISSENTERS else None


def _off(look: PairCheck) -> bool:
    """True if the error is beyond what a calibration may leave."""
    rows_off = look.error_px >= OFF_PX + SURE * look.error_sigma_px
    return rows_off or abs(look.yaw) >= OFF_YAW + SURE * look.yaw_sigma


def _good(look: PairCheck) -> bool:
    """True if the error is clearly within what a calibration may leave."""
    return look.error_px < GOOD_SHARE * OFF_PX and abs(look.yaw) < GOOD_SHARE * OFF_YAW
