"""The world's process: real time, the far ends of all drivers, the referee, and those who hold a channel.

`serve(channels)` makes the world that the first message of the first channel describes. Time begins to pass
with `Begin`. It ends with `End`, or a while after the last channel was closed: whoever started it may die as
it likes, nothing is left behind.
"""

from __future__ import annotations

import sys
import threading
import time
from collections.abc import Sequence
from contextlib import suppress
from dataclasses import replace

from robot.errors import UserError
from robot.sim.referee import Claim, Referee
from robot.sim.wire.far_ends import FarEnds
from robot.sim.wire.messages import (
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
from robot.sim.wire.moments import Moments
from robot.sim.wire.paced_world import PacedWorld
from robot.sim.world import TICK_S

SWITCH_INTERVAL_S = 0.0005
"""A telegram must not wait long for the interpreter while physics is being reckoned."""
SILENT_S = 0.5
"""Who has claimed nothing for this long claims nothing any more."""


def serve(channels: Sequence[Channel]) -> None:
    """Make the world and run it to its end."""
    sys.setswitchinterval(SWITCH_INTERVAL_S)
    spec = channels[0].recv()
    assert isinstance(spec, WorldSpec)
    try:
        world = PacedWorld(spec.scene, spec.seed, spec.faults)
        ends = FarEnds(world, spec.folder)
    except UserError as error:
        channels[0].send(Failed(str(error)))
        return
    try:
        WorldProcess(world, ends, channels, spec.linger_s).run()
    finally:
        ends.close()
        world.close()


class WorldProcess:
    """One world with its far ends, its referee and the channels to it."""

    def __init__(
        self, world: PacedWorld, ends: FarEnds, channels: Sequence[Channel], linger_s: float
    ) -> None:
        self._world, self._ends = world, ends
        self._referee = Referee(world)
        self._refereeing = threading.Lock()
        self._moments = Moments()
        self._linger_s = linger_s
        self._begun = threading.Event()
        self._ended = threading.Event()
        self._channels = list(channels)
        self._sending = {id(channel): threading.Lock() for channel in channels}
        self._claims = _Mailbox()
        self._told_done = False
        self._deserted_at: float | None = None

    def run(self) -> None:
        """Until told to end, or deserted."""
        for channel in list(self._channels):
            threading.Thread(target=self._listen, args=(channel,), name="channel", daemon=True).start()
        shown_at = time.monotonic()
        self._moments.add(self._world.moment.seq, shown_at)
        self._ends.show(shown_at)
        self._broadcast(Ready(self._ends.addresses))
        while not self._over and not self._begun.is_set():
            shown_at = time.monotonic()
            self._moments.add(self._world.moment.seq, shown_at)
            self._ends.darkroom.repeat(shown_at)
            self._begun.wait(TICK_S)
        self._world.begin()
        while not self._over:
            self._tick()

    def _tick(self) -> None:
        self._world.step()
        shown_at = time.monotonic()
        self._moments.add(self._world.moment.seq, shown_at)
        self._ends.show(shown_at)
        with self._refereeing:
            self._referee.observe(self._claim(shown_at))
            done = self._referee.done
        if done and not self._told_done:
            self._told_done = True
            self._broadcast(Done())

    def _claim(self, now: float) -> Claim:
        claimed = self._claims.newest(now)
        world_now = self._world.now
        if claimed is None:
            return Claim(world_now, "", False, gave_up=self._claims.gave_up)
        seq = None if claimed.seen_at is None else self._moments.nearest(claimed.seen_at)
        return replace(claimed.claim, now=world_now, frame_seq=seq, gave_up=self._claims.gave_up)

    @property
    def _over(self) -> bool:
        if self._channels:
            self._deserted_at = None
        elif self._deserted_at is None:
            self._deserted_at = time.monotonic()
        deserted = self._deserted_at
        return self._ended.is_set() or (deserted is not None and time.monotonic() - deserted > self._linger_s)

    # ------------------------------------------------------------------------------------------- channels

    def _listen(self, channel: Channel) -> None:
        with suppress(EOFError, OSError):
            while True:
                answer = self._heed(channel.recv())
                if answer is not None:
                    self._send(channel, answer)
        self._channels.remove(channel)
        self._begun.set()  # nobody is left to say it
        channel.close()

    def _heed(self, request: Request) -> object | None:
        match request:
            case Begin():
                self._begun.set()
            case Claimed():
                self._claims.put(request, time.monotonic())
            case Inject(fault):
                self._world.inject(fault)
            case Type(data):
                return Typed(self._ends.typist.type(data))
            case AskTruth():
                return self._truth()
            case AskTrace():
                return self._trace()
            case AskOutcome():
                return self._outcome()
            case End():
                self._ended.set()
                self._begun.set()
        return None

    def _truth(self) -> Truth:
        world = self._world
        robot = world.where()
        return Truth(
            time.monotonic(), world.now, robot, world.wheels(), world.head_pose,
            world.lamp.light, self._ends.typist.heard,
        )  # fmt: skip

    def _trace(self) -> Trace:
        wheels = self._world.wheel_speeds()
        with self._world.lock:
            telegrams = self._ends.tap.telegrams
        return Trace(telegrams, wheels, self._moments.times)

    def _outcome(self) -> Outcome:
        pace = replace(self._world.pace, pictures_missed=self._ends.darkroom.missed)
        with self._refereeing:
            return Outcome(self._referee.report(), self._referee.scenery(), pace, self._moments.unmatched)

    def _broadcast(self, message: object) -> None:
        for channel in list(self._channels):
            with suppress(OSError):
                self._send(channel, message)

    def _send(self, channel: Channel, message: object) -> None:
        with self._sending[id(channel)]:
            channel.send(message)


class _Mailbox:
    """The newest claim, as long as it is fresh; a claim that the search was given up stays."""

    def __init__(self) -> None:
        self._newest: tuple[float, Claimed] | None = None
        self.gave_up = False

    def put(self, claimed: Claimed, now: float) -> None:
        self.gave_up |= claimed.claim.gave_up
        self._newest = now, claimed

    def newest(self, now: float) -> Claimed | None:
        newest = self._newest
        return newest[1] if newest is not None and now - newest[0] <= SILENT_S else None
