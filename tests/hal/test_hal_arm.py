"""The arm's driver: what goes over the wire, commands that run once, silence, owners, faults in words."""

from __future__ import annotations

import itertools
import math

import pytest
from arm_wire import READY, START, TICK_S, ArmWire, is_command
from hypothesis import given, settings
from hypothesis import strategies as st

from robot.hal.arm.modbus_arm import ModbusArm
from robot.hal.arm.settings import ModbusArmSettings
from robot.hal.interfaces import DeviceError
from robot.hal.modbus import ModbusLink
from robot.sim.modbus_memory import MemoryModbusClient

NAN = math.nan


@pytest.fixture
def wire() -> ArmWire:
    return ArmWire()


# ----------------------------------------------------------------------------------------------- opening


def test_opening_takes_over_and_leaves_the_drives_off(wire: ArmWire) -> None:
    assert wire.controller.owner == ModbusArmSettings().owner
    assert wire.controller.watchdog_s == 0.3
    assert not wire.controller.powered
    assert wire.arm.read(0.0).joints == pytest.approx(START, abs=1e-5)


@pytest.mark.parametrize(
    ("register", "value", "words"), [(0, 0x1234, "register map"), (1, 2, "load the controller program")]
)
def test_something_else_at_the_address_is_told(register: int, value: int, words: str) -> None:
    wire = ArmWire(open_now=False)
    plain = wire.registers.read

    def other(function: int, address: int, count: int) -> list[int]:
        values = plain(function, address, count)
        if function == 4:
            values[register] = value
        return values

    wire.registers.read = other  # type: ignore[method-assign]
    link = ModbusLink(wire.client, "the controller")
    with pytest.raises(DeviceError, match=words):
        ModbusArm(link)
    assert link.closed


def test_nobody_there_is_told() -> None:
    wire = ArmWire(open_now=False)
    wire.client.cut = True
    with pytest.raises(DeviceError, match="does not answer"):
        wire.open()


def test_only_functions_1_to_4_15_and_16_are_used(wire: ArmWire) -> None:
    wire.ready()
    wire.arm.move_joints(READY, 1.0, wire.now)
    wire.arm.grip(True, wire.now)
    wire.arm.limit_speed(0.5, wire.now)
    wire.arm.stop(wire.now)
    wire.arm.reset_faults(wire.now)
    wire.run(1.2)
    wire.arm.close()
    assert {pdu[0] for pdu in wire.client.requests} <= {1, 2, 3, 4, 15, 16}


# ------------------------------------------------------------------------------------------ on the wire


def test_one_read_beats_and_polls(wire: ArmWire) -> None:
    wire.run(0.04)
    wire.client.requests.clear()
    wire.arm.read(wire.now)
    beat, *polls = wire.client.requests
    assert beat[:6] == bytes.fromhex("10 0000 0004 08")
    assert beat[8:] == bytes.fromhex("5242 0064 012c")
    assert polls == [bytes.fromhex("04 0000 0022"), bytes.fromhex("02 0000 0007")]
    wire.arm.read(wire.now)
    assert wire.client.requests[3][6:8] != beat[6:8]


def test_coils_on_the_wire(wire: ArmWire) -> None:
    wire.client.requests.clear()
    wire.arm.enable(0.0)
    wire.arm.grip(True, 0.0)
    wire.arm.stop(0.0)
    wire.arm.reset_faults(0.0)
    assert [pdu.hex() for pdu in wire.client.requests] == [
        "0f000000010101",
        "0f000300010101",
        "0f000100010101",
        "0f000200010101",
    ]


def test_a_command_is_one_telegram_with_its_number_last(wire: ArmWire) -> None:
    wire.ready()
    number = wire.arm.move_joints((0.0, 0.0, math.radians(90.0), 0.0, 0.0, 0.0), 0.305, wire.now)
    (pdu,) = [pdu for pdu in wire.client.requests if is_command(pdu)]
    assert pdu[:6] == bytes.fromhex("10 0010 0010 20")
    words = [int.from_bytes(pdu[at : at + 2], "big") for at in range(6, len(pdu), 2)]
    assert words == [1, 30, 0, 0, 0, 0, 0, 1, 0x5F90, 0, 0, 0, 0, 0, 0, number]


