"""What the base's contract cannot ask: enumeration, a dumb brick, a dead host, a cable pulled often."""

from __future__ import annotations

import os
import signal
import statistics
import time
from collections.abc import Callable, Iterator

import pytest
from brick_gadget import SERIAL
from brick_remote import BrickRemote
from rig import TICK_S, drive, watch
from rigs_kernel_usb import KernelBaseRig

from robot.config import Base
from robot.faults import TABLE
from robot.hal.factory import open_base
from robot.hal.interfaces import DeviceError
from robot.hal.nxt.brick import Brick
from robot.hal.nxt.usb import UsbLink, find_brick
from robot.messages import Twist

FORWARD = Twist(v=0.2)
LEAD_AND_COASTING_S = 0.6


@pytest.fixture
def remote() -> BrickRemote:
    """The person beside the brick."""
    remote = BrickRemote()
    remote.make_well()
    return remote


@pytest.fixture
def rig(remote: BrickRemote) -> Iterator[KernelBaseRig]:
    """The open base."""
    rig = KernelBaseRig()
    yield rig
    rig.device.close()
    remote.make_well()


def test_the_brick_is_found_by_class_and_serial(remote) -> None:  # type: ignore[no-untyped-def]
    device = find_brick(SERIAL)
    assert (device.idVendor, device.idProduct, device.serial_number) == (0x0694, 0x0002, SERIAL)
    interface = device[0][(0, 0)]
    assert interface.bInterfaceClass == 0xFF
    assert sorted(e.bEndpointAddress & 0x80 for e in interface) == [0x00, 0x80]
    assert {(e.bmAttributes & 3, e.wMaxPacketSize) for e in interface} == {(2, 64)}
    assert find_brick().serial_number == SERIAL
    with pytest.raises(DeviceError, match=f"no brick has the serial number 0016530000FF; there: {SERIAL}"):
        find_brick("0016530000FF")


def test_a_brick_that_is_not_there_is_told_with_the_cure(remote) -> None:  # type: ignore[no-untyped-def]
    remote.unplug()
    with pytest.raises(DeviceError, match="check the cable"):
        open_base(Base(driver="nxt-usb"))


def test_a_second_program_is_refused_and_the_first_goes_on(rig) -> None:  # type: ignore[no-untyped-def]
    drive(rig, FORWARD, 0.4)
    with pytest.raises(DeviceError, match="another program uses the brick"):
        open_base(Base(driver="nxt-usb", brick=SERIAL))
    before = rig.device.read(rig.now).pose.x
    assert drive(rig, FORWARD, 1.0).pose.x > before + 0.1
    assert rig.device.faults(rig.now) == ()


def test_an_exchange_takes_a_few_milliseconds(remote, record_property) -> None:  # type: ignore[no-untyped-def]
    brick = Brick(UsbLink(find_brick))
    times = [_seconds(brick.battery_mv) for _ in range(100)]
    brick.close()
    record_property("USB exchange, median and worst, ms", _milliseconds(times))
    assert statistics.median(times) < 0.02
    assert max(times) < 0.1


def test_the_control_loop_keeps_its_rate(rig, record_property) -> None:  # type: ignore[no-untyped-def]
    drive(rig, FORWARD, 1.0)
    times = []
    for index in range(100):
        # Another speed each time, so that every tick writes to both motors.
        twist = Twist(v=0.15 + 0.01 * (index % 2))
        times.append(_tick(rig, twist))
    record_property("base.read + base.send, median and worst, ms", _milliseconds(times))
    assert sorted(times)[97] < TICK_S
    assert rig.device.faults(rig.now) == ()


@pytest.mark.parametrize(("ill", "well"), [("silence", "restore"), ("garbage", "clean")])
def test_a_brick_gone_dumb_holds_nobody(rig, ill, well, record_property) -> None:  # type: ignore[no-untyped-def]
    drive(rig, FORWARD, 1.0)
    rig.brick.order(ill)
    ill_at = rig.now
    slowest = 0.0
    while not rig.device.faults(rig.now):
        assert rig.now < ill_at + 2.0
        slowest = max(slowest, _tick(rig, FORWARD))
    record_property(
        f"{ill}: told after, slowest tick, ms", f"{1e3 * (rig.now - ill_at):.0f} {1e3 * slowest:.0f}"
    )
    assert rig.now - ill_at <= TABLE["base.link"].detection_s + slowest
    assert slowest < 0.25
    assert {fault.device for fault in rig.device.faults(rig.now)} == {"base"}
    # Until it was told the brick may still have obeyed.
    rig.wait(LEAD_AND_COASTING_S)
    _assert_standing(rig.brick)
    rig.brick.order(well)
    watch(rig, 1.5)
    assert rig.device.faults(rig.now) == ()
    before = rig.device.read(rig.now).pose.x
    assert drive(rig, FORWARD, 1.0).pose.x > before + 0.1


def test_a_killed_program_leaves_the_wheels_standing(remote) -> None:  # type: ignore[no-untyped-def]
    child = os.fork()
    if child == 0:
        _drive_until_killed()
    first = remote.shafts()[0].angle
    _wait_for(lambda: abs(remote.shafts()[0].angle - first) > 3.0)
    os.kill(child, signal.SIGKILL)
    os.waitpid(child, 0)
    time.sleep(LEAD_AND_COASTING_S)
    _assert_standing(remote)
    base = open_base(Base(driver="nxt-usb", brick=SERIAL))
    assert base.faults(0.0) == ()
    base.close()


def test_a_cable_pulled_five_times_comes_back_and_leaks_nothing(rig) -> None:  # type: ignore[no-untyped-def]
    for cycle in range(5):
        drive(rig, FORWARD, 0.4)
        rig.break_down()
        drive(rig, FORWARD, 0.4)
        assert [fault.key for fault in rig.device.faults(rig.now)] == ["base.link"]
        rig.mend()
        watch(rig, 1.2)
        assert rig.device.faults(rig.now) == ()
        if cycle == 0:
            opened = len(os.listdir("/proc/self/fd"))
    before = rig.device.read(rig.now).pose.x
    assert drive(rig, FORWARD, 1.0).pose.x > before + 0.1
    assert len(os.listdir("/proc/self/fd")) <= opened


def _tick(rig: KernelBaseRig, twist: Twist) -> float:
    """One period of the control loop; returns the seconds its exchanges took."""
    start = time.monotonic()
    rig.device.read(rig.now)
    rig.device.send(twist, rig.now)
    taken = time.monotonic() - start
    rig.wait(max(0.0, TICK_S - taken))
    return taken


def _drive_until_killed() -> None:
    """The child: nothing of the tests' own life may run in it."""
    try:
        rig = KernelBaseRig()
        while True:
            drive(rig, FORWARD, 1.0)
    finally:
        os._exit(1)


def _assert_standing(remote: BrickRemote) -> None:
    before = [shaft.angle for shaft in remote.shafts()]
    time.sleep(0.3)
    assert [shaft.angle for shaft in remote.shafts()] == pytest.approx(before, abs=0.01)


def _wait_for(holds: Callable[[], bool]) -> None:
    end = time.monotonic() + 20.0
    while not holds():
        assert time.monotonic() < end
        time.sleep(0.02)


def _seconds(call: Callable[[], object]) -> float:
    start = time.monotonic()
    call()
    return time.monotonic() - start


def _milliseconds(times: list[float]) -> str:
    return f"{1000 * statistics.median(times):.1f} {1000 * max(times):.1f}"
