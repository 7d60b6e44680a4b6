"""A pan-tilt head inside a camera: UVC's pan and tilt controls."""

from __future__ import annotations

import math
from collections.abc import Callable
from functools import partial
from typing import Final, Protocol

from robot.hal.faultbook import FaultBook
from robot.hal.interfaces import DeviceError
from robot.hal.uvc_axis import ARC_SECONDS, Axis
from robot.hal.webcam.controls import Cid, Controls
from robot.hal.webcam.controls_http import HttpControls
from robot.hal.webcam.controls_v4l2 import V4l2Controls
from robot.hal.webcam.reader import DEFAULT_BACKOFF, Backoff
from robot.messages import Fault, HeadPose

# One lost exchange is no broken link.
_SILENCE_S: Final = 0.35
_EXCHANGE_S: Final = 0.1
_FIRST_EXCHANGE_S: Final = 1.0


class PoseLimits(Protocol):
    """What keeps a pose within the head's range."""

    def applied(self, pose: HeadPose) -> HeadPose:
        """The nearest pose within the limits; finite for any pose."""
        ...


class UvcHead:
    """`PanTilt` over a camera's controls (rules: robot/hal/interfaces.py). Each tick `read` and `send`.

    controls: the camera's; reopen: reaches it again after a failure; limits keep the pose; slew: rad/s at
    which the head is taken to turn where the camera only repeats what was set; rest: where it is sent at
    opening, and where an axis that the camera does not have is taken to be; zoom: value of the zoom control,
    kept fixed (the calibration holds for one zoom), None to leave it.

    A call makes at most one read, or as many writes as axes moved, each bounded by its link (HTTP: 100 ms).
    `send` returns the pose within the limits; the camera rounds it to its step (`read` tells).

    Faults: `link` (no answer for 0.35 s; tried again by itself, 0.5 s to 5 s apart), `stuck` (the angle told
    by the camera does not come nearer to the goal for 0.6 s; one that repeats what was set cannot tell).

    Raises DeviceError if the camera does not answer or has neither pan nor tilt.
    """

    def __init__(
        self,
        controls: Controls,
        limits: PoseLimits,
        slew: float,
        reopen: Callable[[], Controls],
        rest: HeadPose = HeadPose(),
        zoom: int | None = None,
        backoff: Backoff = DEFAULT_BACKOFF,
    ) -> None:
        if not slew > 0:
            raise ValueError(f"slew must be positive, got {slew}")
        self._controls: Controls | None = controls
        self._limits = limits
        self._reopen = reopen
        self._rest = rest
        self._zoom = zoom
        self._backoff = backoff
        self._book = FaultBook("head")
        self._written: dict[int, int] = {}
        self._failures = 0
        self._retry_at = self._read_at = -math.inf
        self._heard_at: float | None = None
        self._closed = False
        try:
            self._axes = _axes(controls, slew)
            self._last = self._pose()
            self._goal = self._reachable(rest)
            self._take_over(controls)
        except DeviceError:
            controls.close()
            raise

    def send(self, pose: HeadPose, now: float) -> HeadPose:
        """Go there; returns the pose after the limits, the old goal while the camera does not answer."""
        controls = self._connected(now)
        if controls is None:
            return self._goal
        wanted = self._reachable(pose)
        try:
            written = self._write(controls, wanted)
        except DeviceError as error:
            self._failed(error, now)
            return self._goal
        if written:
            self._heard(now)
        self._aim(wanted, now)
        return wanted

    def read(self, now: float) -> HeadPose:
        """Where the head is: as the camera tells, or as it should have turned since it was sent."""
        controls = self._connected(now)
        if controls is None or now <= self._read_at:
            return self._last
        try:
            values = controls.read(*self._axes)
        except DeviceError as error:
            self._failed(error, now)
            return self._last
        self._heard(now)
        self._read_at = now
        for control, axis in self._axes.items():
            axis.observe(values[control], now)
        self._watch_stuck(now)
        self._last = self._pose()
        return self._last

    def faults(self, now: float) -> tuple[Fault, ...]:
        """What is wrong."""
        return self._book.open

    def close(self) -> None:
        """Release the camera; the head stays where it is."""
        self._closed = True
        self._let_go()

    # ---------------------------------------------------------------------------------------------- axes

    def _pose(self) -> HeadPose:
        pan, tilt = self._axes.get(Cid.PAN_ABSOLUTE), self._axes.get(Cid.TILT_ABSOLUTE)
        return HeadPose(pan.at if pan else self._rest.pan, tilt.at if tilt else self._rest.tilt)

    def _reachable(self, pose: HeadPose) -> HeadPose:
        pose = self._limits.applied(pose)
        pan, tilt = self._axes.get(Cid.PAN_ABSOLUTE), self._axes.get(Cid.TILT_ABSOLUTE)
        return HeadPose(
            pan.within(pose.pan) if pan else self._rest.pan,
            tilt.within(pose.tilt) if tilt else self._rest.tilt,
        )

    def _write(self, controls: Controls, pose: HeadPose) -> bool:
        """Set what changed; False if nothing had to be set."""
        written = False
        for control, axis in self._axes.items():
            units = axis.units(_angle(pose, control))
            if self._written.get(control) != units:
                self._written.pop(control, None)  # unknown, if the exchange fails
                controls.write(control, units)
                self._written[control] = units
                written = True
        return written

    def _aim(self, pose: HeadPose, now: float) -> None:
        self._goal = pose
        for control, axis in self._axes.items():
            axis.aim(_angle(pose, control), now)

    def _watch_stuck(self, now: float) -> None:
        stuck = [axis.where() for axis in self._axes.values() if axis.is_stuck(now)]
        if stuck:
            self._book.raised("stuck", now, "; ".join(stuck))
        else:
            self._book.cleared("stuck")

    # ---------------------------------------------------------------------------------------------- link

    def _take_over(self, controls: Controls) -> None:
        """Zoom and goal as they shall be, whatever a camera remembers from before."""
        self._written.clear()
        zoom = controls.info(Cid.ZOOM_ABSOLUTE)
        if self._zoom is not None and zoom is not None:
            controls.write(Cid.ZOOM_ABSOLUTE, zoom.fitted(self._zoom))
        self._write(controls, self._goal)
        for control, axis in self._axes.items():
            axis.goal = axis.rounded(_angle(self._goal, control))

    def _connected(self, now: float) -> Controls | None:
        """The controls, if need be after one attempt to reach the camera again."""
        if self._heard_at is None:
            self._heard_at = now
        if self._closed:
            return None
        if self._controls is None and now >= self._retry_at:
            self._try_again(now)
        return self._controls

    def _try_again(self, now: float) -> None:
        try:
            self._controls = self._reopen()
            self._take_over(self._controls)
        except DeviceError as error:
            self._give_up(error, now)
            return
        self._heard(now)

    def _heard(self, now: float) -> None:
        self._heard_at = now
        self._failures = 0
        self._book.cleared("link")

    def _failed(self, error: DeviceError, now: float) -> None:
        assert self._heard_at is not None
        if now - self._heard_at > _SILENCE_S:
            self._give_up(error, now)

    def _give_up(self, error: DeviceError, now: float) -> None:
        self._let_go()
        self._retry_at = now + self._backoff.wait(self._failures)
        self._failures += 1
        for axis in self._axes.values():
            axis.forget()
        self._book.cleared("stuck")
        self._book.raised("link", now, str(error))

    def _let_go(self) -> None:
        controls, self._controls = self._controls, None
        if controls is not None:
            controls.close()


