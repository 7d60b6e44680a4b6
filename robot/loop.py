"""The control tick: read -> see -> judge faults -> person -> state -> body -> guard -> act -> publish.

It never waits: vision is asked for and collected, devices return their newest value. Motors are stopped
before an event is sent, for sending runs other code.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from typing import Protocol

from robot import authority, faults
from robot.clock import Clock
from robot.guard import GuardInput, GuardLimits, guard
from robot.hal.interfaces import DriveBase, LampDevice, PanTilt, StereoCamera, TeleopLink
from robot.lamp_control import lamp_level
from robot.messages import (
    Clearance,
    Command,
    Event,
    Fault,
    HeadPose,
    Intent,
    Odometry,
    Percepts,
    Pose2,
    Sent,
    Situation,
    Tick,
    Transition,
    Twist,
    View,
    Want,
)

AUTONOMOUS = ("search", "recognize", "range", "track", "avoid")
