"""Who may move the robot: a person at the stick takes and releases in so many words. Pure."""

from __future__ import annotations

from dataclasses import dataclass

from robot.messages import Event, TeleopInput, Twist

NEUTRAL = 0.05  # sticks deflected less than this count as let go


@dataclass(frozen=True, slots=True)
class Verdict:
    """What the person's newest word means: an event for the chart, a twist, or that the link went silent.

    held: the person said stop while driving: nothing moves before the sticks were let go.
    """

    event: Event | None = None
    twist: Twist = Twist()
    silent: bool = False
    held: bool = False


def decide(
    word: TeleopInput | None,
    handled_at: float,
    state: str,
    now: float,
    timeout: float,
    max_v: float,
    max_w: float,
    link_down: bool = False,
    held: bool = False,
) -> Verdict:
    """Judge the newest word in this state.

    A word acts as take, release, stop or arm once (`handled_at` is the time of the last one that did); its
    stick counts as long as it is younger than `timeout`. Taking needs neutral sticks. Stop is accepted from
    anyone, always: it ends autonomy, and a person who drives stands until the sticks were neutral (`held`).
    Silence is a lost link and never gives the robot back to autonomy; only a person at bare keys may be
    silent, for the robot stands between keys anyway. link_down: the teleop device tells that its link broke.

    >>> decide(TeleopInput(at=1.0, take=True), 0.0, "track", 1.0, 0.4, 0.2, 1.0).event.name
    'teleop_taken'
    """
    driving = state == "teleop"
    if word is None:
        return Verdict(silent=driving)
    old = now - word.at > timeout
    silent = driving and (link_down or (old and word.kind != "keys"))
    fresh = word.at > handled_at
    if fresh and word.stop:
        return Verdict(held=True) if driving else Verdict(event=_stop(state))
    event = _asked(word, state) if fresh else None
    if event is not None:
        return Verdict(event=event)
    if not driving or silent or old:
        return Verdict(silent=silent, held=held)
    if held and fresh and (_neutral(word) or word.kind == "keys"):
        held = False
    return Verdict(twist=Twist() if held else Twist(word.v * max_v, word.w * max_w), held=held)


def _asked(word: TeleopInput, state: str) -> Event | None:
    """The event a word asks for in so many words, if it may be had in this state."""
    if word.take and state != "teleop":
        return Event("teleop_taken", "a person took the stick") if _neutral(word) else None
    if state == "teleop" and word.arm:
        return Event("teleop_resumed", "the person gave the robot back to autonomy")
    if state == "teleop" and word.release:
        return Event("teleop_released", "the person let go")
    if state == "idle" and word.arm:
        return Event("armed", "a person armed the robot")
    if state == "halted" and word.release:
        return Event("disarmed", "a person acknowledged the halt")
    return None


def _neutral(word: TeleopInput) -> bool:
    return abs(word.v) < NEUTRAL and abs(word.w) < NEUTRAL


def _stop(state: str) -> Event | None:
    """Stop ends what the robot does by itself; idle and halted it stands already."""
    return None if state in ("idle", "halted") else Event("disarmed", "a person said stop")
