"""The driver's reading of the register map: exact words, both word orders, numbers that wrap."""

from __future__ import annotations

import math
import struct

import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from robot.hal.arm import registers as map_
from robot.hal.arm.registers import Opcode

LONG = st.integers(-(2**31), 2**31 - 1)
REGISTER = st.integers(1, 65535)


def test_a_joint_command_word_for_word() -> None:
    joints = (math.radians(90.0), math.radians(-0.001), 0.0, 0.0, 0.0, math.radians(-180.0))
    block = map_.command_block(Opcode.MOVE_JOINTS, 25, map_.joint_targets(joints), 258, low_first=False)
    expected = struct.pack(">HHH6iH", 1, 25, 0, 90_000, -1, 0, 0, 0, -180_000, 258)
    assert struct.pack(">16H", *block) == expected


def test_a_linear_command_is_in_hundredths_of_a_millimetre() -> None:
    targets = map_.pose_targets((0.4, -0.00001, 1.0), (0.0, math.radians(90.0), math.radians(-0.5)))
    assert targets == [40_000, -1, 100_000, 0, 90_000, -500]


@settings(deadline=None, max_examples=60)
@given(st.lists(LONG, min_size=6, max_size=6))
def test_low_first_swaps_the_words_and_nothing_else(targets: list[int]) -> None:
    high = map_.command_block(Opcode.MOVE_LINEAR, 1, targets, 9, low_first=False)
    low = map_.command_block(Opcode.MOVE_LINEAR, 1, targets, 9, low_first=True)
    assert high[:3] == low[:3]
    assert high[15] == low[15] == 9
    assert low[3:15:2] == high[4:15:2]
    assert low[4:15:2] == high[3:15:2]


@pytest.mark.parametrize("target", [2**31, -(2**31) - 1])
def test_what_does_not_fit_is_refused(target: int) -> None:
    with pytest.raises(ValueError, match="32 bits"):
        map_.command_block(Opcode.MOVE_JOINTS, 1, [target, 0, 0, 0, 0, 0], 1, low_first=False)


@settings(deadline=None, max_examples=60)
@given(st.lists(LONG, min_size=12, max_size=12), st.booleans())
def test_a_poll_gives_back_what_the_registers_hold(longs: list[int], low_first: bool) -> None:
    words = [word for value in longs for word in struct.unpack(">HH", struct.pack(">i", value))]
    if low_first:
        words = [word for pair in zip(words[1::2], words[0::2], strict=True) for word in pair]
    head = [0x4152, 1, map_.State.MOVING, 1, 0, 0, 5, 3, 2, 1]
    bits = [True, False, True, True, False, False, True]
    report = map_.report_of([*head, *words], bits, low_first)
    assert report.arm.joints == pytest.approx([math.radians(v / 1000) for v in longs[:6]])
    assert report.arm.position == pytest.approx([v / 1e5 for v in longs[6:9]])
    assert report.arm.orientation == pytest.approx([math.radians(v / 1000) for v in longs[9:]])
    assert (report.arm.enabled, report.arm.moving, report.arm.in_position) == (True, True, False)
    assert (report.emergency_stop, report.protective_stop, report.fault) == (False, True, False)
    assert report.gripper_closed


@settings(deadline=None, max_examples=80)
@given(st.integers(1, 10**6))
def test_numbers_survive_the_wire(number: int) -> None:
    register = map_.on_wire(number)
    assert 1 <= register <= 65535
    assert map_.number_of(register, number) == number
    assert map_.number_of(map_.on_wire(number + 7), number) == number + 7


@settings(deadline=None, max_examples=80)
@given(REGISTER, st.integers(1, 1000))
def test_the_newer_number_wins_also_across_the_wrap(register: int, ahead: int) -> None:
    later = map_.on_wire(register + ahead)
    assert map_.newest(register, later) == later
    assert map_.newest(later, register) == later