def test_low_word_first_moves_the_arm_to_the_same_place() -> None:
    ends = []
    for low_first in (False, True):
        wire = ArmWire(ModbusArmSettings(low_first=low_first))
        wire.ready()
        wire.arm.move_joints(READY, 1.0, wire.now)
        ends.append(wire.run(1.6))
        assert wire.controller.joints == pytest.approx(READY, abs=1e-5)
    assert ends[0] == ends[1]


# ------------------------------------------------------------------------------------- commands run once


def test_a_lost_answer_is_followed_by_the_same_number_and_one_motion(wire: ArmWire) -> None:
    wire.ready()
    wire.client.loses = is_command
    number = wire.arm.move_joints(READY, 0.5, wire.now)
    assert number == 1
    assert wire.arm.progress(number) == "sent"
    wire.client.loses = lambda pdu: False
    wire.run(2.4)
    assert wire.arm.progress(number) == "done"
    assert wire.controller.begun == wire.controller.ended == 1
    assert wire.controller.joints == pytest.approx(READY, abs=1e-5)


def test_a_command_that_never_arrived_is_sent_again(wire: ArmWire) -> None:
    wire.ready()
    wire.registers.silent = True
    # Nothing of what is sent now reaches the controller.
    wire.client._answer = lambda request: b""  # type: ignore[method-assign]
    number = wire.arm.move_joints(READY, 1.0, wire.now)
    del wire.client._answer
    wire.registers.silent = False
    assert wire.controller.begun == 0
    wire.run(1.6)
    assert wire.arm.progress(number) == "done"
    commands = [pdu for pdu in wire.client.requests if is_command(pdu)]
    assert len(commands) == 2
    assert commands[0] == commands[1]


def test_after_a_stop_a_lost_command_is_never_sent_again(wire: ArmWire) -> None:
    wire.ready()
    wire.client._answer = lambda request: b""  # type: ignore[method-assign]
    assert wire.arm.move_joints(READY, 1.0, wire.now) > 0
    wire.arm.stop(wire.now)
    del wire.client._answer
    wire.run(1.0)
    assert wire.controller.begun == 0
    assert wire.controller.joints == START


def test_after_an_outage_a_lost_command_is_never_sent_again(wire: ArmWire) -> None:
    wire.ready()
    wire.client._answer = lambda request: b""  # type: ignore[method-assign]
    assert wire.arm.move_joints(READY, 1.0, wire.now) > 0
    wire.run(0.4)
    assert wire.faults == {"arm.link"}
    del wire.client._answer
    wire.run(2.0)
    assert wire.faults == set()
    assert wire.controller.begun == 0


def test_a_command_not_taken_is_given_up_with_a_stop(wire: ArmWire) -> None:
    wire.ready()
    plain = wire.registers.write
    wire.registers.write = (  # type: ignore[method-assign]
        lambda function, address, values: 0 if address == 16 else plain(function, address, values)
    )
    number = wire.arm.move_joints(READY, 1.0, wire.now)
    wire.run(0.6)
    assert "arm.refused" in wire.faults
    assert "not taken" in wire.evidence
    assert wire.arm.progress(number) == "over"
    assert wire.client.requests.count(bytes.fromhex("0f000100010101")) == 1
    sent = len([pdu for pdu in wire.client.requests if is_command(pdu)])
    wire.run(0.6)
    assert len([pdu for pdu in wire.client.requests if is_command(pdu)]) == sent <= 6


def test_a_stop_that_got_lost_is_sent_again(wire: ArmWire) -> None:
    wire.ready()
    wire.arm.move_joints(READY, 0.1, wire.now)
    wire.run(0.2)
    wire.client._answer = lambda request: b""  # type: ignore[method-assign]
    wire.arm.stop(wire.now)
    del wire.client._answer
    assert wire.arm.move_joints(START, 1.0, wire.now) == 0
    state = wire.run(0.2)
    assert not state.moving
    assert wire.arm.progress(1) == "stopped"


