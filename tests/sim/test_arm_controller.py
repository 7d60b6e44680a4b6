"""The emulated controller by its registers alone: what a master may rely on, and what stops the arm."""

from __future__ import annotations

import math
import struct

import pytest

from robot.sim.arm_controller import ArmController
from robot.sim.arm_registers import ILLEGAL_ADDRESS, ILLEGAL_FUNCTION, ILLEGAL_VALUE, ArmRegisters

START = tuple(math.radians(angle) for angle in (0.0, -30.0, 110.0, 0.0, -80.0, 0.0))
OFF, ENABLED, MOVING, FAULT, E_STOP, PROTECTIVE = range(6)
DONE, REPLACED, STOPPED, NO_HEART, SAFETY = 1, 2, 3, 4, 5


class Master:
    """Speaks to the registers as any Modbus master would."""

    def __init__(self) -> None:
        self.arm = ArmController(START)
        self.registers = ArmRegisters(self.arm)
        self.beats = 0

    def beat(self, owner: int = 7, percent: int = 100, watchdog_ms: int = 300) -> int:
        self.beats += 1
        return self.registers.write(16, 0, [self.beats, owner, percent, watchdog_ms])

    def live(self, seconds: float, percent: int = 100) -> None:
        for _ in range(round(seconds / 0.05)):
            self.beat(percent=percent)
            self.arm.advance(0.05)

    def on(self) -> Master:
        self.beat()
        self.registers.write(15, 0, [1])
        return self

    def move(self, number: int, degrees: float = 40.0, speed: int = 50, opcode: int = 1) -> int:
        joints = [round(math.degrees(q) * 1000) for q in START]
        joints[0] = round(degrees * 1000)
        raw = struct.pack(">HHH6iH", opcode, speed, 0, *joints, number)
        return self.registers.write(16, 16, struct.unpack(">16H", raw))

    def status(self, at: int) -> int:
        return self.registers.read(4, at, 1)[0]

    @property
    def state(self) -> int:
        return self.status(2)

    @property
    def ended(self) -> tuple[int, int]:
        return self.status(8), self.status(9)

    @property
    def joint(self) -> float:
        return float(struct.unpack(">i", struct.pack(">2H", *self.registers.read(4, 10, 2)))[0]) / 1000.0


def test_a_motion_from_begin_to_end() -> None:
    master = Master().on()
    assert master.state == ENABLED
    assert master.move(5) == 0
    assert (master.state, master.status(7), master.ended) == (MOVING, 5, (0, 0))
    master.live(0.2)
    assert 0.0 < master.joint < 40.0
    assert master.registers.read(2, 0, 7) == [1, 0, 0, 1, 0, 0, 0]
    speed = struct.unpack(">h", struct.pack(">H", master.status(34)))[0] / 10.0
    assert 20.0 < speed <= 125.0
    master.live(0.8)
    assert (master.state, master.ended, master.joint) == (ENABLED, (5, DONE), 40.0)
    assert master.registers.read(2, 3, 2) == [0, 1]


def test_the_same_number_is_begun_once() -> None:
    master = Master().on()
    master.move(5)
    master.live(1.0)
    master.move(5, degrees=-40.0)
    assert master.state == ENABLED
    master.move(4, degrees=-40.0)
    master.live(0.5)
    assert master.joint == 40.0
    master.move(6, degrees=0.0)
    assert master.state == MOVING


def test_numbers_go_round() -> None:
    master = Master().on()
    for number, degrees in ((65535, 1.0), (1, 2.0)):
        master.move(number, degrees)
        master.live(0.5)
        assert (master.ended, master.joint) == ((number, DONE), degrees)
    master.move(65535, 3.0)
    assert master.state == ENABLED


@pytest.mark.parametrize("watchdog_ms", [100, 300])
def test_without_heartbeat_it_stops_in_time_and_is_nobodys(watchdog_ms: int) -> None:
    master = Master().on()
    master.beat(watchdog_ms=watchdog_ms)
    master.move(1, speed=20, degrees=90.0)
    master.arm.advance(watchdog_ms / 1000.0)
    assert master.arm.moving
    master.arm.advance(0.1)
    at = master.joint
    assert (master.state, master.ended) == (ENABLED, (1, NO_HEART))
    master.arm.advance(1.0)
    assert master.joint == at
    assert master.registers.read(3, 1, 1) == [0]
    assert master.status(5) == 1
    master.move(2)
    assert master.ended == (2, 15)
    master.live(0.5)
    assert master.joint == at


def test_the_same_heartbeat_again_is_none() -> None:
    master = Master().on()
    master.move(1, speed=10, degrees=90.0)
    for _ in range(10):
        master.registers.write(16, 0, [master.beats, 7, 100, 300])
        master.arm.advance(0.05)
    assert master.ended == (1, NO_HEART)


@pytest.mark.parametrize("how", ["stop", "emergency", "protective", "fault", "disable"])
def test_whatever_stops_it_stops_it_within_100_ms(how: str) -> None:
    master = Master().on()
    master.move(1, speed=100, degrees=150.0)
    master.live(0.3)
    {
        "stop": lambda: master.registers.write(15, 1, [1]),
        "emergency": master.arm.press_emergency_stop,
        "protective": master.arm.trip_protective_stop,
        "fault": lambda: master.arm.fail(2),
        "disable": lambda: master.registers.write(15, 0, [0]),
    }[how]()
    master.move(2)
    master.live(0.1)
    at = master.joint
    assert not master.arm.moving
    assert master.ended[0] == 1
    assert master.ended[1] == (STOPPED if how in ("stop", "disable") else SAFETY)
    assert master.state == {
        "stop": ENABLED,
        "emergency": E_STOP,
        "protective": PROTECTIVE,
        "fault": FAULT,
    }.get(how, OFF)
    master.live(0.5)
    assert master.joint == at
    assert master.registers.read(2, 4, 1) == [0]


