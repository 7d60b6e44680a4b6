"""The small parts of the world on the wire: pace, moments, head controls, cables, the tap, the typist."""

from __future__ import annotations

import math
import os
import struct
from pathlib import Path

import numpy as np
import pytest
import serial
from hypothesis import given, settings
from hypothesis import strategies as st

from robot.sim.brick_emulator import BrickEmulator
from robot.sim.head import SimHead
from robot.sim.injected import InjectedFault
from robot.sim.motor import FreeMotor
from robot.sim.wire import switches
from robot.sim.wire.brick_tap import BrickTap, motor_telegram
from robot.sim.wire.head_controls import PAN_ABSOLUTE, TILT_ABSOLUTE, ZOOM_ABSOLUTE, HeadControls
from robot.sim.wire.moments import NO_MOMENT, Moments
from robot.sim.wire.pacer import Pacer
from robot.sim.wire.switches import Switch
from robot.sim.wire.typist import Typist

# --------------------------------------------------------------------------------------------------- pace


class Wall:
    """A clock that only sleeping and working move on."""

    def __init__(self) -> None:
        self.time = 100.0

    def now(self) -> float:
        return self.time

    def sleep(self, seconds: float) -> None:
        assert seconds > 0
        self.time += seconds


def paced(wall: Wall) -> Pacer:
    pacer = Pacer(0.002, 0.004, 0.04, wall.now, wall.sleep)
    wall.time += 7.0  # whatever it took to set up
    pacer.begin()
    return pacer


def tick(pacer: Pacer, wall: Wall, work_s: float = 0.0) -> None:
    for _ in range(20):
        pacer.wait()
    wall.time += work_s
    pacer.ticked()


@settings(max_examples=30, deadline=None)
@given(st.lists(st.floats(0.0, 0.03), min_size=1, max_size=30))
def test_who_works_less_than_a_tick_keeps_time_to_the_millisecond(works: list[float]) -> None:
    wall = Wall()
    pacer = paced(wall)
    for k, work in enumerate(works, start=1):
        for _ in range(20):
            pacer.wait()
        assert wall.time == pytest.approx(107.0 + 0.04 * k, abs=1e-9)
        pacer.ticked()
        wall.time += work
    assert (pacer.pace.ticks, pacer.pace.late, pacer.pace.slipped_s) == (len(works), 0, 0.0)


def test_a_tick_that_comes_late_is_counted_and_made_up_for() -> None:
    wall = Wall()
    pacer = paced(wall)
    tick(pacer, wall, 0.03)
    assert (pacer.pace.late, pacer.pace.slipped_s) == (1, 0.0)
    assert pacer.pace.worst_s == pytest.approx(0.03)
    for _ in range(20):
        pacer.wait()
    assert wall.time == pytest.approx(107.08), "in step again"


def test_who_falls_behind_by_more_than_a_tick_has_its_time_put_back_and_says_by_how_much() -> None:
    wall = Wall()
    pacer = paced(wall)
    tick(pacer, wall, 0.25)
    assert pacer.pace.slipped_s == pytest.approx(0.25)
    before = wall.time
    for _ in range(20):
        pacer.wait()
    assert wall.time - before == pytest.approx(0.04), "no haste to make up for it"


# ------------------------------------------------------------------------------------------------ moments


@settings(max_examples=50, deadline=None)
@given(st.integers(0, 30), st.floats(-0.019, 0.019))
def test_a_claim_belongs_to_the_picture_taken_next_to_its_time(seq: int, error: float) -> None:
    moments = Moments()
    for k in range(31):
        moments.add(k, 50.0 + 0.04 * k)
    assert moments.nearest(50.0 + 0.04 * seq + error) == seq
    assert moments.unmatched == 0


def test_a_claim_about_no_picture_is_not_judged_but_counted() -> None:
    moments = Moments()
    assert moments.nearest(1.0) == NO_MOMENT
    moments.add(3, 1.0)
    assert moments.nearest(1.021) == NO_MOMENT
    assert moments.unmatched == 2


# ------------------------------------------------------------------------------------------- head controls


def listed(controls: HeadControls) -> dict[int, dict[str, int | str]]:
    return {int(control["id"]): control for control in controls.listing()}


def test_the_controls_are_those_of_uvc_in_arc_seconds() -> None:
    controls = listed(HeadControls(SimHead(np.random.default_rng(1)), lambda: 0.0))
    assert list(controls) == [0x009A0908, 0x009A0909, 0x009A090D]
    pan, tilt = controls[PAN_ABSOLUTE], controls[TILT_ABSOLUTE]
    assert (pan["min"], pan["max"]) == (-80 * 3600, 80 * 3600)
    assert (tilt["min"], tilt["max"]) == (-50 * 3600, 20 * 3600), "up is positive, down goes farther"
    assert all(control["group"] == 1 and control["type"] == 1 for control in controls.values())


