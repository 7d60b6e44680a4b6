"""When the lamp burns: by brightness with hysteresis, or as wanted; and whether it gives any light."""

from __future__ import annotations

from robot.messages import Fault, Lamp


def lamp_level(
    wanted: Lamp, brightness: float | None, level: float, on_below: float, off_above: float
) -> float:
    """The lamp's next level 0..1 from its present one and the mean picture brightness (0..255).

    Between `on_below` and `off_above` it stays as it is, so that its own light does not make it flicker.

    >>> lamp_level(Lamp.AUTO, 20.0, 0.0, 45.0, 110.0), lamp_level(Lamp.AUTO, 80.0, 1.0, 45.0, 110.0)
    (1.0, 1.0)
    """
    if wanted is Lamp.ON:
        return 1.0
    if wanted is Lamp.OFF:
        return 0.0
    if brightness is None:
        return level
    if brightness < on_below:
        return 1.0
    if brightness > off_above:
        return 0.0
    return level


class LampWatch:
    """Notices a lamp that gives no light, by what the pictures do when it goes on and while it burns.

    Told each tick the level that was set and the newest brightness. Two signs: the lamp went on in the dark
    and the picture did not brighten; it burnt and the picture went dark from one look to the next and stayed
    so. The fault is over when the picture brightens at a stroke with the lamp on.
    """

    RISE = 4.0
    """Grey levels a lamp brightens a dark picture at least."""
    DROP = 0.6
    """A picture darker than this share of the one before it has lost its light, not turned away."""
    JUDGE_AFTER_S = 0.8
    DARK = 60.0
    """Mean brightness above which a lamp's light is not told from the room's."""

    def __init__(self) -> None:
        self._level = 0.0
        self._suspect_at: float | None = None
        self._reference = 0.0
        self._last: tuple[float, float] | None = None
        self._dead_since: float | None = None

    def note(self, level: float, brightness: float | None, seen_at: float | None, now: float) -> None:
        """Tell the level set now, and the newest look's brightness with its capture time."""
        went_on = level >= 0.5 > self._level
        if level < 0.5:
            self._suspect_at = None
        self._level = level
        if brightness is None or seen_at is None:
            return
        if went_on and brightness < self.DARK:
            self._suspect_at, self._reference = now, brightness + self.RISE
        if self._last is None or seen_at > self._last[0]:
            self._look(brightness, seen_at)
        if self._suspect_at is not None and now - self._suspect_at >= self.JUDGE_AFTER_S:
            if self._dead_since is None:
                self._dead_since = self._suspect_at
            self._suspect_at = None

    def faults(self, now: float) -> tuple[Fault, ...]:
        """`lamp.dead` as long as it gives no light."""
        if self._dead_since is None:
            return ()
        return (Fault("lamp", "dead", self._dead_since, "switched on, but the picture stays dark"),)

    def _look(self, brightness: float, seen_at: float) -> None:
        """A new picture: did its light come, or go?"""
        before = self._last[1] if self._last is not None else brightness
        self._last = (seen_at, brightness)
        if self._level < 0.5:
            return
        if self._suspect_at is not None and brightness >= self._reference:
            self._suspect_at, self._dead_since = None, None
        elif self._dead_since is not None and brightness > before / self.DROP + self.RISE:
            self._dead_since = None
        elif self._suspect_at is None and self._dead_since is None and self._went_dark(before, brightness):
            self._suspect_at, self._reference = seen_at, (brightness + before) / 2

    def _went_dark(self, before: float, brightness: float) -> bool:
        return before > self.RISE and brightness < min(self.DROP * before, self.DARK)