def test_in_position_means_the_last_command(wire: ArmWire) -> None:
    wire.ready()
    wire.arm.move_joints(READY, 1.0, wire.now)
    assert wire.run(1.6).in_position
    wire.client._answer = lambda request: b""  # type: ignore[method-assign]
    wire.arm.move_joints(START, 1.0, wire.now)
    del wire.client._answer
    assert not wire.arm.read(wire.now).in_position


def test_numbers_go_on_after_a_restart_of_either_side(wire: ArmWire) -> None:
    wire.ready()
    for goal in (READY, START):
        wire.arm.move_joints(goal, 1.0, wire.now)
        wire.run(1.6)
    wire.arm.close()
    wire.arm = wire.open()
    wire.ready()
    assert wire.arm.move_joints(READY, 1.0, wire.now) == 3
    assert wire.run(1.6).in_position
    wire.client.cut = True
    wire.run(0.4)
    wire.controller.begun = wire.controller.ended = 40_000
    wire.client.cut = False
    wire.run(1.0)
    number = wire.arm.move_joints(START, 1.0, wire.now)
    assert number == 40_001
    assert wire.run(1.6).in_position
    assert wire.arm.progress(number) == "done"


def test_numbers_wrap(wire: ArmWire) -> None:
    wire.controller.begun = wire.controller.ended = 65534
    wire.arm = wire.open()
    wire.ready()
    numbers = []
    for goal in (READY, START, READY):
        numbers.append(wire.arm.move_joints(goal, 1.0, wire.now))
        assert wire.run(1.6).in_position
    assert numbers == [65535, 65536, 65537]
    assert wire.controller.ended == 2


# ----------------------------------------------------------------------------------------- bad commands


@pytest.mark.parametrize(
    "joints", [(0.0,) * 5, (NAN, *(0.0,) * 5), (math.inf, *(0.0,) * 5), (1e9, *(0.0,) * 5)]
)
def test_joints_that_are_none_are_refused_unsent(wire: ArmWire, joints: tuple[float, ...]) -> None:
    wire.ready()
    assert wire.arm.move_joints(joints, 1.0, wire.now) == 0
    assert wire.faults == {"arm.refused"}
    assert not any(map(is_command, wire.client.requests))


@pytest.mark.parametrize("speed", [0.0, -1.0, NAN])
def test_a_speed_that_is_none_is_refused_unsent(wire: ArmWire, speed: float) -> None:
    wire.ready()
    assert wire.arm.move_joints(READY, speed, wire.now) == 0
    assert wire.arm.move_linear((NAN, 0.0, 0.0), (0.0, 0.0, 0.0), 1.0, wire.now) == 0
    assert not any(map(is_command, wire.client.requests))


@pytest.mark.parametrize(("position", "words"), [((2.0, 0.0, 0.5), "reach"), ((0.0, 0.0, 0.335), "reach")])
def test_out_of_reach_is_told_for_a_while(wire: ArmWire, position, words) -> None:  # type: ignore[no-untyped-def]
    wire.ready()
    assert wire.arm.move_linear(position, (0.0, 0.0, 0.0), 1.0, wire.now) == 0
    assert wire.faults == {"arm.refused"}
    assert words in wire.evidence
    wire.run(0.96)
    assert wire.faults == {"arm.refused"}
    wire.run(0.08)
    assert wire.faults == set()


def test_a_good_command_ends_the_refusal(wire: ArmWire) -> None:
    wire.ready()
    assert wire.arm.move_joints((0.0, 2.5, 0.0, 0.0, 0.0, 0.0), 1.0, wire.now) == 0
    assert "joint's limit" in wire.evidence
    assert wire.arm.move_joints(READY, 1.0, wire.now) == 2
    assert wire.faults == set()


# ----------------------------------------------------------------------------------------------- faults


