"""What happened, one JSON object a line: byte-identical for the same run.

Every line starts with `t` (seconds of run time) and `kind`; the other keys follow in a fixed order. Floats
have fixed decimals by the meaning of their key, NaN and infinity are refused, and nothing depends on the
wall clock, the machine or a path.
"""

from __future__ import annotations

import json
import math
from collections.abc import Mapping, Sequence
from dataclasses import fields as dataclass_fields
from dataclasses import is_dataclass
from numbers import Integral, Real
from typing import Protocol, TypeAlias

from robot.messages import Box, Event, Fault, Range
from robot.record.recording import Recording

Value: TypeAlias = object
"""str, bool, None, a number, or a mapping, a sequence or a dataclass of such."""

DECIMALS: Mapping[str, int] = {
    "t": 3,
    "since": 3,
    "age": 3,
    "rate_hz": 2,
    "score": 3,
    "confidence": 3,
    "share": 3,
    "load": 3,
    "brightness": 1,
    "box": 1,
    "velocity_px": 2,
    "disparity_px": 2,
}
"""Decimals by key; then by ending (`_s` and `_at` 3, `_px` 1, `_hz` 2, `_ms` 1); everything else, metres and
radians too, has 4."""

_ENDINGS = {"_s": 3, "_at": 3, "_px": 1, "_hz": 2, "_ms": 1}
_DEFAULT_DECIMALS = 4
_OWN_KEYS = ("t",)  # Python itself refuses a second `kind`


class ByteStream(Protocol):
    """Where the lines go: a binary file opened unbuffered, or io.BytesIO."""

    def write(self, data: bytes, /) -> int | None:
        """Write; may take only a part and return how much."""
        ...

    def truncate(self, size: int | None = None, /) -> int:
        """Cut off after `size` bytes."""
        ...


class EventLog:
    """Writes events to a stream until it fails; after that it is silent and `recording` says why.

    A line that did not fit is taken back, so that every line in the file is whole.

    >>> import io
    >>> stream = io.BytesIO()
    >>> log = EventLog(stream)
    >>> log.write("target found", 1.5, distance=0.71, score=0.9)
    >>> stream.getvalue()
    b'{"t":1.500,"kind":"target found","distance":0.7100,"score":0.900}\\n'
    """

    def __init__(self, stream: ByteStream, recording: Recording | None = None) -> None:
        self._stream = stream
        self.recording = recording or Recording()
        self._whole_bytes = 0

    def write(self, kind: str, now: float, **fields: Value) -> None:
        """Write one event at run time `now`; fields keep the order they are given in.

        Raises ValueError for NaN or infinity and for the reserved keys `t` and `kind`, TypeError for values
        JSON cannot hold; nothing is written then. Never raises OSError.
        """
        reserved = [key for key in _OWN_KEYS if key in fields]
        if reserved:
            raise ValueError(f"event field {reserved[0]!r} is taken by the log itself")
        line = encode({"t": float(now), "kind": kind, **fields}).encode() + b"\n"
        if not self.recording.on:
            return
        with self.recording.guarded(now):
            self._write_all(line)
            self._whole_bytes += len(line)
        if not self.recording.on:
            self._take_back()

    def transition(self, now: float, tick: int, from_state: str, to_state: str, event: Event) -> None:
        """The chart went from one state to another because of `event`."""
        self.write(
            "transition",
            now,
            tick=tick,
            **{"from": from_state, "to": to_state},
            event=event.name,
            reason=event.reason,
            evidence=_sorted(event.evidence),
        )

    def fault_raised(self, now: float, fault: Fault) -> None:
        """A device began to have something wrong."""
        self.write("fault raised", now, fault=fault.key, since=fault.since, evidence=fault.evidence)

    def fault_cleared(self, now: float, fault: Fault) -> None:
        """It is well again."""
        self.write("fault cleared", now, fault=fault.key, since=fault.since)

    def governor(self, now: float, rates_hz: Mapping[str, float], reason: str) -> None:
        """The rates of the vision stages were changed."""
        self.write("governor", now, rates_hz=_sorted(rates_hz), reason=reason)

    def limitation_began(self, now: float, limited_by: str) -> None:
        """The guard began to send less than was asked for."""
        self.write("limitation began", now, limited_by=limited_by)

    def limitation_ended(self, now: float, limited_by: str, lasted_s: float) -> None:
        """The guard lets everything pass again, or for another reason."""
        self.write("limitation ended", now, limited_by=limited_by, lasted_s=lasted_s)

    def target_found(self, now: float, label: str, box: Box, score: float, target: Range | None) -> None:
        """A candidate was confirmed to be the target."""
        place: dict[str, Value] = {}
        if target is not None:
            place = {"distance": target.distance, "sigma": target.sigma, "position": target.position}
        self.write("target found", now, label=label, score=score, box=box, **place)

    def target_lost(self, now: float, reason: str, unseen_s: float) -> None:
        """The target is no longer followed."""
        self.write("target lost", now, reason=reason, unseen_s=unseen_s)

    def mission_ended(self, now: float, outcome: str, reason: str) -> None:
        """How the mission came out, e.g. 'done', 'not found', 'failed'."""
        self.write("mission ended", now, outcome=outcome, reason=reason)

    def _write_all(self, line: bytes) -> None:
        while line:  # an unbuffered file may take less than it is given
            taken = self._stream.write(line)
            line = line[len(line) if taken is None else taken :]

    def _take_back(self) -> None:
        try:
            self._stream.truncate(self._whole_bytes)
        except OSError:
            return  # the half line stays; there is nothing left to try


