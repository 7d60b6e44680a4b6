"""What each sort of speaker says, as words for the robot: sessions, sequence numbers, neutral first."""

from __future__ import annotations

from dataclasses import dataclass, field, replace
from typing import Final

from robot.hal.teleop import mavlink
from robot.hal.teleop.frames import NO_BUTTONS, Button, Sticks
from robot.hal.teleop.keys import HELP, MOTIONS, Ask, Speeds, asked
from robot.hal.teleop.mavlink import Packet
from robot.hal.teleop.sticks import NEW_SESSION_AFTER_S, Sequence, Stick, clipped
from robot.messages import TeleopInput

HEARTBEAT_LOST_S: Final = 3.0
"""A ground station sends HEARTBEAT once a second; sticks without it do not count."""
_MOST_STATIONS: Final = 8


class KeyTalker:
    """A person at a bare terminal. `notes` collects lines to answer with.

    Each key that drives is a word of its own; that it lasts no longer than a pulse is the driver's affair.
    """

    def __init__(self) -> None:
        self._speeds = Speeds()
        self.notes: list[str] = []

    def said(self, keys: tuple[str, ...], now: float, may_drive: bool) -> list[TeleopInput]:
        """Words for these keys. may_drive: False while a program speaks on the line: then none drives."""
        words = [self._word(key, now) for key in keys]
        return [word for word in words if word is not None and (may_drive or not (word.v or word.w))]

    def _word(self, key: str, now: float) -> TeleopInput | None:
        speeds = self._speeds.after(key)
        if speeds is not None:
            self._speeds = speeds
            self.notes.append(f"speed: forward {speeds.forward:.0%}, turning {speeds.turning:.0%}")
            return None
        if key in MOTIONS:
            forward, left = MOTIONS[key]
            v, w = forward * self._speeds.forward, left * self._speeds.turning
            return TeleopInput(now, v, w, kind="keys")
        ask = asked(key)
        if ask is Ask.HELP:
            self.notes.extend(HELP)
            return None
        return TeleopInput(
            now,
            take=ask is Ask.TAKE,
            release=ask is Ask.RELEASE,
            stop=ask is Ask.STOP,
            arm=ask is Ask.GIVE,
            kind="keys",
        )


class FrameTalker:
    """A program that sends binary frames. A button acts when it is pressed; stop as long as it is down."""

    def __init__(self) -> None:
        self._sequence = Sequence(bits=16)
        self._stick = Stick()
        self._held = NO_BUTTONS

    @property
    def heard(self) -> tuple[int, float]:
        """Newest sequence number and when it came."""
        return self._sequence.last or 0, self._sequence.at

    def said(self, sticks: Sticks, now: float) -> TeleopInput | None:
        """The word of a frame; None for a hello and for one that is stale or came twice."""
        if sticks.hello:
            self._sequence = Sequence(bits=16).after(sticks.seq, now)
            self._stick, self._held = Stick(), NO_BUTTONS
            return None
        if not self._sequence.is_new(sticks.seq, now):
            return None
        if now - self._sequence.at > NEW_SESSION_AFTER_S:
            self._held = NO_BUTTONS
        self._sequence = self._sequence.after(sticks.seq, now)
        self._stick = self._stick.moved(sticks.v, sticks.w, now)
        pressed, self._held = sticks.buttons & ~self._held, sticks.buttons
        if Button.STOP in sticks.buttons:
            return TeleopInput(now, stop=True, kind="frames")
        return TeleopInput(
            now,
            self._stick.v,
            self._stick.w,
            take=Button.TAKE in pressed and self._stick.may_take(now),
            release=Button.RELEASE in pressed,
            arm=Button.GIVE in pressed,
            kind="frames",
        )


@dataclass(frozen=True, slots=True)
class _Station:
    """A ground station: its stick, its sequence, when its heart beat last."""

    sequence: Sequence = field(default_factory=lambda: Sequence(bits=8))
    stick: Stick = field(default_factory=Stick)
    heartbeat_at: float | None = None
    heard_at: float = 0.0


class MavlinkTalker:
    """Ground stations on the line. `answers` collects (number, payload) to send back.

    Arm takes, disarm releases, a forced disarm stops. The station that armed last drives alone until it
    disarms or another one arms.
    """

    def __init__(self) -> None:
        self._stations: dict[tuple[int, int], _Station] = {}
        self._driver: tuple[int, int] | None = None
        self.answers: list[tuple[int, bytes]] = []
        self.version = 2

    def said(self, packet: Packet, now: float) -> TeleopInput | None:
        """The word of a message; None if it says nothing to us, is stale or came twice."""
        who = packet.system, packet.component
        if packet.system == mavlink.ROBOT_SYSTEM and packet.component == mavlink.ROBOT_COMPONENT:
            return None  # our own voice, echoed
        station = self._stations.get(who, _Station())
        if not station.sequence.is_new(packet.seq, now):
            return None
        if not mavlink.is_known(packet.number):
            return None  # its checksum was not checked: nothing is learnt from it
        self.version = packet.version
        station = replace(station, sequence=station.sequence.after(packet.seq, now), heard_at=now)
        word: TeleopInput | None = None
        match packet.number:
            case mavlink.HEARTBEAT if mavlink.is_ground_station(packet.payload):
                station = replace(station, heartbeat_at=now)
            case mavlink.MANUAL_CONTROL:
                station, word = self._manual(station, who, packet.payload, now)
            case mavlink.COMMAND_LONG:
                word = self._command(station, who, packet.payload, now)
        self._stations.pop(who, None)
        self._stations[who] = station
        while len(self._stations) > _MOST_STATIONS:
            del self._stations[min(self._stations, key=lambda name: self._stations[name].heard_at)]
        return word

    def _manual(
        self, station: _Station, who: tuple[int, int], payload: bytes, now: float
    ) -> tuple[_Station, TeleopInput | None]:
        manual = mavlink.read_manual_control(payload)
        alive = station.heartbeat_at is not None and now - station.heartbeat_at <= HEARTBEAT_LOST_S
        if not alive or manual.target not in (0, mavlink.ROBOT_SYSTEM):
            return station, None
        stick = station.stick.moved(clipped(manual.v), clipped(manual.w), now)
        station = replace(station, stick=stick)
        if self._driver not in (None, who):
            return station, None
        return station, TeleopInput(now, stick.v, stick.w, kind="mavlink")

    def _command(
        self, station: _Station, who: tuple[int, int], payload: bytes, now: float
    ) -> TeleopInput | None:
        command = mavlink.read_command(payload)
        if command.system not in (0, mavlink.ROBOT_SYSTEM):
            return None
        if command.command != mavlink.ARM_DISARM or command.param1 not in (0.0, 1.0):
            self._answer(command.command, mavlink.UNSUPPORTED, who)
            return None
        if command.param1 == 0.0:
            self._driver = None
            self._answer(command.command, mavlink.ACCEPTED, who)
            forced = command.param2 == mavlink.FORCE
            return TeleopInput(now, release=not forced, stop=forced, kind="mavlink")
        if not station.stick.may_take(now):
            self._answer(command.command, mavlink.TEMPORARILY_REJECTED, who)
            return None
        self._driver = who
        self._answer(command.command, mavlink.ACCEPTED, who)
        return TeleopInput(now, take=True, kind="mavlink")

    def _answer(self, command: int, result: int, who: tuple[int, int]) -> None:
        self.answers.append((mavlink.COMMAND_ACK, mavlink.command_ack(command, result, *who, self.version)))
