"""The arm behind its Modbus controller: heartbeat, numbered commands that run once, faults in words."""

from __future__ import annotations

import math
from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace
from typing import Final

from robot.hal.arm import registers as map_
from robot.hal.arm.controller_client import ControllerClient
from robot.hal.arm.health import EchoWatch, told_by
from robot.hal.arm.owner import Ownership
from robot.hal.arm.registers import Opcode, Report, Status
from robot.hal.arm.settings import ModbusArmSettings
from robot.hal.backoff import Backoff
from robot.hal.faultbook import FaultBook
from robot.hal.interfaces import ArmState, DeviceError
from robot.hal.modbus import ModbusLink, NoAnswerError, RefusedError, asked_patiently
from robot.messages import Fault

_DEFAULTS: Final = ModbusArmSettings()


@dataclass(frozen=True, slots=True)
class _Command:
    """A motion on its way: not yet seen to have begun."""

    number: int
    block: tuple[int, ...]
    first_sent_at: float
    sent_at: float


class ModbusArm:
    """`Arm` on a controller with the map of robot/hal/arm/registers.py. Call `read` 10-25 times a second.

    `read` writes the heartbeat (with owner token, speed limit and watchdog time) and polls; without it the
    controller stops the arm within `watchdog_ms`. Each method costs at most one unanswered exchange; while
    the link is down nothing is sent until the next try.

    A motion's number goes with it in one telegram. If the answer is lost `read` sends the same number again
    (the controller begins a number once) for `command_life_s`; after a stop, a fault of the link, or a
    refusal it is never sent again. `move_*` return 0 for a command that was not sent or was refused; a number
    says it was sent, and `progress` what became of it.

    Opening takes the controller over if nobody else owns it and leaves the drives off. Raises DeviceError
    with the cure if nobody answers or the registers are not those of an arm; the link is closed then.

    Faults: `link` (no answer, or a controller whose program stands still), `fault` (its own, number and
    words), `stopped` (emergency or protective stop), `refused` (a command was; or another master owns it).
    """

    def __init__(self, link: ModbusLink, settings: ModbusArmSettings = _DEFAULTS) -> None:
        self._controller = ControllerClient(link, settings.unit, settings.low_first)
        self._settings = settings
        self._faults = FaultBook("arm")
        self._backoff = Backoff()
        self._ownership = Ownership(settings.owner, settings.owner_check_s)
        self._beat_count = 0
        self._beat_at = self._heard_at = self._polled_at = -math.inf
        self._percent = 100
        self._number = 0
        self._pending: _Command | None = None
        self._stop_owed = False
        self._echo = EchoWatch(settings.echo_s)
        self._refused_until = -math.inf
        self._refused_number = 0
        self._closed = False
        try:
            self._report = asked_patiently(self._open)
        except DeviceError:
            link.close()
            raise
        self._state = self._report.arm

    # ----------------------------------------------------------------------------------- what it is told

    def enable(self, now: float) -> None:
        """Switch the drives on."""
        self._set_coil(map_.COIL_ENABLE, True, now)

    def disable(self, now: float) -> None:
        """Switch the drives off."""
        self._set_coil(map_.COIL_ENABLE, False, now)

    def reset_faults(self, now: float) -> None:
        """Acknowledge the controller's fault; the drives stay off until `enable`."""
        self._set_coil(map_.COIL_FAULT_RESET, True, now)

    def grip(self, closed: bool, now: float) -> None:
        """Close or open the gripper."""
        self._set_coil(map_.COIL_GRIPPER, closed, now)

    def move_joints(self, joints: tuple[float, ...], speed: float, now: float) -> int:
        """Move to joint angles (radians) at a share 0..1 of full speed; returns the command's number."""
        if len(joints) != map_.JOINTS or not all(map(math.isfinite, joints)):
            return self._refuse(f"{len(joints)} joints, not {map_.JOINTS} numbers", now)
        return self._move(Opcode.MOVE_JOINTS, map_.joint_targets(joints), speed, now)

    def move_linear(
        self,
        position: tuple[float, float, float],
        orientation: tuple[float, float, float],
        speed: float,
        now: float,
    ) -> int:
        """Move the flange in a straight line; orientation (rx, ry, rz) of Rz(rz) Ry(ry) Rx(rx)."""
        if not all(map(math.isfinite, (*position, *orientation))):
            return self._refuse("the pose is no number", now)
        return self._move(Opcode.MOVE_LINEAR, map_.pose_targets(position, orientation), speed, now)

    def limit_speed(self, share: float, now: float) -> None:
        """Let every motion go at no more than this share 0..1 (whole percents, rounded down); nan is 0."""
        # Not to let 0.07 * 100 = 7.000000000000001 or 0.29 * 100 = 28.999999999999996 decide a percent.
        percent = math.floor(100.0 * min(max(share, 0.0), 1.0) + 1e-9) if share == share else 0
        if percent == self._percent:
            return
        self._percent = percent
        if self._can_command(now):
            self._try(lambda: self._beat(now), now)

    def stop(self, now: float) -> None:
        """Stop at once; sent again by `read` until the controller took it."""
        self._pending = None
        if self._closed:
            return
        self._stop_owed = True
        if self._can_speak(now):
            self._try(lambda: self._write_stop(now), now)

    def close(self) -> None:
        """Stop, switch the drives off, give the controller back and release the link."""
        if self._closed:
            return
        self._pending = None
        now = self._polled_at
        # One telegram may get lost; without an answer to two the controller's watchdog has to stop it.
        for _ in range(2):
            if not self._can_speak(now) or self._try(lambda: self._let_go(now), now):
                break
        self._closed = True
        self._state = replace(self._state, moving=False, enabled=False)
        self._controller.close()

    # -------------------------------------------------------------------------------------- what it tells

    def read(self, now: float) -> ArmState:
        """Beat, poll, send again what got lost; the last known state while the controller is silent."""
        if self._closed:
            return self._state
        if self._heard_at == -math.inf:
            self._heard_at = now
        if self._backoff.due(now):
            self._try(lambda: self._cycle(now), now)
        return self._state

    def faults(self, now: float) -> tuple[Fault, ...]:
        """What is wrong."""
        if now >= self._refused_until:
            self._faults.cleared("refused")
        return self._faults.open

    def progress(self, number: int) -> str:
        """What became of a command as last read: 'sent', 'under way', or how it ended ('done', ...).

        Of commands before the last one only 'over' is known.
        """
        if self._pending is not None and self._pending.number == number:
            return "sent"
        status = self._report.status
        if status.ended == map_.on_wire(number):
            return _words(status.result)
        return "under way" if status.begun == map_.on_wire(number) else "over"

    @property
    def gripper_closed(self) -> bool:
        """True while the gripper's sensor says closed, as last read."""
        return self._report.gripper_closed

    # ------------------------------------------------------------------------------------------ motion

    def _move(self, opcode: Opcode, targets: Sequence[int], speed: float, now: float) -> int:
        if not self._can_command(now):
            return 0
        if not self._report.arm.enabled:
            # That may be older than an `enable` just given.
            self._try(lambda: self._look_again(now), now)
        if not self._report.arm.enabled:
            return self._refuse("the drives are off: enable them first", now)
        if self._stop_owed:
            return self._refuse("a stop is still on its way", now)
        if not speed > 0.0:
            return self._refuse(f"speed {speed} is not above 0", now)
        number = self._number + 1
        percent = max(1, min(100, round(100.0 * min(speed, 1.0))))
        try:
            block = map_.command_block(opcode, percent, targets, number, self._settings.low_first)
        except ValueError as error:
            return self._refuse(str(error), now)
        self._number = number
        self._pending = _Command(number, tuple(block), now, now)
        if self._try(lambda: self._send(now), now):
            return 0 if self._refused_number == number else number
        # Lost on the way it may still have arrived: then the number is its caller's as long as it may run.
        return number if self._pending is not None else 0

    def _send(self, now: float) -> None:
        if now - self._beat_at > self._settings.watchdog_ms / 2000.0:
            self._beat(now)
        command = self._pending
        if command is None:
            return
        if not self._ownership.free:
            self._refuse_command(command, "another master has just taken the controller", now)
            return
        self._pending = replace(command, sent_at=now)
        try:
            self._controller.command(command.block, now)
        except RefusedError as error:
            self._refuse_command(command, str(error), now)
            return
        self._settle(self._controller.status(now), now)

    def _settle(self, status: Status, now: float) -> None:
        """See what became of the pending command."""
        self._report = replace(self._report, status=status)
        command = self._pending
        if command is None:
            return
        wire = map_.on_wire(command.number)
        if status.ended == wire and status.refused:
            self._refuse_command(command, _words(status.result), now)
        elif wire in (status.begun, status.ended):
            self._pending = None
            self._refused_until = -math.inf

    def _renew(self, now: float) -> None:
        """Send a command again that the controller was not seen to take, and give up in the end."""
        command = self._pending
        if command is None:
            return
        if now - command.first_sent_at > self._settings.command_life_s:
            self._refuse_command(command, "not taken by the controller", now)
            # Late it might yet begin, when nobody expects it any more.
            self._write_stop(now)
        elif now - command.sent_at >= self._settings.resend_s - 1e-9:
            self._send(now)

    def _refuse_command(self, command: _Command, words: str, now: float) -> None:
        self._pending = None
        self._refused_number = command.number
        self._refuse(f"command {command.number}: {words}", now)

    def _refuse(self, words: str, now: float) -> int:
        self._faults.raised("refused", now, words)
        self._refused_until = now + self._settings.refused_told_s
        return 0

    # ------------------------------------------------------------------------------------------ cycle

    def _open(self) -> Report:
        report = self._controller.poll(0.0)
        self._number = map_.newest(report.status.begun, report.status.ended)
        self._ownership.seen(self._controller.control(0.0), 0.0)
        if self._ownership.free:
            self._beat(0.0)
        return report

    def _cycle(self, now: float) -> None:
        if self._stop_owed:
            self._write_stop(now)
        if self._ownership.due(now):
            self._ownership.seen(self._controller.control(now), now)
        if not self._owned_by_another(now):
            self._beat(now)
        self._adopt(self._controller.poll(now), now)
        self._renew(now)
        if self._echoes(now):
            self._heard(now)

    def _adopt(self, report: Report, now: float) -> None:
        if "link" in self._faults:
            # A controller that was switched off counts from where it likes.
            self._number = map_.number_of(
                map_.newest(report.status.begun, report.status.ended), max(self._number, 1)
            )
        self._report = report
        self._settle(report.status, now)
        waiting = self._pending is not None
        self._state = replace(report.arm, in_position=report.arm.in_position and not waiting)
        self._judge(report, now)

    def _judge(self, report: Report, now: float) -> None:
        for kind, words in told_by(report).items():
            if words is None:
                self._faults.cleared(kind)
            else:
                self._faults.raised(kind, now, words)

    def _owned_by_another(self, now: float) -> bool:
        other = self._ownership.other
        if other is None:
            return False
        self._refuse(f"another master (token 0x{other:04x}) owns the controller: end it there", now)
        return True

    def _echoes(self, now: float) -> bool:
        """False, and a fault, if the controller answers but its program no longer follows the heartbeat."""
        since_poll, self._polled_at = now - self._polled_at, now
        if not self._ownership.free:
            return True
        if self._echo.follows(self._report.status.echo, since_poll):
            return True
        self._pending = None
        self._faults.raised("link", now, "its program stands still (heartbeat not echoed): restart it")
        return False

    # ------------------------------------------------------------------------------------------ link

    def _can_speak(self, now: float) -> bool:
        return not self._closed and "link" not in self._faults and self._backoff.due(now)

    def _can_command(self, now: float) -> bool:
        return self._can_speak(now) and not self._owned_by_another(now)

    def _try(self, exchange: Callable[[], None], now: float) -> bool:
        """True if the exchange went well; otherwise it is known what to do about it."""
        try:
            exchange()
        except DeviceError as error:
            self._failed(error, now)
            return False
        return True

    def _heard(self, now: float) -> None:
        self._heard_at = now
        self._backoff.worked()
        self._faults.cleared("link")

    def _failed(self, error: DeviceError, now: float) -> None:
        if now - self._heard_at < self._settings.silence_s - 1e-9:
            return
        # Of a command that was given before the outage nobody may expect a motion after it.
        self._pending = None
        self._faults.raised("link", now, str(error))
        if not isinstance(error, NoAnswerError):
            # The link has its own back-off while nobody answers, but a storm of refusals is an answer to it.
            self._backoff.failed(now)

    def _beat(self, now: float, token: int | None = None) -> None:
        self._beat_count = self._beat_count % 65535 + 1
        owner = self._settings.owner if token is None else token
        try:
            self._controller.write_control(
                self._beat_count, owner, self._percent, self._settings.watchdog_ms, now
            )
        except RefusedError:
            self._ownership.seen(self._controller.control(now), now)
            if not self._owned_by_another(now):
                raise
            return
        self._beat_at = now

    def _write_stop(self, now: float) -> None:
        self._controller.stop(now)
        self._stop_owed = False

    def _let_go(self, now: float) -> None:
        if self._ownership.free:
            self._controller.switch_off(now)
            self._beat(now, token=0)

    def _set_coil(self, coil: int, value: bool, now: float) -> None:
        if self._can_command(now):
            self._try(lambda: self._controller.set_coil(coil, value, now), now)

    def _look_again(self, now: float) -> None:
        self._report = self._controller.poll(now)


def _words(result: int) -> str:
    return map_.RESULTS.get(result, f"result {result}")
