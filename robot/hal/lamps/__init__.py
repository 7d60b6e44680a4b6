"""Lamps: a kernel LED, a coil of a Modbus box, a pin of a small computer."""

from robot.hal.lamps.gpio import GpioLamp, open_gpio_lamp
from robot.hal.lamps.modbus_lamp import ModbusLamp
from robot.hal.lamps.sysfs import SysfsLed

__all__ = ["GpioLamp", "ModbusLamp", "SysfsLed", "open_gpio_lamp"]
