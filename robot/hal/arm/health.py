"""What the controller's report says of its health. Pure."""

from __future__ import annotations

from typing import Final

from robot.hal.arm.registers import ERRORS, Report

# Between two polls further apart than this nobody could have seen the echo change.
_LONGEST_POLL_GAP_S: Final = 0.2
_NONE_SEEN: Final = -1


class EchoWatch:
    """Notices a controller that answers while its program stands still: its echo of the heartbeat too.

    limit_s: an echo that did not change for so long, while it was looked at, stands still.

    >>> watch = EchoWatch(limit_s=0.25)
    >>> [watch.follows(echo, since_poll=0.1) for echo in (1, 2, 2, 2, 2, 3)]
    [True, True, True, True, False, True]
    """

    def __init__(self, limit_s: float) -> None:
        self._limit_s = limit_s
        self._echo = _NONE_SEEN
        self._still_s = 0.0

    def follows(self, echo: int, since_poll: float) -> bool:
        """False if the echo stands still; since_poll: seconds since it was looked at before."""
        if echo != self._echo:
            self._echo, self._still_s = echo, 0.0
            return True
        self._still_s += min(since_poll, _LONGEST_POLL_GAP_S)
        return self._still_s <= self._limit_s


def told_by(report: Report) -> dict[str, str | None]:
    """The controller's own faults: kind -> words, None where there is none."""
    stop = None
    if report.emergency_stop:
        stop = "emergency stop"
    elif report.protective_stop:
        stop = "protective stop"
    error = report.status.error
    words = f"error {error}: {ERRORS.get(error, 'see the manual of the controller')}"
    return {"fault": words if report.fault else None, "stopped": stop}