def open_uvc_head(
    device: str, limits: PoseLimits, slew_deg_s: float, rest: HeadPose, zoom: int | None = None
) -> UvcHead:
    """The head behind a device path or an http:// address of mjpg-streamer. Raises DeviceError.

    Opening may take a second, every later exchange 100 ms.
    """
    if device.startswith("http:"):
        controls: Controls = HttpControls(device, _EXCHANGE_S, _FIRST_EXCHANGE_S)
        reopen: Callable[[], Controls] = partial(HttpControls, device, _EXCHANGE_S, _EXCHANGE_S)
    else:
        controls = V4l2Controls(device)
        reopen = partial(V4l2Controls, device)
    return UvcHead(controls, limits, math.radians(slew_deg_s), reopen, rest, zoom)


def _axes(controls: Controls, slew: float) -> dict[int, Axis]:
    """The axes the camera has, by control number, at the angles it tells."""
    names = {int(Cid.PAN_ABSOLUTE): "pan", int(Cid.TILT_ABSOLUTE): "tilt"}
    there = {control: info for control in names if (info := controls.info(control)) is not None}
    if not there:
        raise DeviceError(
            "the camera has neither pan nor tilt: set head.driver = 'none', or name another device"
        )
    values = controls.read(*there)
    return {
        control: Axis(names[control], info, -values[control] / ARC_SECONDS, slew)
        for control, info in there.items()
    }


def _angle(pose: HeadPose, control: int) -> float:
    return pose.pan if control == Cid.PAN_ABSOLUTE else pose.tilt
