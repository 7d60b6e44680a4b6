"""The lamp: on in the dark, off in the light, and no flicker between."""

from __future__ import annotations

from hypothesis import given, settings
from hypothesis import strategies as st

from robot.lamp_control import lamp_level
from robot.messages import Lamp

ON_BELOW, OFF_ABOVE = 45.0, 110.0
LEVELS = st.sampled_from([0.0, 1.0])


def auto(brightness: float | None, level: float) -> float:
    return lamp_level(Lamp.AUTO, brightness, level, ON_BELOW, OFF_ABOVE)


@settings(deadline=None, max_examples=50)
@given(brightness=st.none() | st.floats(0, 255), level=LEVELS)
def test_a_state_that_wants_it_on_or_off_is_obeyed(brightness: float | None, level: float) -> None:
    assert lamp_level(Lamp.ON, brightness, level, ON_BELOW, OFF_ABOVE) == 1.0
    assert lamp_level(Lamp.OFF, brightness, level, ON_BELOW, OFF_ABOVE) == 0.0


@settings(deadline=None, max_examples=50)
@given(brightness=st.floats(0, 255), level=LEVELS)
def test_dark_switches_on_light_off_and_between_nothing_changes(brightness: float, level: float) -> None:
    wanted = 1.0 if brightness < ON_BELOW else 0.0 if brightness > OFF_ABOVE else level
    assert auto(brightness, level) == wanted


def test_its_own_light_does_not_make_it_flicker() -> None:
    """The lamp adds light to a dark room: without hysteresis it would go out at once, and on again."""
    room, lamp = 30.0, 60.0
    levels = [0.0]
    for _ in range(10):
        levels.append(auto(room + lamp * levels[-1], levels[-1]))
    assert levels[1:] == [1.0] * 10


@settings(deadline=None, max_examples=50)
@given(level=LEVELS)
def test_without_a_picture_it_stays_as_it_is(level: float) -> None:
    assert auto(None, level) == level


def test_the_thresholds_themselves_change_nothing() -> None:
    assert auto(ON_BELOW, 0.0) == 0.0
    assert auto(OFF_ABOVE, 1.0) == 1.0