def test_silence_is_told_within_half_a_second_and_ends(wire: ArmWire) -> None:
    wire.run(0.2)
    wire.registers.silent = True
    wire.run(0.24)
    assert wire.faults == set()
    wire.run(0.12)
    assert wire.faults == {"arm.link"}
    wire.registers.silent = False
    wire.run(1.0)
    assert wire.faults == set()


def test_after_silence_is_told_the_wire_is_left_alone(wire: ArmWire) -> None:
    wire.registers.silent = True
    wire.run(0.4)
    tries = []
    for _ in range(600):
        before = len(wire.client.requests)
        wire.run(TICK_S)
        wire.arm.enable(wire.now)
        wire.arm.stop(wire.now)
        wire.arm.move_joints(READY, 1.0, wire.now)
        wire.arm.limit_speed(wire.now % 1.0, wire.now)
        assert len(wire.client.requests) - before <= 1
        if len(wire.client.requests) > before:
            tries.append(wire.now)
    gaps = [b - a for a, b in itertools.pairwise(tries)]
    assert gaps[0] >= 0.5
    assert max(gaps) <= 5.0 + TICK_S + 1e-6
    assert gaps == sorted(gaps)
    assert len(tries) <= 8


def test_a_storm_of_exceptions_is_a_broken_link_and_not_fed(wire: ArmWire) -> None:
    wire.ready()
    wire.registers.storm = True
    wire.run(0.36)
    assert wire.faults == {"arm.link"}
    assert "exception 4" in wire.evidence
    before = len(wire.client.requests)
    wire.run(4.0)
    assert len(wire.client.requests) - before <= 5
    wire.registers.storm = False
    wire.run(5.0)
    assert wire.faults == set()


def test_a_program_that_stands_still_is_told(wire: ArmWire) -> None:
    wire.run(0.2)
    wire.controller.frozen = True
    wire.run(0.52)
    assert wire.faults == {"arm.link"}
    assert "heartbeat not echoed" in wire.evidence
    assert wire.arm.move_joints(READY, 1.0, wire.now) == 0
    wire.controller.frozen = False
    wire.run(0.08)
    assert wire.faults == set()


def test_a_pause_of_the_reader_is_no_fault(wire: ArmWire) -> None:
    wire.run(0.2)
    wire.wait(3.0)
    wire.arm.read(wire.now)
    assert wire.faults == set()


def test_the_controllers_own_fault_with_number_and_words(wire: ArmWire) -> None:
    wire.ready()
    wire.controller.fail(4)
    state = wire.run(0.04)
    assert not state.enabled
    assert wire.faults == {"arm.fault"}
    assert "error 4: collision" in wire.evidence
    wire.arm.reset_faults(wire.now)
    wire.run(0.04)
    assert wire.faults == set()
    wire.ready()
    assert wire.arm.move_joints(READY, 1.0, wire.now) > 0


@pytest.mark.parametrize("which", ["emergency", "protective"])
def test_stops_are_told_until_released(wire: ArmWire, which: str) -> None:
    wire.ready()
    wire.arm.move_joints(READY, 0.2, wire.now)
    wire.run(0.2)
    getattr(
        wire.controller, {"emergency": "press_emergency_stop", "protective": "trip_protective_stop"}[which]
    )()
    state = wire.run(0.12)
    assert wire.faults == {"arm.stopped"}
    assert which in wire.evidence
    assert not state.moving
    assert wire.arm.move_joints(READY, 0.2, wire.now) == 0
    getattr(
        wire.controller,
        {"emergency": "release_emergency_stop", "protective": "release_protective_stop"}[which],
    )()
    state = wire.run(1.2)
    assert wire.faults == set()
    assert not state.moving


