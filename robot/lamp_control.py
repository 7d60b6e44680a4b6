"""When the lamp burns: by the picture's brightness with hysteresis, or as a state wants it. Pure."""

from __future__ import annotations

from robot.messages import Lamp


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
