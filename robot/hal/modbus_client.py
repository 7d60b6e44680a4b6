"""The pymodbus clients a link may stand on, and which one an address asks for."""

from __future__ import annotations

import socket
from typing import Any, Final, Protocol

from pymodbus.client import ModbusSerialClient, ModbusTcpClient

from robot.hal.interfaces import DeviceError

DEFAULT_PORT: Final = 502


class Reply(Protocol):
    """What is used of a pymodbus reply."""

    function_code: int
    exception_code: int
    registers: list[int]
    bits: list[bool]

    def isError(self) -> bool:
        """True for a Modbus exception."""
        ...


class Client(Protocol):
    """What is used of a synchronous pymodbus client."""

    def connect(self) -> bool:
        """Open it if it is not; False if that fails."""
        ...

    def close(self) -> None:
        """Close it; it can be opened again."""
        ...

    def read_coils(self, address: int, *, count: int, device_id: int) -> Any:
        """Function 1."""
        ...

    def read_discrete_inputs(self, address: int, *, count: int, device_id: int) -> Any:
        """Function 2."""
        ...

    def read_holding_registers(self, address: int, *, count: int, device_id: int) -> Any:
        """Function 3."""
        ...

    def read_input_registers(self, address: int, *, count: int, device_id: int) -> Any:
        """Function 4."""
        ...

    def write_coils(self, address: int, values: Any, *, device_id: int) -> Any:
        """Function 15."""
        ...

    def write_registers(self, address: int, values: Any, *, device_id: int) -> Any:
        """Function 16."""
        ...


def client_for(address: str, baudrate: int, timeout_s: float) -> Client:
    """The client of `HOST:PORT` or a serial port, not yet connected. Raises DeviceError if it is neither."""
    if "/" in address:
        return ModbusSerialClient(address, baudrate=baudrate, timeout=timeout_s, retries=0)
    return _tcp_client(address, timeout_s)


def _tcp_client(address: str, timeout_s: float) -> Client:
    host, port = _host_and_port(address)
    try:
        numeric = str(socket.getaddrinfo(host, port, type=socket.SOCK_STREAM)[0][4][0])
    except (OSError, ValueError) as error:  # ValueError: no name at all, like a..b
        raise DeviceError(f"Modbus: host {host!r} is not known: check the address") from error
    return ModbusTcpClient(numeric, port=port, timeout=timeout_s, retries=0)


def _host_and_port(address: str) -> tuple[str, int]:
    if not address:
        raise DeviceError("no address: name HOST:PORT or a serial port, e.g. 192.168.0.10:502")
    host, colon, port = address.rpartition(":")
    if not colon:
        return address, DEFAULT_PORT
    if not host or not port.isascii() or not port.isdigit() or len(port) > 5 or not 0 < int(port) <= 65535:
        raise DeviceError(f"{address!r} is no address: name HOST:PORT or a serial port like /dev/ttyUSB0")
    return host.strip("[]"), int(port)
