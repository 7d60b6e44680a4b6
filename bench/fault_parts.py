"""Parts of the robot on the fault bench: a watched wire to the brick, a stepped worker, a person, states."""

from __future__ import annotations

import math
from dataclasses import dataclass

from robot.clock import Clock
from robot.hal.device_thread import DeviceThread, Work
from robot.hal.interfaces import DeviceError
from robot.hal.teleop.frames import NO_BUTTONS, Button, Sticks, encode_sticks
from robot.messages import Command, Event, Follow, HeadPose, Hold, Intent, Odometry, Situation, Twist
from robot.sim.brick_emulator import BrickEmulator
from robot.sim.brick_inputs import UltrasonicSensor

CRUISE_M_S = 0.2
COMMAND_LIFE_S = 0.2
_SET_OUTPUT = 0x04
_INPUT_COMMANDS = frozenset((0x05, 0x07, 0x0E, 0x0F, 0x10))
_WHEELS = frozenset((1, 2, 0xFF))
_UNDEFINED_ERROR = 0xBD
_NO_REPLY = 0x80


class BenchClock:
    """Simulated time in whole milliseconds."""

    def __init__(self) -> None:
        self._milliseconds = 0

    def now(self) -> float:
        """Seconds since the start."""
        return self._milliseconds / 1000.0

    def advance(self, milliseconds: int) -> None:
        """Let time pass."""
        self._milliseconds += milliseconds


@dataclass(frozen=True, slots=True)
class MotorOrder:
    """A telegram to the wheels' motors that was sent, whether anybody heard it or not."""

    at: float
    drives: bool


class WatchedWire:
    """What lies between driver and brick; `orders` is every word to the wheels' motors.

    refusing: the brick answers everything with an error and obeys nothing. inputs_mute: answers about its
    sensors get lost. mistake: '' or what trips the driver's program up: 'all', or only what the 'inputs' say.
    """

    def __init__(self, brick: BrickEmulator, clock: Clock) -> None:
        self._brick = brick
        self._clock = clock
        self.orders: list[MotorOrder] = []
        self.refusing = self.inputs_mute = False
        self.mistake = ""

    def handle(self, telegram: bytes) -> bytes | None:
        """One telegram to the brick and its answer. Raises ConnectionError while the cable is out."""
        opcode = telegram[1]
        about_inputs = opcode in _INPUT_COMMANDS
        if opcode == _SET_OUTPUT and telegram[2] in _WHEELS:
            self.orders.append(MotorOrder(self._clock.now(), drives=telegram[3] != 0))
        if self.mistake == "all" or (self.mistake == "inputs" and about_inputs):
            raise KeyError("a mistake of the driver, on order")
        if self.refusing and self._brick.reachable:
            return None if telegram[0] & _NO_REPLY else bytes([0x02, opcode, _UNDEFINED_ERROR])
        reply = self._brick.handle(telegram)
        return None if about_inputs and self.inputs_mute else reply


@dataclass(slots=True)
class LooseSonar(UltrasonicSensor):
    """A sonar whose plug can be pulled: then nobody answers on its bus."""

    unplugged: bool = False

    def transfer(self, written: bytes, wanted: int) -> bytes | None:
        """The sonar's answer, None while it is unplugged."""
        return None if self.unplugged else UltrasonicSensor.transfer(self, written, wanted)


class SteppedWorker(DeviceThread):
    """A device's worker as in real time, but worked by hand: `wake` and `poll` instead of a thread."""

    def __init__(self, name: str, clock: Clock, deadline_s: float = 0.25) -> None:
        super().__init__(name, clock, period_s=0.01, deadline_s=deadline_s)
        self._hangs = False
        self._rests_until = -math.inf

    def start(self, work: Work) -> None:
        """Work once."""
        self._work = work
        self.wake()

    def wake(self) -> None:
        """Work, unless it hangs."""
        if self._work is not None and not self._hangs and not self._do(self._work):
            self._rests_until = self._clock.now() + 0.5

    def poll(self) -> None:
        """Its period is over: work, but after a mistake not so often."""
        if self._clock.now() >= self._rests_until:
            self.wake()

    def hang(self, hangs: bool) -> None:
        """The exchange under way never ends, or ends now."""
        self._hangs = hangs
        self._begun_at = self._clock.now() if hangs else None

    def end(self, last: Work) -> None:
        """Do `last`, then no more."""
        if self._work is not None:
            self._work = None
            self._do(last)


class TeleopLine:
    """A serial line in memory: the person's bytes on their way to the robot. `cut`: it hangs up."""

    def __init__(self) -> None:
        self.cut = False
        self._coming = bytearray()

    def open(self) -> TeleopLine:
        """For the driver. Raises DeviceError while it is cut."""
        if self.cut:
            raise DeviceError("the teleop line is cut")
        return self

    def say(self, data: bytes) -> None:
        """Bytes from the person's side; lost while it is cut."""
        if not self.cut:
            self._coming += data

    def read(self) -> bytes:
        """What has come."""
        self._check()
        data = bytes(self._coming)
        self._coming.clear()
        return data

    def write(self, data: bytes) -> int:
        """Status lines nobody reads."""
        self._check()
        return len(data)

    def close(self) -> None:
        """What was not read is lost."""
        self._coming.clear()

    def _check(self) -> None:
        if self.cut:
            raise OSError("hang-up")


class Person:
    """At the stick of a program that sends frames 20 times a second while `speaking`. v, w: -1..1."""

    PERIOD_S = 0.05

    def __init__(self, line: TeleopLine) -> None:
        self._line = line
        self.speaking = False
        self.v = self.w = 0.0
        self._pressed = NO_BUTTONS
        self._seq = 0
        self._due = -math.inf

    def press(self, button: Button) -> None:
        """Press and let go: it is down in the next frame only."""
        self._pressed |= button

    def advance(self, now: float) -> None:
        """Send what is due."""
        if not self.speaking or now < self._due - 1e-9:
            return
        self._due = now + self.PERIOD_S if now - self._due > self.PERIOD_S else self._due + self.PERIOD_S
        self._seq += 1
        self._line.say(encode_sticks(Sticks(self._seq, self.v, self.w, self._pressed)))
        self._pressed = NO_BUTTONS


class ScriptedState:
    """Drives straight on or stands, looks where it is told, and leaves when it is given an event."""

    def __init__(self, drives: bool) -> None:
        self._motion = Follow(((0.0, 0.0), (50.0, 0.0))) if drives else Hold()
        self.look = HeadPose(0.3, 0.3)
        self.event: Event | None = None
        self.error: Exception | None = None

    def enter(self, situation: Situation) -> None:
        """Nothing to remember."""

    def step(self, situation: Situation) -> tuple[Intent, Event | None]:
        """The script. Raises the error it was given, if any."""
        if self.error is not None:
            raise self.error
        event, self.event = self.event, None
        return Intent(look=self.look, motion=self._motion), event


class StraightBody:
    """`BodyLike` that knows one speed."""

    def command(self, intent: Intent, odometry: Odometry, blocked_by_unknown: bool, now: float) -> Command:
        """Straight on for a path, else nothing."""
        v = CRUISE_M_S if isinstance(intent.motion, Follow) else 0.0
        return Command(Twist(v, 0.0), intent.look, 0.0, now + COMMAND_LIFE_S)
