"""Lamps: files of a LED, a coil, a pin; what a person is told when they cannot be used."""

from __future__ import annotations

import sys
from pathlib import Path

import pytest
from gpiozero.pins.mock import MockFactory, MockPWMPin
from hypothesis import given, settings
from hypothesis import strategies as st

from robot.hal.interfaces import DeviceError
from robot.hal.lamps import ModbusLamp, SysfsLed, open_gpio_lamp, sysfs
from robot.hal.modbus import ModbusLink
from robot.sim.arm_controller import ArmController
from robot.sim.arm_registers import ArmRegisters
from robot.sim.modbus_memory import MemoryModbusClient


@pytest.fixture
def led(tmp_path: Path) -> Path:
    return _led(tmp_path / "lamp")


def _led(folder: Path, most: int = 255) -> Path:
    folder.mkdir()
    (folder / "brightness").write_text("17\n")
    (folder / "max_brightness").write_text(f"{most}\n")
    (folder / "trigger").write_text("none [heartbeat]\n")
    return folder


def _coil(coil: int = 4) -> tuple[ModbusLamp, ArmRegisters, MemoryModbusClient]:
    registers = ArmRegisters(ArmController())
    client = MemoryModbusClient(registers)
    return ModbusLamp(ModbusLink(client, "the box"), coil), registers, client


# ------------------------------------------------------------------------------------------------- sysfs


def test_opening_takes_the_led_from_its_trigger_and_darkens_it(led: Path) -> None:
    SysfsLed("lamp", led.parent)
    assert (led / "trigger").read_text() == "none"
    assert (led / "brightness").read_text() == "0"


@pytest.mark.parametrize(("level", "written"), [(1.0, "255"), (0.5, "128"), (0.001, "0"), (7.0, "255")])
def test_levels_are_scaled_to_the_leds_steps(led: Path, level: float, written: str) -> None:
    lamp = SysfsLed(str(led))
    given = lamp.send(level, 0.0)
    assert (led / "brightness").read_text() == written
    assert given == int(written) / 255


def test_a_led_of_one_step(tmp_path: Path) -> None:
    lamp = SysfsLed(str(_led(tmp_path / "a", most=1)))
    assert [lamp.send(level, 0.0) for level in (0.4, 0.6, float("nan"))] == [0.0, 1.0, 0.0]


def test_a_led_without_trigger_is_a_led(led: Path) -> None:
    (led / "trigger").unlink()
    assert SysfsLed(str(led)).send(1.0, 0.0) == 1.0
    assert not (led / "trigger").exists()


def test_an_unknown_led_is_told_with_those_there_are(led: Path) -> None:
    _led(led.parent / "another")
    with pytest.raises(DeviceError, match="there are another, lamp"):
        SysfsLed("lump", led.parent)
    with pytest.raises(DeviceError, match="no LED is named"):
        SysfsLed("", led.parent)


@pytest.mark.parametrize("text", ["", "many", "0", "-3"])
def test_a_folder_that_is_no_led(led: Path, text: str) -> None:
    (led / "max_brightness").write_text(text)
    with pytest.raises(DeviceError, match="max_brightness"):
        SysfsLed(str(led))


