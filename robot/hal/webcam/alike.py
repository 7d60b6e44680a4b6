"""Both eyes under the same exposure and colours: what one has settled on is set by hand on both."""

from __future__ import annotations

import logging
import time
from collections.abc import Callable, Sequence
from contextlib import suppress
from dataclasses import dataclass, field
from typing import Final

from robot.hal.interfaces import DeviceError
from robot.hal.webcam.controls import Cid, Controls

_log: Final = logging.getLogger(__name__)

_MANUAL_EXPOSURE: Final = 1
_AUTOMATIC_EXPOSURE: Final = (3, 0)  # UVC cameras know 3, others 0
_SETTLING: Final = (Cid.EXPOSURE_ABSOLUTE, Cid.WHITE_BALANCE_TEMPERATURE, Cid.GAIN)

# A camera without one of these has nothing to be switched off: no loss.
_AUTOMATICS: Final = frozenset(
    {Cid.EXPOSURE_AUTO_PRIORITY, Cid.FOCUS_AUTO, Cid.EXPOSURE_AUTO, Cid.AUTOGAIN, Cid.AUTO_WHITE_BALANCE}
)

OpenControls = Callable[[], Controls]


@dataclass(frozen=True, slots=True)
class Look:
    """How pictures are to be taken; None: leave it. Exposure in 100 us, colour temperature in kelvin."""

    exposure_100us: int | None = None
    white_balance_k: int | None = None
    gain: int | None = None
    power_line: int | None = None
    focus: int | None = None


@dataclass(slots=True)
class Teller:
    """Says once what a camera cannot do."""

    told: set[str] = field(default_factory=set)

    def tell(self, words: str) -> None:
        """Into the log, if it was not said before."""
        if words not in self.told:
            self.told.add(words)
            _log.warning("%s", words)


def automatic(controls: Controls) -> None:
    """Let the camera find exposure, white balance and gain itself, at a steady rate. Raises DeviceError."""
    _try(controls, Cid.EXPOSURE_AUTO_PRIORITY, 0)
    for mode in _AUTOMATIC_EXPOSURE:
        if _try(controls, Cid.EXPOSURE_AUTO, mode):
            break
    _try(controls, Cid.AUTO_WHITE_BALANCE, 1)
    _try(controls, Cid.AUTOGAIN, 1)


def settled(
    controls: Controls,
    still: float = 0.4,
    most: float = 2.0,
    pause: Callable[[float], None] = time.sleep,
    monotonic: Callable[[], float] = time.monotonic,
) -> Look:
    """Wait until the automatic values stand still for `still` seconds (at most `most`), then read them.

    Values that the camera does not tell are None. Raises DeviceError.
    """
    watched = [control for control in _SETTLING if controls.info(control) is not None]
    until = monotonic() + most
    values, since = dict(controls.read(*watched)), monotonic()
    while monotonic() < until and monotonic() - since < still:
        pause(0.05)
        newer = dict(controls.read(*watched))
        if newer != values:
            values, since = newer, monotonic()
    others = {
        c: controls.read(c)[c] for c in (Cid.POWER_LINE_FREQUENCY, Cid.FOCUS_ABSOLUTE) if _has(controls, c)
    }
    return Look(
        values.get(Cid.EXPOSURE_ABSOLUTE),
        values.get(Cid.WHITE_BALANCE_TEMPERATURE),
        values.get(Cid.GAIN),
        others.get(Cid.POWER_LINE_FREQUENCY),
        others.get(Cid.FOCUS_ABSOLUTE),
    )


def lock(controls: Controls, look: Look) -> tuple[str, ...]:
    """Set the look by hand, all automatics off; returns the names of what the camera does not have or take.

    Automatics go first: a camera refuses the value of what it controls itself. Raises DeviceError if it
    does not answer at all.
    """
    steps: list[tuple[str, int, int | None]] = [
        ("steady rate", Cid.EXPOSURE_AUTO_PRIORITY, 0),
        ("power line filter", Cid.POWER_LINE_FREQUENCY, look.power_line),
        ("autofocus off", Cid.FOCUS_AUTO, 0),
        ("focus", Cid.FOCUS_ABSOLUTE, look.focus),
        ("manual exposure", Cid.EXPOSURE_AUTO, None if look.exposure_100us is None else _MANUAL_EXPOSURE),
        ("exposure", Cid.EXPOSURE_ABSOLUTE, look.exposure_100us),
        ("manual gain", Cid.AUTOGAIN, None if look.gain is None else 0),
        ("gain", Cid.GAIN, look.gain),
        ("manual white balance", Cid.AUTO_WHITE_BALANCE, None if look.white_balance_k is None else 0),
        ("white balance", Cid.WHITE_BALANCE_TEMPERATURE, look.white_balance_k),
    ]
    return tuple(
        name
        for name, control, value in steps
        if value is not None
        and not _try(controls, control, value)
        and (control not in _AUTOMATICS or controls.info(control) is not None)
    )


class LookKeeper:
    """The look of all eyes: found once at the start, set again on an eye that was plugged in again."""

    def __init__(self, wanted: Look, settle: Callable[[Controls], Look] = settled) -> None:
        self._wanted = wanted
        self._settled = settle
        self._look: Look | None = None
        self._teller = Teller()

    def find(self, leader: tuple[str, OpenControls], others: Sequence[tuple[str, OpenControls]]) -> None:
        """Let the leading eye settle where no value is wanted, then give every eye the same look."""
        wanted = self._wanted
        found = Look()
        if wanted.exposure_100us is None or wanted.white_balance_k is None:
            found = self._settle(*leader)
        self._look = Look(
            exposure_100us=_first(wanted.exposure_100us, found.exposure_100us),
            white_balance_k=_first(wanted.white_balance_k, found.white_balance_k),
            gain=_first(wanted.gain, found.gain),
            power_line=_first(wanted.power_line, found.power_line),
            focus=_first(wanted.focus, found.focus),
        )
        for name, open_controls in (leader, *others):
            self.apply(name, open_controls)

    def apply(self, name: str, open_controls: OpenControls) -> None:
        """Give one eye the look, once it is found; what it cannot do is told once and passed over."""
        if self._look is None:
            return
        try:
            controls = open_controls()
        except DeviceError as error:
            self._teller.tell(f"the picture of {name} stays automatic: {error}")
            return
        try:
            missing = lock(controls, self._look)
        except DeviceError as error:
            self._teller.tell(f"the picture of {name} could not be set: {error}")
            return
        finally:
            controls.close()
        if missing:
            self._teller.tell(f"camera {name} does not take: {', '.join(missing)}")

    def _settle(self, name: str, open_controls: OpenControls) -> Look:
        try:
            controls = open_controls()
        except DeviceError as error:
            self._teller.tell(f"the picture of {name} stays automatic: {error}")
            return Look()
        try:
            automatic(controls)
            return self._settled(controls)
        except DeviceError as error:
            self._teller.tell(f"the picture of {name} could not be read: {error}")
            return Look()
        finally:
            controls.close()


def _try(controls: Controls, control: int, value: int) -> bool:
    """Set a control the camera has; False if it has none such or refuses the value."""
    info = controls.info(control)
    if info is None:
        return False
    with suppress(DeviceError):
        controls.write(control, info.fitted(value))
        return True
    return False


def _has(controls: Controls, control: int) -> bool:
    return controls.info(control) is not None


def _first(wanted: int | None, found: int | None) -> int | None:
    return found if wanted is None else wanted
