"""The NXT brick's far end of the LEGO Communication Protocol: telegrams in, motors turn, telegrams out.

Written from the protocol and the firmware's behaviour, not from the driver, so that driver and emulator are
two readings of one protocol. What the firmware does not do, this does not do either: a dead link stops no
motor, STOPPROGRAM stops no motor, only KEEPALIVE and STARTPROGRAM keep the brick awake, power is not checked.

>>> import numpy as np
>>> from robot.sim.motor import FreeMotor
>>> rng = np.random.default_rng(1)
>>> brick = BrickEmulator([None, FreeMotor(rng), FreeMotor(rng)], rng)
>>> brick.handle(bytes.fromhex("80 04 01 32 07 01 00 20 5a000000"))   # B, power 50, for 90 degrees
>>> brick.advance(1.5)
>>> int.from_bytes(brick.handle(b"\\x00\\x06\\x01")[13:17], "little", signed=True) > 90   # it overshoots
True
"""

from __future__ import annotations

import struct
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass
from enum import Enum

import numpy as np

from robot.sim.brick_inputs import InputModule, Sensor
from robot.sim.brick_outputs import OUTPUT_COUNT, OutputModule
from robot.sim.motor import Motor

OK, MAILBOX_EMPTY, UNKNOWN_OPCODE, INSANE_PACKET = 0x00, 0x40, 0xBE, 0xBF
OUT_OF_RANGE, NO_PROGRAM = 0xC0, 0xEC
TELEGRAM_MAX = 64
ALL_PORTS = 0xFF

Command = Callable[[bytes], tuple[int, bytes]]
"""What an opcode does: arguments in, status and reply body out."""

_DIRECT, _SYSTEM, _REPLY, _NO_REPLY_FLAG = 0x00, 0x01, 0x02, 0x80
_NAME_SIZE = 20
_MESSAGE_SIZE = 59
_IDLE_AMPERES = 0.12
_MILLIVOLTS_PER_COULOMB = 2800.0 / (2.0 * 3600.0)  # six cells of 2 Ah from 9.3 V down to 6.5 V
_INNER_OHMS = 0.45


class LinkState(Enum):
    """How the host's link to the brick fares."""

    UP = "up"
    SILENT = "silent"
    CUT = "cut"


@dataclass(frozen=True, slots=True)
class Identity:
    """What GETDEVICEINFO and GETVERSION tell."""

    name: str = "NXT"
    address: bytes = bytes.fromhex("00165300000100")
    free_flash: int = 93_000
    protocol: tuple[int, int] = (1, 124)
    firmware: tuple[int, int] = (1, 29)


