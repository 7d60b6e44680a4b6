"""A USB gadget of one vendor interface, by configfs and FunctionFS.

The kernel's side of a cable: `UsbGadget` describes the device and plugs it in and out of the (virtual) bus;
`Endpoints` carries the packets. Layouts: linux/usb/functionfs.h, USB 2.0 chapter 9.
"""

from __future__ import annotations

import os
import struct
import subprocess
from enum import IntEnum
from pathlib import Path
from typing import Final

CONFIGFS: Final = Path("/sys/kernel/config/usb_gadget")
ENGLISH: Final = 0x409
_DESCRIPTORS_MAGIC_V2: Final = 3
_STRINGS_MAGIC: Final = 2
_HAS_FULL_SPEED: Final = 1
_EVENT: Final = struct.Struct("<8sB3x")


class Event(IntEnum):
    """What the control endpoint tells."""

    BIND = 0
    UNBIND = 1
    ENABLE = 2
    DISABLE = 3
    SETUP = 4
    SUSPEND = 5
    RESUME = 6


class UsbGadget:
    """A described device, not yet plugged in. name: of its folder in configfs."""

    def __init__(self, name: str, vendor: int, product: int, serial: str, product_name: str) -> None:
        self._folder = CONFIGFS / name
        self._write("idVendor", hex(vendor))
        self._write("idProduct", hex(product))
        self._write("bcdUSB", "0x0200")
        strings = f"strings/{ENGLISH:#x}"
        self._write(f"{strings}/serialnumber", serial)
        self._write(f"{strings}/product", product_name)
        function = self._folder / "functions" / f"ffs.{name}"
        function.mkdir(parents=True)
        (self._folder / "configs" / "c.1").mkdir(parents=True)
        (self._folder / "configs" / "c.1" / function.name).symlink_to(function)

    def plug(self, controller: str = "dummy_udc.0") -> None:
        """Put the cable in."""
        (self._folder / "UDC").write_text(controller + "\n")

    def unplug(self) -> None:
        """Pull the cable."""
        (self._folder / "UDC").write_text("\n")

    def _write(self, name: str, value: str) -> None:
        path = self._folder / name
        path.parent.mkdir(parents=True, exist_ok=True)
        path.write_text(value)


class Endpoints:
    """The function's files: ep0 for events, ep1 from the host, ep2 to the host; bulk, 64 bytes a packet."""

    def __init__(self, name: str, folder: Path) -> None:
        folder.mkdir(parents=True, exist_ok=True)
        subprocess.run(["mount", "-t", "functionfs", name, str(folder)], check=True)
        self._control = os.open(folder / "ep0", os.O_RDWR)
        os.write(self._control, descriptors())
        os.write(self._control, struct.pack("<IIII", _STRINGS_MAGIC, 16, 0, 0))
        self.from_host = os.open(folder / "ep1", os.O_RDWR)
        self.to_host = os.open(folder / "ep2", os.O_RDWR)

    def next_event(self) -> Event:
        """Wait for the next event; a request to the control endpoint is refused."""
        setup, kind = _EVENT.unpack(os.read(self._control, _EVENT.size))
        if kind == Event.SETUP:
            self._refuse(setup)
        return Event(kind)

    def _refuse(self, setup: bytes) -> None:
        """A transfer in the wrong direction makes the control endpoint stall."""
        to_host = setup[0] & 0x80
        try:
            if to_host:
                os.read(self._control, 0)
            else:
                os.write(self._control, b"")
        except OSError:
            pass


def descriptors() -> bytes:
    """Full-speed descriptors: a vendor interface, bulk OUT 0x01 and bulk IN 0x82, 64 bytes a packet."""
    interface = struct.pack("<BBBBBBBBB", 9, 4, 0, 0, 2, 0xFF, 0xFF, 0xFF, 0)
    out, inward = (struct.pack("<BBBBHB", 7, 5, address, 2, 64, 0) for address in (0x01, 0x82))
    body = struct.pack("<I", 3) + interface + out + inward
    return struct.pack("<III", _DESCRIPTORS_MAGIC_V2, 12 + len(body), _HAS_FULL_SPEED) + body
