"""Everything the drivers reach: the servers and terminals of one world, opened and closed together."""

from __future__ import annotations

import shutil
from contextlib import ExitStack
from pathlib import Path
from typing import cast

from robot.sim.brick_emulator import BrickEmulator
from robot.sim.brick_port import BrickOnPty
from robot.sim.injected import active_kinds
from robot.sim.wire import switches
from robot.sim.wire.brick_tap import BrickTap
from robot.sim.wire.control_box import ControlBox
from robot.sim.wire.darkroom import Darkroom, scenery
from robot.sim.wire.eye_server import EyeServer
from robot.sim.wire.head_controls import HeadControls
from robot.sim.wire.messages import Addresses
from robot.sim.wire.paced_world import PacedWorld
from robot.sim.wire.switches import Switch
from robot.sim.wire.typist import Typist
from robot.sim.world import Moment


class FarEnds:
    """The far ends of all drivers before one world; folder: for its serial ports, removed at the end.

    Raises UserError if OpenGL is missing.
    """

    def __init__(self, world: PacedWorld, folder: Path) -> None:
        self._world = world
        self._before: Moment | None = None
        with ExitStack() as closing:
            folder.mkdir(parents=True, exist_ok=True)
            closing.callback(shutil.rmtree, folder, ignore_errors=True)
            self._controls = HeadControls(world.head, lambda: world.now)
            self._left, self._right = EyeServer(self._controls), EyeServer()
            closing.callback(self._left.close)
            closing.callback(self._right.close)
            self.darkroom = Darkroom(world, self._left, self._right)
            closing.callback(self.darkroom.close)
            self.tap = BrickTap(world.brick)
            # The port asks its brick for two things only, and the tap has both.
            brick = cast(BrickEmulator, self.tap)
            self._brick = BrickOnPty(brick, lock=world.lock, link=folder / "brick")
            closing.callback(self._brick.close)
            self.typist = Typist(folder / "teleop")
            closing.callback(self.typist.close)
            self._box = ControlBox()
            closing.callback(self._box.close)
            self._closing = closing.pop_all()
        self._switches = [
            Switch("camera", "link", self._left.unplug, self._left.plug),
            Switch("head", "link", self._mute_head, self._mend_head),
            Switch("lamp", "link", self._box.unplug, self._box.plug),
        ]

    @property
    def addresses(self) -> Addresses:
        """Where the drivers find everything."""
        return Addresses(
            brick=self._brick.path,
            teleop=self.typist.path,
            left_eye=self._left.url,
            right_eye=self._right.url,
            box=self._box.address,
        )

    def show(self, shown_at: float) -> None:
        """After a tick of the world: new pictures, the lamp as asked for, cables pulled or plugged."""
        world = self._world
        world.lamp.send(self._box.lamp, world.now)
        broken = active_kinds(world.faults, "camera", world.now)
        self.darkroom.develop(scenery(world, self._before, shown_at, broken))
        self._before = world.moment
        switches.follow(self._switches, world.faults, world.now)

    def close(self) -> None:
        """End all of them; no file, socket or thread is left. May be called twice."""
        self._closing.close()

    def _mute_head(self) -> None:
        self._controls.broken = True

    def _mend_head(self) -> None:
        self._controls.broken = False
