"""Starts the world's process and speaks with it.

with start_world(scene, seed=1) as world:
    world.addresses.brick      # drivers open these
    world.begin()
    ...
    world.outcome().report
"""

from __future__ import annotations

import os
import shutil
import subprocess
import sys
import tempfile
import time
from multiprocessing import Pipe
from pathlib import Path
from types import TracebackType
from typing import TypeVar

from robot.errors import UserError
from robot.sim.injected import InjectedFault
from robot.sim.referee import Claim
from robot.sim.scene import Scene
from robot.sim.wire.messages import (
    Addresses,
    AskOutcome,
    AskTrace,
    AskTruth,
    Begin,
    Channel,
    Claimed,
    Done,
    End,
    Failed,
    Inject,
    Outcome,
    Ready,
    Request,
    Trace,
    Truth,
    Type,
    Typed,
    WorldSpec,
)

T = TypeVar("T")

READY_WITHIN_S = 60.0
ANSWER_WITHIN_S = 10.0
END_WITHIN_S = 3.0


class WorldGoneError(RuntimeError):
    """The world's process ended or does not answer."""


class WorldChannel:
    """One end of a channel to the world. For one thread; raises WorldGoneError if the world is gone.

    addresses: where the drivers find everything. Picklable ends are handed to another process as `channel`.
    """

    def __init__(self, channel: Channel, ready_within_s: float = READY_WITHIN_S) -> None:
        self.channel = channel
        self._done = False
        self.addresses: Addresses = self._wait(Ready, ready_within_s).addresses

    @property
    def done(self) -> bool:
        """True once the referee has seen enough. Never waits."""
        while not self._done and self._has_word(0.0):
            self._note(self._receive())
        return self._done

    def begin(self) -> None:
        """Let time pass."""
        self._send(Begin())

    def claim(self, claim: Claim, seen_at: float | None) -> None:
        """Tell the referee; seen_at: `time.monotonic()` of the picture the claim speaks of."""
        self._send(Claimed(claim, seen_at))

    def inject(self, fault: InjectedFault) -> None:
        """Break a device `fault.at` seconds from now."""
        self._send(Inject(fault))

    def type_keys(self, data: bytes) -> float:
        """Type at the teleop port; returns the `time.monotonic()` at which it was written."""
        return self._ask(Type(data), Typed).at

    def truth(self) -> Truth:
        """How things truly are now."""
        return self._ask(AskTruth(), Truth)

    def trace(self) -> Trace:
        """Motor telegrams and wheel speeds of the last seconds."""
        return self._ask(AskTrace(), Trace)

    def outcome(self) -> Outcome:
        """The referee's report so far."""
        return self._ask(AskOutcome(), Outcome)

    def end(self) -> None:
        """End the world, if it is still there, and this channel."""
        try:
            self._send(End())
        except WorldGoneError:
            pass
        finally:
            self.channel.close()

    def _ask(self, question: Request, answer: type[T]) -> T:
        self._send(question)
        return self._wait(answer, ANSWER_WITHIN_S)

    def _wait(self, wanted: type[T], within_s: float) -> T:
        until = time.monotonic() + within_s
        while self._has_word(max(0.0, until - time.monotonic())):
            message = self._receive()
            if isinstance(message, wanted):
                return message
            self._note(message)
        raise WorldGoneError(f"the simulated world gives no {wanted.__name__} within {within_s:.0f} s")

    def _note(self, message: object) -> None:
        if isinstance(message, Failed):
            raise UserError(message.words)
        self._done |= isinstance(message, Done)

    def _send(self, message: object) -> None:
        try:
            self.channel.send(message)
        except (OSError, ValueError) as error:
            raise WorldGoneError("the simulated world is gone") from error

    def _has_word(self, within_s: float) -> bool:
        try:
            return self.channel.poll(within_s)
        except (OSError, ValueError) as error:
            raise WorldGoneError("the simulated world is gone") from error

    def _receive(self) -> object:
        try:
            return self.channel.recv()
        except (EOFError, OSError) as error:
            raise WorldGoneError("the simulated world is gone") from error


class StartedWorld(WorldChannel):
    """The world's process and a channel to it. `close` ends it; if this process dies, it ends by itself.

    spare: the far ends of more channels, to be given to other processes (`WorldChannel(end)` there).
    """

    def __init__(
        self, process: subprocess.Popen[bytes], folder: Path, channel: Channel, spare: tuple[Channel, ...]
    ) -> None:
        self.process = process
        self._folder = folder
        self.spare = spare
        try:
            super().__init__(channel)
        except BaseException:
            self._end_process(0.0)
            raise

    def close(self) -> None:
        """End the world's process. May be called twice."""
        self.end()
        for channel in self.spare:
            channel.close()
        self._end_process(END_WITHIN_S)

    def __enter__(self) -> StartedWorld:
        return self

    def __exit__(
        self, kind: type[BaseException] | None, error: BaseException | None, trace: TracebackType | None
    ) -> None:
        self.close()

    def _end_process(self, within_s: float) -> None:
        try:
            self.process.wait(within_s)
        except subprocess.TimeoutExpired:
            self.process.kill()
            self.process.wait()
        shutil.rmtree(self._folder, ignore_errors=True)  # it does so itself, unless it was killed


def start_world(
    scene: Scene,
    seed: int,
    faults: tuple[InjectedFault, ...] = (),
    *,
    linger_s: float = 2.0,
    spare_channels: int = 0,
) -> StartedWorld:
    """Start the process and wait until it serves.

    linger_s: how long it goes on once nobody holds a channel any more. Raises UserError if the world cannot
    be made.
    """
    folder = Path(tempfile.mkdtemp(prefix="robot-world-"))
    pairs = [Pipe() for _ in range(1 + spare_channels)]
    far = [pair[1] for pair in pairs]
    package = str(Path(__file__).parents[3])
    paths = [package, *filter(None, [os.environ.get("PYTHONPATH")])]
    descriptors = [channel.fileno() for channel in far]
    process = subprocess.Popen(
        [sys.executable, "-m", "robot.sim.wire", *map(str, descriptors)],
        pass_fds=descriptors,
        env=os.environ | {"PYTHONPATH": os.pathsep.join(paths)},
        stdin=subprocess.DEVNULL,
        start_new_session=True,  # Ctrl-C is for the robot: the world ends after it
    )
    for channel in far:
        channel.close()
    mine, *spare = [pair[0] for pair in pairs]
    mine.send(WorldSpec(scene, seed, folder, faults, linger_s))
    return StartedWorld(process, folder, mine, tuple(spare))