def test_a_fault_keeps_the_drives_off_until_it_is_reset() -> None:
    master = Master().on()
    master.arm.fail(2)
    master.registers.write(15, 0, [1])
    assert (master.state, master.status(4), master.arm.powered) == (FAULT, 2, False)
    master.registers.write(15, 2, [1])
    assert master.state == OFF
    master.registers.write(15, 0, [1])
    assert master.state == ENABLED


def test_after_an_emergency_stop_the_drives_stay_off_until_enabled() -> None:
    master = Master().on()
    master.arm.press_emergency_stop()
    master.registers.write(15, 0, [1])
    assert (master.state, master.arm.powered) == (E_STOP, False)
    master.arm.release_emergency_stop()
    assert master.state == OFF


@pytest.mark.parametrize(
    ("command", "result"),
    [
        ({"opcode": 3}, 10),
        ({"degrees": 171.0}, 13),
        ({"speed": 0}, 14),
        ({"speed": 101}, 14),
        ({"opcode": 2}, 12),
    ],
)
def test_refusals_say_why_and_move_nothing(command: dict[str, int], result: int) -> None:
    master = Master().on()
    assert master.move(9, **command) == 0
    assert (master.status(7), master.ended, master.state) == (0, (9, result), ENABLED)


def test_refusals_of_the_controller_itself() -> None:
    master = Master()
    master.beat()
    master.move(1)
    assert master.ended == (1, 11)
    master.on()
    master.arm.refusing = True
    master.move(2)
    assert master.ended == (2, 18)
    master.arm.refusing = False
    master.arm.remote = False
    master.move(3)
    assert master.ended == (3, 17)


def test_a_newer_command_replaces_the_one_under_way_without_a_jump() -> None:
    master = Master().on()
    master.move(1, degrees=90.0, speed=100)
    master.live(0.3)
    master.move(2, degrees=-20.0, speed=100)
    before = master.arm.joints
    for _ in range(200):
        master.beat()
        master.arm.advance(0.01)
        assert abs(master.arm.joints[0] - before[0]) <= math.radians(250.0) * 0.0101
        before = master.arm.joints
    assert (master.ended, master.joint) == ((2, DONE), -20.0)


def test_a_stop_ends_the_waiting_command_too() -> None:
    master = Master().on()
    master.move(1, degrees=90.0, speed=100)
    master.live(0.3)
    master.move(2, degrees=-20.0, speed=100)
    master.registers.write(15, 1, [1])
    master.live(1.0)
    assert master.ended == (2, STOPPED)
    assert master.joint > 0.0


def test_the_speed_limit_holds_and_lets_go() -> None:
    master = Master().on()
    master.move(1, degrees=90.0)
    master.live(0.2, percent=0)
    at = master.joint
    master.live(0.5, percent=0)
    assert (master.joint, master.state) == (at, MOVING)
    master.live(1.5)
    assert master.ended == (1, DONE)


def test_partial_and_foreign_writes_are_refused_and_change_nothing() -> None:
    master = Master().on()
    before = master.registers.read(3, 0, 32)
    assert master.registers.write(16, 16, [1] * 15) == ILLEGAL_ADDRESS
    assert master.registers.write(16, 31, [5]) == ILLEGAL_ADDRESS
    assert master.registers.write(16, 3, [300] * 2) == ILLEGAL_ADDRESS
    assert master.registers.write(16, 0, [1] * 32) == ILLEGAL_ADDRESS
    assert master.registers.write(16, -1, [1]) == ILLEGAL_ADDRESS
    assert master.registers.write(15, 7, [1, 1]) == ILLEGAL_ADDRESS
    assert master.registers.write(6, 0, [1]) == ILLEGAL_FUNCTION
    assert master.beat(owner=8) == ILLEGAL_VALUE
    assert master.beat(percent=101) == ILLEGAL_VALUE
    assert master.beat(watchdog_ms=0) == ILLEGAL_VALUE
    assert master.registers.read(3, 0, 32) == before
    with pytest.raises(IndexError):
        master.registers.read(4, 39, 2)


def test_gripper_and_leds() -> None:
    master = Master().on()
    master.registers.write(15, 3, [1, 0, 1, 0, 1])
    assert master.registers.leds == (False, True, False, True)
    assert not master.arm.gripper_closed
    master.live(0.35)
    assert master.registers.read(2, 6, 1) == [1]
    master.registers.write(15, 3, [0])
    master.live(0.1)
    assert master.registers.read(2, 6, 1) == [0]


def test_frozen_it_answers_as_before_and_obeys_nothing() -> None:
    master = Master().on()
    master.move(1, degrees=90.0)
    master.live(0.2)
    before = master.registers.read(4, 0, 40)
    master.arm.frozen = True
    assert master.beat() == 0
    assert master.registers.write(15, 1, [1]) == 0
    master.arm.advance(2.0)
    assert master.registers.read(4, 0, 40) == before
    assert master.arm.joints[0] == pytest.approx(math.radians(90.0))