def test_missing_permission_names_the_cure(led: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    def refuse(path: Path, text: str) -> None:
        raise PermissionError(13, "Permission denied", str(path))

    monkeypatch.setattr(sysfs, "_put", refuse)
    with pytest.raises(DeviceError, match="udev rule"):
        SysfsLed(str(led))


def test_a_led_that_vanishes_and_returns_is_taken_again(led: Path) -> None:
    lamp = SysfsLed(str(led))
    lamp.send(1.0, 0.0)
    away = led.rename(led.with_name("away"))
    assert lamp.send(1.0, 0.3) == 1.0
    assert lamp.faults(0.3) == ()
    lamp.send(1.0, 0.4)
    (fault,) = lamp.faults(0.4)
    assert (fault.key, fault.since) == ("lamp.link", 0.4)
    assert "plug the LED in again" in fault.evidence
    away.rename(led)
    (led / "trigger").write_text("none [heartbeat]")
    (led / "brightness").write_text("0")
    lamp.send(1.0, 0.44)
    assert lamp.faults(0.44) == ()
    assert (led / "trigger").read_text() == "none"
    assert (led / "brightness").read_text() == "255"


def test_a_closed_led_is_dark_and_stays_so(led: Path) -> None:
    lamp = SysfsLed(str(led))
    lamp.send(1.0, 0.0)
    lamp.close()
    lamp.send(1.0, 1.0)
    assert (led / "brightness").read_text() == "0"


def test_closing_a_led_that_is_gone_does_not_fail(led: Path) -> None:
    lamp = SysfsLed(str(led))
    led.rename(led.with_name("away"))
    lamp.close()
    lamp.close()


@settings(deadline=None, max_examples=30)
@given(st.lists(st.floats(allow_nan=True, allow_infinity=True), max_size=8))
def test_any_level_leaves_a_number_in_range(
    tmp_path_factory: pytest.TempPathFactory, levels: list[float]
) -> None:
    led = _led(tmp_path_factory.mktemp("leds") / "lamp")
    lamp = SysfsLed(str(led))
    for tick, level in enumerate(levels):
        assert lamp.send(level, tick * 0.04) == int((led / "brightness").read_text()) / 255


# ------------------------------------------------------------------------------------------------ Modbus


def test_a_coil_is_on_above_half() -> None:
    lamp, registers, _ = _coil(6)
    for level, on in ((0.5, False), (0.51, True), (1.0, True), (0.2, False)):
        assert lamp.send(level, 0.0) == float(on)
        assert registers.leds == (False, False, on, False)


def test_a_coil_that_is_not_there_is_told_and_the_link_given_back() -> None:
    registers = ArmRegisters(ArmController())
    link = ModbusLink(MemoryModbusClient(registers), "the box")
    with pytest.raises(DeviceError, match="coil 40"):
        ModbusLamp(link, 40)
    assert link.closed


def test_a_box_that_forgot_the_coil_is_told_again() -> None:
    lamp, registers, _ = _coil()
    lamp.send(1.0, 0.0)
    registers.write(15, 4, [0])
    for tick in range(1, 12):
        lamp.send(1.0, tick * 0.04)
    assert registers.leds[0]


def test_a_silent_box_is_noticed_without_a_change_of_level() -> None:
    lamp, registers, _ = _coil()
    lamp.send(1.0, 0.0)
    registers.silent = True
    for tick in range(1, 13):
        lamp.send(1.0, tick * 0.04)
    assert [fault.key for fault in lamp.faults(0.5)] == ["lamp.link"]
    registers.silent = False
    for tick in range(13, 60):
        lamp.send(1.0, tick * 0.04)
    assert lamp.faults(2.4) == ()


def test_the_lamp_shares_the_arms_link() -> None:
    registers = ArmRegisters(ArmController())
    link = ModbusLink(MemoryModbusClient(registers), "the box")
    lamp = ModbusLamp(link.share(), 4)
    lamp.send(1.0, 0.0)
    lamp.close()
    assert not registers.leds[0]
    assert not link.closed


# -------------------------------------------------------------------------------------------------- pin


def test_a_pin_is_dimmed() -> None:
    factory = MockFactory(pin_class=MockPWMPin)
    lamp = open_gpio_lamp("18", factory)
    assert lamp.send(0.25, 0.0) == 0.25
    assert factory.pin(18).state == 0.25
    lamp.close()
    lamp.close()
    assert not factory.pin(18).state


@pytest.mark.parametrize(("pin", "words"), [("", "no pin"), ("FOO", "pin FOO cannot be used")])
def test_a_pin_that_is_none(pin: str, words: str) -> None:
    with pytest.raises(DeviceError, match=words) as told:
        open_gpio_lamp(pin, MockFactory(pin_class=MockPWMPin))
    assert "\n" not in str(told.value)


def test_without_gpiozero_a_hint(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setitem(sys.modules, "gpiozero", None)
    with pytest.raises(DeviceError, match="pip install gpiozero"):
        open_gpio_lamp("18")