class BrickEmulator:
    """A brick with three output and four input ports.

    motors: one entry for A, B, C; None where nothing is plugged in. rng: for garbage on the link.
    battery_mv: charge at the start; it sags with the current drawn. sensors: input port 0-3 -> sensor.
    sleep_minutes: automatic switch-off, 0 for never. programs: files STARTPROGRAM finds.
    has_reset_count: whether this firmware knows opcode 0x21.

    Switches for faults: `cut_link`, `silence_link`, `restore_link`, `garbage`, `power_off`, `set_battery`,
    `stall`, `release`.
    """

    def __init__(
        self,
        motors: Sequence[Motor | None],
        rng: np.random.Generator,
        battery_mv: float = 7900.0,
        *,
        sensors: Mapping[int, Sensor] | None = None,
        sleep_minutes: int = 10,
        programs: frozenset[str] = frozenset(),
        has_reset_count: bool = True,
        identity: Identity | None = None,
    ) -> None:
        self._outputs = OutputModule(motors)
        self._inputs = InputModule(sensors or {})
        self._rng = rng
        self._charge_mv = float(battery_mv)
        self._amperes = 0.0
        self._sleep_ms = sleep_minutes * 60_000
        self._awake_ms = 0
        self._programs = programs
        self._program: str | None = None
        self._identity = identity or Identity()
        self._remainder_s = 0.0
        self._on = True
        self._link = LinkState.UP
        self.garbage = False
        """True: replies come back as random bytes of random length."""
        self._direct = self._direct_commands()
        if has_reset_count:
            self._direct[0x21] = (1, self._reset_count)
        self._system = self._system_commands()

    # --------------------------------------------------------------------------------- state and faults

    @property
    def on(self) -> bool:
        """False after `power_off` or the automatic switch-off."""
        return self._on

    @property
    def reachable(self) -> bool:
        """False while `handle` raises: the link is cut or the brick is switched off."""
        return self._on and self._link is not LinkState.CUT

    @property
    def battery_mv(self) -> int:
        """Voltage at the terminals under the present load, in mV."""
        return max(0, round(self._charge_mv - 1000.0 * _INNER_OHMS * self._amperes))

    def set_battery(self, millivolts: float) -> None:
        """Put in a battery of this open-circuit voltage."""
        self._charge_mv = float(millivolts)

    def cut_link(self) -> None:
        """Pull the cable: `handle` raises ConnectionError. The motors run on."""
        self._link = LinkState.CUT

    def silence_link(self) -> None:
        """Out of radio range: telegrams are lost, nothing answers. The motors run on."""
        self._link = LinkState.SILENT

    def restore_link(self) -> None:
        """Put the link back as it was."""
        self._link = LinkState.UP

    def power_off(self) -> None:
        """Switch the brick off: motors float, nothing answers any more."""
        self._on = False
        for motor in self._outputs.motors:
            if motor is not None:
                motor.drive(0, False, 0.0)

    def stall(self, port: int) -> None:
        """Jam the gears of the motor on this port."""
        self._motor(port).jammed = True

    def release(self, port: int) -> None:
        """Free the gears again."""
        self._motor(port).jammed = False

    def _motor(self, port: int) -> Motor:
        motor = self._outputs.motors[port]
        if motor is None:
            raise ValueError(f"no motor on output port {'ABC'[port]}")
        return motor

    # ------------------------------------------------------------------------------------------------- time

    def advance(self, dt: float) -> None:
        """Let `dt` seconds pass in firmware, motors and battery; dt >= 0, any size, best 1-10 ms.

        The firmware runs in whole milliseconds; what is left over waits for the next call.
        """
        self._remainder_s += dt
        ticks = int(self._remainder_s * 1000.0 + 1e-6)
        self._remainder_s -= ticks / 1000.0
        for _ in range(ticks):
            self._millisecond()

    def _millisecond(self) -> None:
        if self._on:
            volts = self.battery_mv / 1000.0
            self._outputs.tick(volts)
            self._inputs.tick()
            self._drain(0.001)
            self._awake_ms += 1
        for motor in self._outputs.motors:
            if motor is not None:
                motor.advance(0.001)
        if self._on and 0 < self._sleep_ms <= self._awake_ms:
            self.power_off()

    def _drain(self, dt: float) -> None:
        drawn = _IDLE_AMPERES + sum(m.current_amperes for m in self._outputs.motors if m is not None)
        # The brick averages its voltage over some 50 ms; without that, sag and current would ring.
        self._amperes += (drawn - self._amperes) * dt / 0.05
        self._charge_mv -= drawn * dt * _MILLIVOLTS_PER_COULOMB

    # --------------------------------------------------------------------------------------------- telegrams

    def handle(self, telegram: bytes) -> bytes | None:
        """Answer one telegram; None if none is due. Raises ConnectionError while the link is cut."""
        if not self.reachable:
            raise ConnectionError("the brick is gone: its link is cut or it is switched off")
        if self._link is LinkState.SILENT:
            return None
        reply = self._answer(telegram)
        if reply is not None and self.garbage:
            return self._rng.bytes(int(self._rng.integers(1, TELEGRAM_MAX + 1)))
        return reply

    def _answer(self, telegram: bytes) -> bytes | None:
        if len(telegram) < 2:
            return None
        kind, opcode = telegram[0] & ~_NO_REPLY_FLAG, telegram[1]
        if kind not in (_DIRECT, _SYSTEM):
            return None  # a reply to somebody else, or noise
        status, body = self._execute(kind, opcode, telegram)
        if telegram[0] & _NO_REPLY_FLAG:
            return None
        return bytes([_REPLY, opcode, status]) + body

    def _execute(self, kind: int, opcode: int, telegram: bytes) -> tuple[int, bytes]:
        commands = self._direct if kind == _DIRECT else self._system
        if opcode not in commands:
            return UNKNOWN_OPCODE, b""
        size, command = commands[opcode]
        arguments = telegram[2:]
        if len(arguments) < size or len(telegram) > TELEGRAM_MAX:
            return INSANE_PACKET, b""
        return command(arguments)

    def _direct_commands(self) -> dict[int, tuple[int, Command]]:
        """Opcode -> least number of argument bytes, and what it does."""
        return {
            0x00: (2, self._start_program),
            0x01: (0, self._stop_program),
            0x03: (4, lambda _: (OK, b"")),  # PLAYTONE
            0x04: (10, self._set_output),
            0x05: (3, self._inputs.set_mode),
            0x06: (1, self._get_output),
            0x07: (1, self._inputs.values),
            0x08: (1, self._inputs.reset_scaled),
            0x09: (3, self._write_message),
            0x0A: (2, self._reset_position),
            0x0B: (0, lambda _: (OK, struct.pack("<H", self.battery_mv))),
            0x0C: (0, lambda _: (OK, b"")),  # STOPSOUNDPLAYBACK
            0x0D: (0, self._keep_alive),
            0x0E: (1, self._inputs.lowspeed_status),
            0x0F: (3, self._inputs.lowspeed_write),
            0x10: (1, self._inputs.lowspeed_read),
            0x11: (0, self._program_name),
            0x13: (3, self._read_message),
        }

    def _system_commands(self) -> dict[int, tuple[int, Command]]:
        return {0x88: (0, self._version), 0x9B: (0, self._device_info)}

    # ----------------------------------------------------------------------------------------------- programs

    def _start_program(self, arguments: bytes) -> tuple[int, bytes]:
        name = arguments.split(b"\0", 1)[0].decode("ascii", "replace")
        if name not in self._programs:
            return OUT_OF_RANGE, b""
        self._program = name
        self._awake_ms = 0
        return OK, b""

    def _stop_program(self, _: bytes) -> tuple[int, bytes]:
        if self._program is None:
            return NO_PROGRAM, b""
        self._program = None
        self._outputs.all_idle()
        return OK, b""

    def _program_name(self, _: bytes) -> tuple[int, bytes]:
        name = (self._program or "").encode("ascii").ljust(_NAME_SIZE, b"\0")
        return (OK if self._program else NO_PROGRAM), name

    def _write_message(self, arguments: bytes) -> tuple[int, bytes]:
        count, text = arguments[1], arguments[2:]
        if not 0 < count <= min(_MESSAGE_SIZE, len(text)) or text[count - 1] != 0:
            return OUT_OF_RANGE, b""
        return (OK if self._program else NO_PROGRAM), b""

    def _read_message(self, arguments: bytes) -> tuple[int, bytes]:
        status = MAILBOX_EMPTY if self._program else NO_PROGRAM
        return status, bytes([arguments[1], 0]) + bytes(_MESSAGE_SIZE)

    def _keep_alive(self, _: bytes) -> tuple[int, bytes]:
        self._awake_ms = 0
        return OK, struct.pack("<I", self._sleep_ms)

    # ------------------------------------------------------------------------------------------------- ports

    def _set_output(self, arguments: bytes) -> tuple[int, bytes]:
        port, power, mode, regulation, turn, run_state, limit = struct.unpack("<BbBBbBI", arguments[:10])
        if port >= OUTPUT_COUNT and port != ALL_PORTS:
            return OUT_OF_RANGE, b""
        for each in range(OUTPUT_COUNT) if port == ALL_PORTS else (port,):
            self._outputs.write(each, power, mode, regulation, turn, run_state, limit)
        return OK, b""

    def _get_output(self, arguments: bytes) -> tuple[int, bytes]:
        if arguments[0] >= OUTPUT_COUNT:
            return OUT_OF_RANGE, bytes(22)
        return OK, self._outputs.state(arguments[0])

    def _reset_position(self, arguments: bytes) -> tuple[int, bytes]:
        port, relative = arguments[0], arguments[1]
        if port >= OUTPUT_COUNT:
            return OUT_OF_RANGE, b""
        if relative:
            self._outputs.reset_block_count(port)
        else:
            self._outputs.reset_rotation_count(port)
        return OK, b""

    def _reset_count(self, arguments: bytes) -> tuple[int, bytes]:
        if arguments[0] >= OUTPUT_COUNT:
            return OUT_OF_RANGE, b""
        self._outputs.reset_count(arguments[0])
        return OK, b""

    # ------------------------------------------------------------------------------------------------- system

    def _version(self, _: bytes) -> tuple[int, bytes]:
        (major, minor), (fw_major, fw_minor) = self._identity.protocol, self._identity.firmware
        return OK, bytes([minor, major, fw_minor, fw_major])

    def _device_info(self, _: bytes) -> tuple[int, bytes]:
        name = self._identity.name.encode("ascii")[:14]
        return OK, struct.pack("<15s7s4xI", name, self._identity.address, self._identity.free_flash)
