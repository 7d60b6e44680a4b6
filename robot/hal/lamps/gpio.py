"""A lamp on a pin of a small computer (Raspberry Pi and the like), dimmed by pulse width through gpiozero."""

from __future__ import annotations

import importlib
import warnings
from typing import Any

from robot.hal.interfaces import DeviceError
from robot.hal.lamps.lamp import WrittenLamp


class GpioLamp(WrittenLamp):
    """A `LampDevice` on a gpiozero PWMLED (anything with `value` and `close()`); opening darkens it."""

    def __init__(self, led: Any) -> None:
        super().__init__()
        self._led = led
        self._write(0.0, 0.0)

    def _write(self, level: float, now: float) -> None:
        try:
            self._led.value = level
        # Each pin library behind gpiozero has errors of its own kind.
        except Exception as error:
            raise DeviceError(f"the lamp's pin cannot be set: {error}") from error

    def _release(self) -> None:
        self._led.close()


def open_gpio_lamp(pin: str, pin_factory: Any = None) -> GpioLamp:
    """The lamp on a pin as gpiozero names it: `GPIO18`, `18`, `BOARD12`. pin_factory: gpiozero's or None.

    Raises DeviceError in one line with the cure if gpiozero is not installed, has no access to the pins, or
    the pin is not there.
    """
    try:
        gpiozero = importlib.import_module("gpiozero")
    except ImportError as error:
        raise DeviceError("gpiozero is not installed: pip install gpiozero lgpio") from error
    if not pin:
        raise DeviceError("no pin is named: name one like GPIO18")
    number_or_name = int(pin) if pin.isdecimal() else pin
    try:
        with warnings.catch_warnings():
            # One for each pin library that is not there; the error says it if none is.
            warnings.simplefilter("ignore")
            return GpioLamp(gpiozero.PWMLED(number_or_name, pin_factory=pin_factory))
    except DeviceError:
        raise
    # gpiozero's errors are ImportError, ValueError, ..., and those of the pin library behind it.
    except Exception as error:
        words = str(error).splitlines()[0] if str(error) else type(error).__name__
        raise DeviceError(
            f"pin {pin} cannot be used: {words}: check its name, install lgpio, join the group gpio"
        ) from error
