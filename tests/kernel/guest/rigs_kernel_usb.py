"""The drive base before a brick on the kernel's USB bus, whose cable a test can pull.

In the guest this lies beside the other rigs, where the contract suites pick it up.
"""

from __future__ import annotations

from brick_gadget import SERIAL
from brick_remote import BrickRemote, Shaft
from rig import RealRig

from robot.config import Base
from robot.hal.factory import open_base
from robot.hal.interfaces import DriveBase


class KernelBaseRig(RealRig[DriveBase]):
    """The NXT driver, libusb, the kernel's USB stack and a gadget."""

    def __init__(self) -> None:
        self.brick = BrickRemote()
        self.brick.make_well()
        super().__init__(open_base(Base(driver="nxt-usb", brick=SERIAL)))

    @property
    def motors(self) -> list[Shaft]:
        """What the wheels really do."""
        return self.brick.shafts()

    def break_down(self) -> None:
        """Pull the cable."""
        self.brick.unplug()

    def mend(self) -> None:
        """Put it back."""
        self.brick.plug()


MAKERS = {"base": {"kernel-usb": lambda folder: KernelBaseRig()}}
