"""events.jsonl: fixed decimals and order, no NaN, whole lines, silence on a full disk."""

from __future__ import annotations

import io
import json
import math
import re
from typing import Any

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from robot.messages import Box, Event, Fault, Range
from robot.record.events import EventLog, encode
from robot.record.recording import Recording


class FullDisk(io.BytesIO):
    """Takes so many bytes, in small bites, then raises ENOSPC as a disk does."""

    def __init__(self, room: int) -> None:
        super().__init__()
        self._room = room

    def write(self, data: Any, /) -> int:
        bite = bytes(data)[: min(7, self._room)]
        if not bite:
            raise OSError(28, "No space left on device")
        self._room -= len(bite)
        return super().write(bite)


def _lines(stream: io.BytesIO) -> list[dict[str, Any]]:
    return [json.loads(line) for line in stream.getvalue().splitlines()]


def _write_all_kinds(log: EventLog) -> None:
    log.transition(0.04, 1, "idle", "search", Event("start", "armed", {"b": 2.0, "a": 1}))
    log.target_found(1.2, "cup", Box(10.04, 20, 30, 40), 0.91234, Range(0.71, 0.012, (0.7, 0.1, 0.05), 25.7))
    log.target_found(1.3, "cup", Box(10, 20, 30, 40), 0.9, None)
    log.limitation_began(2.0, "obstacle")
    log.limitation_ended(2.5, "obstacle", 0.5)
    log.governor(3.0, {"track": 12.5, "free_space": 4.2}, "late")
    log.fault_raised(4.0, Fault("camera", "black", 3.96, "mean 1.2"))
    log.fault_cleared(5.0, Fault("camera", "black", 3.96, "mean 1.2"))
    log.target_lost(6.0, "hidden", 0.8)
    log.mission_ended(7.0, "done", "held the distance for 4 s")


def test_every_kind_line_by_line() -> None:
    stream = io.BytesIO()
    _write_all_kinds(EventLog(stream))
    assert stream.getvalue().decode().splitlines() == [
        '{"t":0.040,"kind":"transition","tick":1,"from":"idle","to":"search","event":"start",'
        '"reason":"armed","evidence":{"a":1,"b":2.0000}}',
        '{"t":1.200,"kind":"target found","label":"cup","score":0.912,"box":[10.0,20,30,40],'
        '"distance":0.7100,"sigma":0.0120,"position":[0.7000,0.1000,0.0500]}',
        '{"t":1.300,"kind":"target found","label":"cup","score":0.900,"box":[10,20,30,40]}',
        '{"t":2.000,"kind":"limitation began","limited_by":"obstacle"}',
        '{"t":2.500,"kind":"limitation ended","limited_by":"obstacle","lasted_s":0.500}',
        '{"t":3.000,"kind":"governor","rates_hz":{"free_space":4.20,"track":12.50},"reason":"late"}',
        '{"t":4.000,"kind":"fault raised","fault":"camera.black","since":3.960,"evidence":"mean 1.2"}',
        '{"t":5.000,"kind":"fault cleared","fault":"camera.black","since":3.960}',
        '{"t":6.000,"kind":"target lost","reason":"hidden","unseen_s":0.800}',
        '{"t":7.000,"kind":"mission ended","outcome":"done","reason":"held the distance for 4 s"}',
    ]


def test_the_order_evidence_was_collected_in_does_not_matter() -> None:
    streams = io.BytesIO(), io.BytesIO()
    for stream, evidence in zip(streams, ({"a": 1.0, "b": 2.0}, {"b": 2.0, "a": 1.0}), strict=True):
        EventLog(stream).transition(1.0, 2, "a", "b", Event("e", "r", evidence))
    assert streams[0].getvalue() == streams[1].getvalue()


@pytest.mark.parametrize("bad", [math.nan, math.inf, -math.inf, np.float32("nan")])
def test_nan_is_refused_by_name_and_nothing_is_written(bad: float) -> None:
    stream = io.BytesIO()
    log = EventLog(stream)
    with pytest.raises(ValueError, match="'distance'"):
        log.write("x", 1.0, distance=bad)
    with pytest.raises(ValueError, match="'box'"):
        log.write("x", 1.0, box=Box(0, bad, 1, 1))
    with pytest.raises(ValueError, match="'t'"):
        log.write("x", bad)
    assert stream.getvalue() == b""


