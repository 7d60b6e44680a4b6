"""What every teleop link does beyond tests/contract/test_contract_devices.py."""

from __future__ import annotations


def test_a_word_stays_the_same_word_until_the_next(teleop) -> None:  # type: ignore[no-untyped-def]
    teleop.wait(0.04)
    first = teleop.device.latest(teleop.now)
    assert first is not None
    assert teleop.device.latest(teleop.now) == first


def test_an_old_word_keeps_its_time(teleop) -> None:  # type: ignore[no-untyped-def]
    for _ in range(30):
        teleop.wait(0.04)
        last = teleop.device.latest(teleop.now)
    teleop.wait(5.0)
    assert teleop.device.latest(teleop.now).at == last.at, "its age is how silence is known"


def test_the_kind_of_speaker_is_told(teleop) -> None:  # type: ignore[no-untyped-def]
    teleop.wait(0.04)
    assert teleop.device.latest(teleop.now).kind in ("keys", "frames", "mavlink")


def test_telling_a_broken_link_is_harmless(breakable_teleop) -> None:  # type: ignore[no-untyped-def]
    rig = breakable_teleop
    rig.device.latest(rig.now)
    rig.break_down()
    for _ in range(5):
        rig.wait(0.04)
        rig.device.tell("search  v +0.00", rig.now)
    assert rig.device.faults(rig.now)
