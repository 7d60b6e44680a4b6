"""The lamp: on in the dark, off in the light, and no flicker between."""

from __future__ import annotations

from hypothesis import given, settings
from hypothesis import strategies as st

from robot.lamp_control import LampWatch, lamp_level
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


def watched(levels_and_brightness):
    """Show the watch (level, brightness) each 40 ms; returns when lamp.dead was told, by tick."""
    watch = LampWatch()
    told = []
    for index, (level, brightness) in enumerate(levels_and_brightness):
        now = 0.04 * index
        watch.note(level, brightness, now, now)
        told.append([fault.key for fault in watch.faults(now)])
    return told


def test_a_lamp_that_lights_the_room_is_no_fault():
    assert not any(watched([(0.0, 12.0)] * 10 + [(1.0, 70.0)] * 60))


def test_a_lamp_that_was_switched_on_and_gives_no_light_is_told_within_two_seconds():
    told = watched([(0.0, 12.0)] * 10 + [(1.0, 12.0)] * 50)
    assert told[-1] == ["lamp.dead"]
    assert told.index(["lamp.dead"]) < 10 + 50


def test_a_lamp_that_dies_while_it_burns_is_told_and_its_return_too():
    told = watched([(1.0, 70.0)] * 20 + [(1.0, 12.0)] * 40 + [(1.0, 70.0)] * 5)
    assert told[59] == ["lamp.dead"]
    assert told[-1] == []


def test_turning_slowly_into_the_dark_is_no_dead_lamp():
    assert not any(watched([(1.0, 70.0 * 0.97**index) for index in range(100)]))


def test_in_a_bright_room_nothing_can_be_told():
    assert not any(watched([(0.0, 120.0)] * 5 + [(1.0, 121.0)] * 60))