def test_another_master_is_told_and_left_alone() -> None:
    wire = ArmWire(open_now=False)
    wire.registers.write(16, 0, [1, 0x0777, 100, 300])
    wire.arm = wire.open()
    for beat in range(2, 40):
        wire.registers.write(16, 0, [beat, 0x0777, 100, 300])
        wire.run(0.12)
    assert wire.faults == {"arm.refused"}
    assert "0x0777" in wire.evidence
    wire.arm.enable(wire.now)
    wire.arm.grip(True, wire.now)
    wire.arm.limit_speed(0.1, wire.now)
    assert wire.arm.move_joints(READY, 1.0, wire.now) == 0
    assert not wire.controller.powered
    assert wire.controller.limit == 1.0
    wire.arm.stop(wire.now)
    assert wire.client.requests[-1] == bytes.fromhex("0f000100010101")
    # It ends, and its controller is free.
    wire.run(2.5)
    assert wire.faults == set()
    assert wire.controller.owner == wire.settings.owner


def test_losing_the_controller_to_another_is_noticed_at_the_refused_heartbeat(wire: ArmWire) -> None:
    wire.run(1.0)  # so that the next look at the owner would only be due in a second
    wire.wait(0.5)
    for beat in range(9):
        wire.registers.write(16, 0, [999 + beat, 0x0777, 100, 300])
        wire.run(TICK_S)
        assert wire.faults == {"arm.refused"}
    assert "0x0777" in wire.evidence
    assert wire.controller.owner == 0x0777


def test_a_command_to_a_controller_just_taken_is_not_sent(wire: ArmWire) -> None:
    wire.ready()
    wire.run(1.0)
    wire.wait(0.5)
    wire.registers.write(16, 0, [999, 0x0777, 100, 300])
    assert wire.arm.move_joints(READY, 1.0, wire.now) == 0
    assert wire.faults == {"arm.refused"}
    assert not any(map(is_command, wire.client.requests))


def test_a_dead_reader_stops_the_arm_by_the_watchdog(wire: ArmWire) -> None:
    wire.ready()
    wire.arm.move_joints(READY, 0.1, wire.now)
    wire.run(0.4)
    wire.wait(0.3 + 0.1)
    at = wire.controller.joints
    wire.wait(1.0)
    assert wire.controller.joints == at
    wire.run(0.4)
    assert wire.arm.progress(1) == "stopped: the heartbeat was missing"
    assert wire.controller.joints == at


def test_speed_is_limited_in_whole_percents_never_more(wire: ArmWire) -> None:
    for share, percent in ((0.29, 29), (0.079, 7), (1.7, 100), (-3.0, 0), (0.5, 50), (NAN, 0)):
        wire.arm.limit_speed(share, wire.now)
        assert wire.registers.read(3, 2, 1) == [percent]


def test_closing_stops_switches_off_and_gives_back(wire: ArmWire) -> None:
    wire.ready()
    wire.arm.move_joints(READY, 0.1, wire.now)
    wire.run(0.2)
    wire.client.requests.clear()
    wire.client.loses = lambda pdu: len(wire.client.requests) == 1
    wire.arm.close()
    wire.arm.close()
    wire.wait(0.1)
    assert not wire.controller.powered
    assert not wire.controller.moving
    assert wire.controller.owner == 0


# ----------------------------------------------------------------------------------------- foreign bytes


class _Babbler(MemoryModbusClient):
    """Answers with bytes on order."""

    def __init__(self, wire: ArmWire) -> None:
        super().__init__(wire.registers)
        self.says: bytes | None = None

    def _answer(self, request: bytes) -> bytes:
        good = super()._answer(request)
        return good if self.says is None else request[:2] + self.says


@settings(deadline=None, max_examples=150)
@given(st.binary(max_size=40), st.booleans())
def test_no_answer_moves_or_breaks_the_driver(noise: bytes, framed: bool) -> None:
    wire = ArmWire(open_now=False)
    client = _Babbler(wire)
    arm = ModbusArm(ModbusLink(client, "a babbler"))
    arm.enable(0.0)
    good = arm.read(0.0)
    client.says = b"\0\0" + (len(noise) + 1).to_bytes(2, "big") + b"\x01" + noise if framed else noise
    for tick in range(1, 12):
        arm.move_joints(READY, 1.0, tick * 0.04)
        state = arm.read(tick * 0.04)
        assert state.joints == good.joints
    arm.faults(1.0)
    arm.close()
