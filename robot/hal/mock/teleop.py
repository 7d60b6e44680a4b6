"""A person at the stick who follows a script."""

from __future__ import annotations

from collections.abc import Sequence

from robot.hal.mock.script import Mock
from robot.messages import TeleopInput


class MockTeleop(Mock):
    """Says each input at its time `at`; `lines` is what the person was told."""

    def __init__(self, inputs: Sequence[TeleopInput] = ()) -> None:
        super().__init__("teleop")
        self.inputs = sorted(inputs, key=lambda word: word.at)
        self.lines: list[str] = []
        self._last: TeleopInput | None = None

    def say(self, word: TeleopInput) -> None:
        """Add an input to the script."""
        self.inputs = sorted([*self.inputs, word], key=lambda each: each.at)

    def latest(self, now: float) -> TeleopInput | None:
        """The newest input said until `now`; the last heard while it fails."""
        if self._works(now, "latest"):
            said = [word for word in self.inputs if word.at <= now]
            self._last = said[-1] if said else self._last
        return self._last

    def tell(self, line: str, now: float) -> None:
        """Keep the line."""
        if self._works(now, "tell", line):
            self.lines.append(line)
