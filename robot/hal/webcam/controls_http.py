"""A camera's controls through mjpg-streamer's HTTP interface."""

from __future__ import annotations

import json
from dataclasses import replace
from typing import Any, Final
from urllib.parse import parse_qs, urlsplit

from robot.hal.interfaces import DeviceError
from robot.hal.webcam.controls import ControlInfo
from robot.hal.webcam.http_exchange import Address, fetch, parse_address

_V4L2_GROUP: Final = 1


class HttpControls:
    """`Controls` over http://HOST:PORT; raises DeviceError if no list of controls comes.

    List: `GET /input_0.json`; setting: `GET /?action=command&dest=0&plugin=0&id=..&group=1&value=..`. The
    number after input_ is that of the stream (`/?action=stream_1` has the controls of input_1). Each exchange
    ends within `timeout` seconds, opening within `open_timeout`.
    """

    def __init__(self, url: str, timeout: float = 0.05, open_timeout: float = 1.0) -> None:
        self._address = parse_address(url)
        self._plugin = plugin_of(url)
        self._timeout = timeout
        self._known = self._list(open_timeout)

    def info(self, control: int) -> ControlInfo | None:
        """What the control takes, None if the camera has none such; as listed at opening."""
        entry = self._known.get(control)
        if entry is None:
            return None
        return ControlInfo(
            name=str(entry.get("name", "")),
            minimum=_number(entry, "min"),
            maximum=_number(entry, "max"),
            step=_number(entry, "step"),
            default=_number(entry, "default"),
        )

    def read(self, *controls: int) -> dict[int, int]:
        """Their values, all out of one list."""
        listed = self._list(self._timeout)
        missing = [control for control in controls if control not in listed]
        if missing:
            raise DeviceError(f"{self._where} has no control {missing[0]:#010x} any more: restart its server")
        return {control: _number(listed[control], "value") for control in controls}

    def write(self, control: int, value: int) -> None:
        """Set a control."""
        group = self._known.get(control, {}).get("group", _V4L2_GROUP)
        target = (
            f"/?action=command&dest=0&plugin={self._plugin}&id={control}&group={int(group)}&value={value}"
        )
        fetch(self._at(target), self._timeout)

    def close(self) -> None:
        """Nothing is held open between exchanges."""

    @property
    def _where(self) -> str:
        return f"http://{self._address.host}:{self._address.port}"

    def _at(self, target: str) -> Address:
        return replace(self._address, target=target)

    def _list(self, timeout: float) -> dict[int, dict[str, Any]]:
        return parse_list(fetch(self._at(f"/input_{self._plugin}.json"), timeout), self._where)


def parse_list(document: bytes, where: str) -> dict[int, dict[str, Any]]:
    """Control number -> entry of mjpg-streamer's list, whose numbers come as numbers or as text.

    Raises DeviceError if it is no such list. Entries without usable numbers are left out.
    """
    try:
        entries = json.loads(document)["controls"]
        listed = {int(entry["id"]): entry for entry in entries if _is_usable(entry)}
    except (ValueError, KeyError, TypeError, RecursionError) as error:
        raise DeviceError(f"{where} gives no list of controls: it is no mjpg-streamer") from error
    return listed


def plugin_of(url: str) -> int:
    """Which input a stream's address means.

    >>> plugin_of("http://eye:8080/?action=stream"), plugin_of("http://eye:8080/?action=stream_1")
    (0, 1)
    """
    action = parse_qs(urlsplit(url).query).get("action", [""])[0]
    number = action.rpartition("_")[2] if "_" in action else ""
    return int(number) if number.isascii() and number.isdigit() and len(number) < 4 else 0


def _is_usable(entry: Any) -> bool:
    if not isinstance(entry, dict):
        return False
    try:
        for key in ("id", "min", "max", "step", "default", "value"):
            _number(entry, key)
        int(entry.get("group", _V4L2_GROUP))
    except (ValueError, KeyError, TypeError, OverflowError):
        return False
    return True


def _number(entry: dict[str, Any], key: str) -> int:
    return int(entry[key])