def test_the_reserved_keys_and_foreign_types_are_refused() -> None:
    log = EventLog(io.BytesIO())
    with pytest.raises(ValueError, match="'t'"):
        log.write("x", 1.0, t=2.0)
    with pytest.raises(TypeError, match="'place'"):
        log.write("x", 1.0, place=object())


def test_decimals_follow_the_meaning_of_the_key() -> None:
    record = {
        "t": 1.0,
        "age": 0.1,
        "lasted_s": 0.1,
        "x_px": 0.1,
        "rate_hz": 1.0,
        "yaw": 1.0,
        "n": 3,
        "ok": True,
    }
    assert encode(record) == (
        '{"t":1.000,"age":0.100,"lasted_s":0.100,"x_px":0.1,"rate_hz":1.00,"yaw":1.0000,"n":3,"ok":true}'
    )


def test_numpy_numbers_are_written_like_pythons_own() -> None:
    numpy = {"a": np.float64(0.5), "b": np.int64(3), "c": np.array([1.5, 2.5]), "d": np.float32(0.25)}
    plain = {"a": 0.5, "b": 3, "c": [1.5, 2.5], "d": 0.25}
    assert encode(numpy) == encode(plain)


@given(value=st.floats(-1e6, 1e6))
@settings(deadline=None, max_examples=100)
def test_a_float_keeps_four_decimals_and_never_reads_minus_zero(value: float) -> None:
    line = encode({"x": value})
    number = line[len('{"x":') : -1]
    assert re.fullmatch(r"-?\d+\.\d{4}", number)
    assert number != "-0.0000"
    assert float(number) == pytest.approx(value, abs=5.1e-5)


@given(
    fields=st.dictionaries(
        st.text(min_size=1, max_size=8),
        st.one_of(
            st.text(),
            st.integers(),
            st.booleans(),
            st.none(),
            st.floats(allow_nan=False, allow_infinity=False),
        ),
        max_size=5,
    )
)
@settings(deadline=None, max_examples=60)
def test_every_line_is_json_on_one_line(fields: dict[str, Any]) -> None:
    line = encode(fields)
    assert "\n" not in line
    assert set(json.loads(line)) == set(fields)


@pytest.mark.parametrize("room", [0, 1, 40, 200, 333, 500])
def test_a_full_disk_ends_the_log_after_a_whole_line_and_raises_nothing(room: int) -> None:
    stream = FullDisk(room)
    log = EventLog(stream)
    for tick in range(20):
        log.write("status", tick * 0.04, state="search", x=1.0)
    written = _lines(stream)
    line = b'{"t":0.000,"kind":"status","state":"search","x":1.0000}\n'
    assert len(written) == room // len(line)
    assert log.recording.stopped is not None
    assert log.recording.stopped.at == pytest.approx(0.04 * len(written))
    assert "space" in log.recording.stopped.reason
    assert log.recording.summary() == {
        "recording_stopped_at": round(0.04 * len(written), 3),
        "recording_stopped_reason": "No space left on device",
    }


def test_once_off_the_log_stays_off_but_still_refuses_nan() -> None:
    recording = Recording()
    recording.stop(1.0, "first")
    recording.stop(2.0, "second")
    stream = io.BytesIO()
    log = EventLog(stream, recording)
    log.write("x", 3.0)
    assert stream.getvalue() == b""
    assert recording.stopped is not None
    assert (recording.stopped.at, recording.stopped.reason) == (1.0, "first")
    with pytest.raises(ValueError, match="finite"):
        log.write("x", 3.0, y=math.nan)


def test_only_os_errors_are_kept_from_the_run() -> None:
    recording = Recording()
    with pytest.raises(KeyError), recording.guarded(1.0):
        raise KeyError("a bug")
    assert recording.on
    assert recording.summary() == {}
