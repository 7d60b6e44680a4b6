"""Who may move the robot: a person at the stick takes and releases in so many words. Pure."""

from __future__ import annotations

from dataclasses import dataclass

from robot.messages import Event, TeleopInput, Twist

NEUTRAL = 0.05  # sticks deflected less than this count as let go


@dataclass(frozen=True, slots=True)
class Verdict:
    """What the person's newest word means: an event for the chart, a twist, or that the link went silent."""

    event: Event | None = None
    twist: Twist = Twist()
    silent: bool = False


def decide(
    word: TeleopInput | None,
    handled_at: float,
    state: str,
    now: float,
    timeout: float,
    max_v: float,
    max_w: float,
) -> Verdict:
    """Judge the newest word in this state.

    A word acts as take, release, stop or arm once (`handled_at` is the time of the last one that did); its
    stick counts as long as it is younger than `timeout`. Taking needs neutral sticks. Stop is accepted from
    anyone, always. Silence never gives the robot back to autonomy.

    >>> decide(TeleopInput(at=1.0, take=True), 0.0, "track", 1.0, 0.4, 0.2, 1.0).event.name
    'teleop_taken'
    """
    if word is None:
        return Verdict(silent=state == "teleop")
    silent = state == "teleop" and now - word.at > timeout
    fresh = word.at > handled_at
    if fresh and word.stop:
        return Verdict(event=_stop(state))
    if fresh and word.take and state != "teleop":
        neutral = abs(word.v) < NEUTRAL and abs(word.w) < NEUTRAL
        return Verdict(event=Event("teleop_taken", "a person took the stick") if neutral else None)
    if fresh and state == "teleop" and word.arm:
        return Verdict(event=Event("teleop_resumed", "the person gave the robot back to autonomy"))
    if fresh and state == "teleop" and word.release:
        return Verdict(event=Event("teleop_released", "the person let go"))
    if fresh and state == "idle" and word.arm:
        return Verdict(event=Event("armed", "a person armed the robot"))
    if fresh and state == "halted" and word.release:
        return Verdict(event=Event("disarmed", "a person acknowledged the halt"))
    if state != "teleop" or silent:
        return Verdict(silent=silent)
    return Verdict(twist=Twist(word.v * max_v, word.w * max_w))


def _stop(state: str) -> Event | None:
    if state in ("idle", "halted"):
        return None  # it stands already
    name = "teleop_released" if state == "teleop" else "disarmed"
    return Event(name, "a person said stop")