def encode(record: Mapping[str, Value]) -> str:
    """The record as one line of JSON with fixed decimals.

    >>> encode({"t": 0.1, "yaw": -0.00001, "path": ((1, 2.5),)})
    '{"t":0.100,"yaw":0.0000,"path":[[1,2.5000]]}'
    """
    return "{" + ",".join(f"{json.dumps(str(k))}:{_encode(v, str(k))}" for k, v in record.items()) + "}"


def _encode(value: Value, key: str) -> str:
    if value is None or isinstance(value, (str, bool)):
        return json.dumps(value, ensure_ascii=False)
    if isinstance(value, Integral):
        return str(int(value))
    if isinstance(value, Real):
        return _encode_float(float(value), key)
    if isinstance(value, Mapping):
        # Inside a mapping like rates_hz the mapping's own key says what the numbers are.
        inner = [f"{json.dumps(str(k))}:{_encode(v, _meaning(str(k), key))}" for k, v in value.items()]
        return "{" + ",".join(inner) + "}"
    if is_dataclass(value) and not isinstance(value, type):
        return _encode([getattr(value, f.name) for f in dataclass_fields(value)], key)
    if isinstance(value, Sequence) or hasattr(value, "tolist"):
        items = value if isinstance(value, Sequence) else value.tolist()
        if isinstance(items, Sequence):
            return "[" + ",".join(_encode(item, key) for item in items) + "]"
        return _encode(items, key)
    raise TypeError(f"event field {key!r}: {type(value).__name__} cannot be written")


def _encode_float(value: float, key: str) -> str:
    if not math.isfinite(value):
        raise ValueError(
            f"event field {key!r} is {value}: events hold finite numbers only, leave it out instead"
        )
    text = f"{value:.{_decimals(key)}f}"
    return text[1:] if text.startswith("-") and not text.strip("-0.") else text


def _meaning(key: str, outer: str) -> str:
    return outer if _decimals(key) == _DEFAULT_DECIMALS else key


def _decimals(key: str) -> int:
    if key in DECIMALS:
        return DECIMALS[key]
    return next((d for ending, d in _ENDINGS.items() if key.endswith(ending)), _DEFAULT_DECIMALS)


def _sorted(mapping: Mapping[str, Value]) -> dict[str, Value]:
    return {key: mapping[key] for key in sorted(mapping)}
