"""Who may move the robot: taking, releasing, stopping, and silence."""

import pytest

from robot.authority import decide
from robot.chart import LEAVES
from robot.messages import TeleopInput


def judge(state, now=1.0, handled_at=0.0, **word):
    return decide(TeleopInput(**{"at": 1.0, **word}), handled_at, state, now, 0.4, 0.2, 1.0)


@pytest.mark.parametrize("state", [state for state in LEAVES if state != "teleop"])
def test_a_person_takes_from_every_state_with_neutral_sticks(state):
    assert judge(state, take=True).event.name == "teleop_taken"
    assert judge(state, take=True, v=0.5).event is None


def test_a_word_acts_once():
    assert judge("track", take=True, handled_at=1.0).event is None


def test_the_stick_drives_only_in_teleop_and_only_while_fresh():
    assert judge("teleop", v=0.5, w=-1.0).twist.v == pytest.approx(0.1)
    assert judge("teleop", v=0.5, w=-1.0).twist.w == pytest.approx(-1.0)
    assert judge("track", v=0.5).twist.is_zero
    late = judge("teleop", v=0.5, now=1.5)
    assert late.twist.is_zero
    assert late.silent
    assert late.event is None, "silence never gives the robot back to autonomy"


@pytest.mark.parametrize("state", LEAVES)
def test_stop_is_accepted_always(state):
    verdict = judge(state, stop=True, v=1.0)
    assert verdict.twist.is_zero
    if state in ("idle", "halted"):
        assert verdict.event is None
    elif state == "teleop":
        assert verdict.event is None
        assert verdict.held
    else:
        assert verdict.event.name == "disarmed"


def test_after_a_stop_the_sticks_must_be_let_go_first():
    def next_word(held, **word):
        return decide(TeleopInput(at=1.0, **word), 0.9, "teleop", 1.0, 0.4, 0.2, 1.0, held=held)

    pushed = next_word(True, v=1.0)
    assert pushed.twist.is_zero
    assert pushed.held
    neutral = next_word(True, v=0.0)
    assert not neutral.held
    assert next_word(neutral.held, v=1.0).twist.v == pytest.approx(0.2)
    assert next_word(True, v=1.0, kind="keys").twist.v == pytest.approx(0.2), "a new key is a new will"


def test_keys_may_be_silent_but_a_broken_link_may_not():
    assert not judge("teleop", kind="keys", now=9.0).silent
    assert judge("teleop", kind="keys", v=1.0, now=9.0).twist.is_zero
    assert judge("teleop", kind="mavlink", now=9.0).silent
    broken = decide(TeleopInput(1.0, v=1.0, kind="keys"), 0.0, "teleop", 1.0, 0.4, 0.2, 1.0, link_down=True)
    assert broken.silent
    assert broken.twist.is_zero


def test_release_and_resume():
    assert judge("teleop", release=True).event.name == "teleop_released"
    assert judge("teleop", arm=True).event.name == "teleop_resumed"
    assert judge("idle", arm=True).event.name == "armed"
    assert judge("halted", release=True).event.name == "disarmed"


def test_nobody_ever_spoke():
    assert decide(None, -1.0, "track", 1.0, 0.4, 0.2, 1.0).silent is False
    assert decide(None, -1.0, "teleop", 1.0, 0.4, 0.2, 1.0).silent is True