@settings(max_examples=30, deadline=None)
@given(st.integers(-400_000, 400_000), st.integers(-400_000, 400_000))
def test_right_and_up_are_positive_and_what_is_read_is_where_it_went(pan: int, tilt: int) -> None:
    head = SimHead(np.random.default_rng(2))
    controls = HeadControls(head, lambda: 0.0)
    assert controls.set(PAN_ABSOLUTE, pan)
    assert controls.set(TILT_ABSOLUTE, tilt)
    for k in range(60):
        head.advance(0.04, 0.04 * k)
    within = (min(max(pan, -288_000), 288_000), min(max(tilt, -180_000), 72_000))
    tolerance = 0.25 * 3600
    assert -math.degrees(head.true_pose.pan) * 3600 == pytest.approx(within[0], abs=tolerance)
    assert -math.degrees(head.true_pose.tilt) * 3600 == pytest.approx(within[1], abs=tolerance)
    read = listed(controls)
    assert read[PAN_ABSOLUTE]["value"] == pytest.approx(within[0], abs=tolerance)
    assert read[TILT_ABSOLUTE]["value"] == pytest.approx(within[1], abs=tolerance)


def test_the_value_is_that_of_a_head_on_its_way_not_of_its_goal() -> None:
    head = SimHead(np.random.default_rng(2))
    controls = HeadControls(head, lambda: 0.0)
    controls.set(PAN_ABSOLUTE, 180_000)
    head.advance(0.04, 0.04)
    assert 0 < int(listed(controls)[PAN_ABSOLUTE]["value"]) < 60_000
    assert controls.set(ZOOM_ABSOLUTE, 999)
    assert listed(controls)[ZOOM_ABSOLUTE]["value"] == 400


def test_no_other_control_and_none_at_all_while_broken() -> None:
    controls = HeadControls(SimHead(np.random.default_rng(2)), lambda: 0.0)
    assert not controls.set(1, 5)
    controls.broken = True
    with pytest.raises(ConnectionError):
        controls.set(PAN_ABSOLUTE, 0)
    with pytest.raises(ConnectionError):
        controls.listing()


# ------------------------------------------------------------------------------------------------- cables


def test_a_cable_is_pulled_once_and_plugged_once() -> None:
    calls: list[str] = []
    switch = Switch("camera", "link", lambda: calls.append("off"), lambda: calls.append("on"))
    faults = (InjectedFault("camera", "link", 1.0, 0.5), InjectedFault("head", "stuck", 0.0))
    for k in range(50):
        switches.follow([switch], faults, 0.04 * k)
    assert calls == ["off", "on"]


# ---------------------------------------------------------------------------------------------- brick tap


@pytest.mark.parametrize(
    ("telegram", "seen"),
    [
        ("80 04 01 ce 07 01 00 20 5a000000", (1, -50, 90)),
        ("00 04 02 64 07 01 00 20 00010000", (2, 100, 256)),
        ("80 04 ff 00 07 01 00 20 00000000", (255, 0, 0)),
        ("80 04 ff 00 07 01 00 20 000000", None),
        ("00 06 01", None),
        ("02 04 00 00 00 00 00 00 00 00 00 00", None),
        ("", None),
    ],
)
def test_motor_commands_are_read_from_the_protocol(telegram: str, seen: tuple[int, int, int] | None) -> None:
    noted = motor_telegram(bytes.fromhex(telegram), 3.0)
    assert (None if noted is None else (noted.port, noted.power, noted.limit)) == seen
    assert noted is None or noted.stops == (noted.port == 255)


def test_the_tap_passes_everything_on() -> None:
    rng = np.random.default_rng(1)
    brick = BrickEmulator([None, FreeMotor(rng), FreeMotor(rng)], rng)
    tap = BrickTap(brick)
    assert tap.handle(bytes.fromhex("80 04 01 32 07 01 00 20 00000000")) is None
    brick.advance(1.0)
    reply = tap.handle(b"\x00\x06\x01")
    assert reply is not None
    assert struct.unpack("<i", reply[13:17])[0] > 90, "the motor turned"
    assert [telegram.power for telegram in tap.telegrams] == [50]
    brick.cut_link()
    assert not tap.reachable
    with pytest.raises(ConnectionError):
        tap.handle(b"\x00\x0d")


# ------------------------------------------------------------------------------------------------- typist


def test_typing_goes_both_ways_raw_and_survives_a_hang_up(tmp_path: Path) -> None:
    typist = Typist(tmp_path / "teleop")
    try:
        with serial.Serial(typist.path, 115200, timeout=10.0, exclusive=True) as port:
            at = typist.type(b"i\r\x00\x03")
            assert port.read(4) == b"i\r\x00\x03"
            assert at > 0
            port.write(b"track\r\n")
            wait_for(lambda: typist.heard == b"track\r\n")
        typist.hang_up()
        assert not os.path.lexists(typist.path)
        typist.type(b"lost")
        typist.plug()
        with serial.Serial(typist.path, 115200, timeout=10.0) as port:
            typist.type(b"again")
            assert port.read(5) == b"again"
    finally:
        typist.close()
        typist.close()
    assert not os.path.lexists(typist.path)


def wait_for(condition: object, within_s: float = 10.0) -> None:
    import time

    assert callable(condition)
    until = time.monotonic() + within_s
    while not condition():
        assert time.monotonic() < until
        time.sleep(0.005)
