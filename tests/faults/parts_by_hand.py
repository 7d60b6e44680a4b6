"""Devices, eyes, states and a body that do what a test says."""

import numpy as np

from robot.messages import (
    Clearance,
    Command,
    Fault,
    Follow,
    FreeSpace,
    HeadPose,
    Health,
    Intent,
    Near,
    Percepts,
    Timed,
    Twist,
)

CRUISE = Twist(0.2, 0.0)
NONE = np.zeros(0)
FLOOR = FreeSpace(NONE, NONE, NONE, np.zeros((0, 2)))


class Link:
    """The newest word of a person, as a driver would give it."""

    def __init__(self):
        self.word = None
        self.down = False

    def latest(self, now):
        return self.word

    def tell(self, line, now):
        pass

    def faults(self, now):
        return (Fault("teleop", "link", now),) if self.down else ()

    def close(self):
        pass


class Eyes:
    """Perception by hand."""

    def __init__(self):
        self.floor_at = 0.0
        self.floor_frozen = False
        self.free = Clearance(1.5, "range")
        self.picture = None
        self.told = {}

    def submit(self, view, wants, now):
        pass

    def collect(self, now):
        if not self.floor_frozen:
            self.floor_at = now - 0.03
        floor = None if self.floor_at is None else Timed(FLOOR, self.floor_at)
        return Percepts(health=Timed(Health(90.0, self.picture), now - 0.01), free_space=floor)

    def faults(self, now):
        return tuple(self.told.values())

    def forget_target(self):
        pass

    def set_down(self):
        pass

    def clearance(self, pose, twist, now):
        return self.free

    def may_turn(self, pose):
        return True


class Bumper:
    """A bumper by hand."""

    def __init__(self):
        self.bumped = False

    def read(self, now):
        return Near(now, self.bumped)

    def faults(self, now):
        return ()

    def close(self):
        pass


class Driving:
    """An autonomous state that always wants to drive; sends what it is given, raises what it is given."""

    def __init__(self):
        self.event = None
        self.error = None

    def enter(self, situation):
        pass

    def step(self, situation):
        if self.error is not None:
            raise self.error
        event, self.event = self.event, None
        return Intent(motion=Follow(((0.0, 0.0), (5.0, 0.0)))), event


class Body:
    """Cruises; or is out of its mind."""

    def __init__(self):
        self.twist = CRUISE
        self.life = 0.2

    def command(self, intent, odometry, blocked_by_unknown, now):
        twist = self.twist if isinstance(intent.motion, Follow) else Twist()
        return Command(twist, HeadPose(), 0.0, now + self.life)
