"""Ticks of a real-time run: never faster than they should be, in step with the pictures."""

from __future__ import annotations

import threading
import time
from itertools import pairwise

import pytest

from robot.pacing import EARLIEST, LATEST, PERIOD, Pacer


class Time:
    """A time that passes only while somebody waits, and a camera that takes a picture every `interval`."""

    def __init__(self, monkeypatch: pytest.MonkeyPatch, interval: float) -> None:
        self.now = 0.0
        self.interval = interval
        self.ticks: list[float] = []
        self._taken = 0.0
        monkeypatch.setattr(time, "monotonic", lambda: self.now)

    def wait(self, seconds: float) -> None:
        self.now += max(0.0, seconds)

    def is_set(self) -> bool:
        return False

    def wait_for_picture(self, timeout: float) -> bool:
        following = self._taken + self.interval
        self.wait(min(max(0.0, following - self.now), timeout))
        if self.now < following - 1e-9:
            return False
        self._taken = following + self.interval * ((self.now - following + 1e-9) // self.interval)
        return True

    def gaps(self, pacer: Pacer, ticks: int, work: float = 0.003) -> list[float]:
        begun = []
        for _ in range(ticks):
            begun.append(self.now)
            self.now += work
            pacer.pause()
        return [b - a for a, b in pairwise(begun)]


def test_without_a_camera_to_wait_for_ticks_come_at_an_even_rate(monkeypatch: pytest.MonkeyPatch) -> None:
    world = Time(monkeypatch, 0.04)
    gaps = world.gaps(Pacer(world), 50)  # type: ignore[arg-type]
    assert gaps == pytest.approx([PERIOD] * len(gaps))


@pytest.mark.parametrize("interval", [0.0385, 0.04, 0.0415])
def test_ticks_lock_to_the_pictures(monkeypatch: pytest.MonkeyPatch, interval: float) -> None:
    world = Time(monkeypatch, interval)
    gaps = world.gaps(Pacer(world, world.wait_for_picture), 60)  # type: ignore[arg-type]
    assert gaps[20:] == pytest.approx([interval] * len(gaps[20:]), abs=1e-6)


@pytest.mark.parametrize("interval", [0.005, 0.016, 0.033, 0.066, 0.1, 9.0])
def test_whatever_the_camera_does_ticks_come_neither_too_fast_nor_too_late(
    monkeypatch: pytest.MonkeyPatch, interval: float
) -> None:
    world = Time(monkeypatch, interval)
    gaps = world.gaps(Pacer(world, world.wait_for_picture), 200)  # type: ignore[arg-type]
    assert min(gaps) >= EARLIEST * PERIOD - 1e-9
    assert max(gaps) <= LATEST * PERIOD + 1e-9


def test_a_camera_whose_wait_returns_at_once_does_not_make_it_spin(monkeypatch: pytest.MonkeyPatch) -> None:
    world = Time(monkeypatch, 0.04)
    gaps = world.gaps(Pacer(world, lambda timeout: False), 50)  # type: ignore[arg-type]
    assert min(gaps) >= LATEST * PERIOD - 1e-9


def test_it_ends_at_once_when_told_to_stop() -> None:
    stop = threading.Event()
    stop.set()
    begun = time.monotonic()
    Pacer(stop, lambda timeout: pytest.fail("waited for a picture")).pause()
    assert time.monotonic() - begun < 0.02
