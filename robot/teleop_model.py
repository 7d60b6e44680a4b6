"""What the teleop client knows and sends, without terminal, port or clock. All functions are pure."""

from __future__ import annotations

import re
from dataclasses import dataclass, field, replace
from typing import Final

from robot.gamepad import Pad
from robot.hal.teleop.frames import NO_BUTTONS, Button, Status, Sticks
from robot.hal.teleop.keys import MOTIONS, Ask, Speeds, asked
from robot.hal.teleop.sticks import is_neutral

FRAME_EVERY_S: Final = 0.05
FIRST_PRESS_S: Final = 0.4
"""A key drives so long after its first press: terminals tell no release, and repeat only after a while."""
REPEAT_S: Final = 0.15
"""... and so long after one that repeats by itself, so that letting go is felt at once."""
BUTTON_S: Final = 0.2
"""A button stays down for some frames, for one of them may be lost."""
SILENT_AFTER_S: Final = 1.5
_REPEATS_WITHIN_S: Final = 0.12
_KEPT_SEQS: Final = 64

_BUTTONS: Final = {
    Ask.STOP: Button.STOP,
    Ask.TAKE: Button.TAKE,
    Ask.RELEASE: Button.RELEASE,
    Ask.GIVE: Button.GIVE,
}
_LINE: Final = re.compile(
    r"(?P<state>\w+)\s+v (?P<v>[+-][\d.]+) w (?P<w>[+-][\d.]+)\s+(?P<volts>[\d.]+|\?) V\s*(?P<rest>.*)"
)


@dataclass(frozen=True, slots=True)
class RobotLine:
    """A status line taken apart: state, speeds in m/s and rad/s, battery, who drives, what is the matter."""

    state: str
    v: float
    w: float
    volts: float | None
    who: str
    trouble: str


@dataclass(frozen=True, slots=True)
class ClientModel:
    """Everything the client knows. Times are of its own clock, seconds."""

    speeds: Speeds = field(default_factory=Speeds)
    key: str = ""
    key_at: float = -1e9
    drive_key: str = ""
    drive_until: float = -1e9
    buttons: Button = NO_BUTTONS
    buttons_until: float = -1e9
    pad: Pad = field(default_factory=Pad)
    seq: int = 0
    sent: tuple[tuple[int, float], ...] = ()
    status: Status | None = None
    status_at: float = -1e9
    delay_s: float | None = None
    note: str = ""

    @property
    def robot(self) -> RobotLine | None:
        """What the robot said last, if it can be read."""
        return read_line(self.status.text) if self.status is not None else None

    def heard(self, now: float) -> bool:
        """True while the robot answers."""
        return now - self.status_at <= SILENT_AFTER_S


def pressed(model: ClientModel, key: str, now: float) -> ClientModel:
    """A key went down (or repeats)."""
    repeats = key == model.key and now - model.key_at <= _REPEATS_WITHIN_S
    model = replace(model, key=key, key_at=now, note="")
    speeds = model.speeds.after(key)
    if speeds is not None:
        return replace(model, speeds=speeds)
    if key in MOTIONS:
        return replace(model, drive_key=key, drive_until=now + (REPEAT_S if repeats else FIRST_PRESS_S))
    model = replace(model, drive_until=now)
    ask = asked(key)
    return _ask(model, _BUTTONS[ask], now) if ask in _BUTTONS else model


def padded(model: ClientModel, pad: Pad, now: float) -> ClientModel:
    """The gamepad stands like this."""
    lost = model.pad.present and not pad.present
    model = replace(model, pad=pad, note="the gamepad is gone" if lost else model.note)
    return _ask(model, pad.pressed, now) if pad.pressed else model


def heard(model: ClientModel, status: Status, now: float) -> ClientModel:
    """The robot answered; from the sequence number it heard follows the line's delay, there and back."""
    sent_at = dict(model.sent).get(status.heard)
    delay = max(now - sent_at - status.age_ms / 1e3, 0.0) if sent_at is not None else model.delay_s
    return replace(model, status=status, status_at=now, delay_s=delay)


def axes(model: ClientModel, now: float) -> tuple[float, float]:
    """Forward and left, -1..1: a held key, else the gamepad; none while stop is asked for."""
    if Button.STOP in buttons(model, now):
        return 0.0, 0.0
    if now < model.drive_until:
        forward, left = MOTIONS[model.drive_key]
        return forward * model.speeds.forward, left * model.speeds.turning
    return model.pad.v, model.pad.w


def buttons(model: ClientModel, now: float) -> Button:
    """The buttons that are down: just asked for by key or pad, and a stop held on the pad."""
    asked_for = model.buttons if now < model.buttons_until else NO_BUTTONS
    return asked_for | (model.pad.held & Button.STOP)


def next_frame(model: ClientModel, now: float) -> tuple[ClientModel, Sticks]:
    """The frame to send now, with the next sequence number."""
    v, w = axes(model, now)
    return _numbered(model, Sticks(0, v, w, buttons(model, now)), now)


def hello(model: ClientModel, now: float) -> tuple[ClientModel, Sticks]:
    """The frame that begins a session."""
    return _numbered(model, Sticks(0, hello=True), now)


def farewell(model: ClientModel, now: float) -> tuple[ClientModel, list[Sticks]]:
    """What ends a session, to be sent one frame each 50 ms: stop, then release, each long enough to be heard.

    Between them the buttons are up: a stop heard in the same moment would hide the release.
    """
    frames = []
    for held in (
        *[Button.STOP] * 3,
        *[NO_BUTTONS] * 3,
        *[Button.RELEASE] * 3,
        NO_BUTTONS,
        *[Button.RELEASE] * 2,
    ):
        model, frame = _numbered(model, Sticks(0, buttons=held), now)
        frames.append(frame)
    return model, frames


def read_line(text: str) -> RobotLine | None:
    """Take a status line apart; None if it is none.

    >>> line = read_line("teleop     v +0.12 w -0.30   8.1 V  you drive  (blind: 0.08 m/s)")
    >>> line.state, line.volts, line.who, line.trouble
    ('teleop', 8.1, 'you drive', 'blind: 0.08 m/s')
    """
    found = _LINE.match(text)
    if found is None:
        return None
    try:
        v, w = float(found["v"]), float(found["w"])
        volts = None if found["volts"] == "?" else float(found["volts"])
    except ValueError:
        return None
    who, _, trouble = re.sub(r"\s{2,}", "\t", found["rest"].strip()).partition("\t")
    trouble = trouble.strip().removeprefix("! ")
    if trouble.startswith("("):
        trouble = trouble[1:].removesuffix(")")
    return RobotLine(found["state"], v, w, volts, who, trouble)


def _ask(model: ClientModel, asked_for: Button, now: float) -> ClientModel:
    """Press a button. Taking needs the stick let go: said here, for the robot just keeps still."""
    if Button.TAKE in asked_for and not is_neutral(*axes(model, now)):
        asked_for &= ~Button.TAKE
        model = replace(model, note="let go of the stick, then take")
    if Button.STOP in asked_for:
        model = replace(model, drive_until=now)
        asked_for = Button.STOP
    elif Button.STOP in buttons(model, now):
        return model  # a stop goes out before anything else is asked
    return replace(model, buttons=asked_for, buttons_until=now + BUTTON_S) if asked_for else model


def _numbered(model: ClientModel, frame: Sticks, now: float) -> tuple[ClientModel, Sticks]:
    seq = (model.seq + 1) & 0xFFFF
    sent = (*model.sent[-_KEPT_SEQS + 1 :], (seq, now))
    return replace(model, seq=seq, sent=sent), replace(frame, seq=seq)
