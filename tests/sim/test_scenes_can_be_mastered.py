"""Every scored scene can be mastered with the real body: a driver that knows everything does it.

What the robot's own eyes make of a scene is tested elsewhere; here the physics, the scenes and the referee
are: a way that exists on paper is driven by the NXT driver, the emulated brick and MuJoCo's wheels.
"""

from __future__ import annotations

import math

import pytest

from robot.hal.links import MemoryLink
from robot.hal.nxt.base import NxtBase
from robot.hal.nxt.brick import Brick
from robot.messages import HeadPose, Pose2, Twist
from robot.sim.referee import Claim, Referee
from robot.sim.scene import load_scene, shipped_scenes
from robot.sim.ways import MIDDLES_M, Point
from robot.sim.world import World

STAND_OFF = 0.7
REPLAN_TICKS = 50
STRAIGHT_AHEAD = 0.3


class AllKnowingDriver:
    """Drives along the shortest way to the stand-off by true poses, and keeps facing the target."""

    def __init__(self, world: World) -> None:
        self._world = world
        self._base = NxtBase(Brick(MemoryLink(world.brick.handle)))
        self._way: list[Point] = []
        self._age = 0

    def act(self, sees: bool) -> None:
        """One tick's commands to head and wheels."""
        world, now = self._world, self._world.now
        here, target = world.robot_pose, world.target_pose
        assert target is not None
        self._base.read(now)
        bearing = towards(here, (target.x, target.y))
        world.head.send(HeadPose(bearing, math.radians(8)), now)
        distance = math.dist((here.x, here.y), (target.x, target.y))
        if sees and abs(distance - STAND_OFF - MIDDLES_M) < 0.1:
            self._way = []
            twist = Twist(0.0, clip(bearing))
        else:
            twist = self._along_the_way(here, (target.x, target.y))
        self._base.send(twist, now)

    def _along_the_way(self, here: Pose2, target: Point) -> Twist:
        self._age += 1
        if not self._way or self._age > REPLAN_TICKS:
            way = self._world.layout.ways.shortest_way((here.x, here.y), target, STAND_OFF - 0.1)
            self._way, self._age = list(way or ())[1:], 0
        while self._way and math.dist(self._way[0], (here.x, here.y)) < 0.05:
            self._way.pop(0)
        if not self._way:
            return Twist(0.0, clip(towards(here, target)))
        turn = towards(here, self._way[0])
        return Twist(0.2 if abs(turn) < STRAIGHT_AHEAD else 0.0, clip(3.0 * turn))


def towards(here: Pose2, place: Point) -> float:
    """Bearing of a place, positive left."""
    return math.remainder(math.atan2(place[1] - here.y, place[0] - here.x) - here.yaw, math.tau)


def clip(rate: float) -> float:
    """A turning rate within what the base can do."""
    return min(max(rate, -1.2), 1.2)


@pytest.mark.slow
@pytest.mark.parametrize("name", [*(n for n in shipped_scenes() if n != "empty"), "demo"])
def test_a_driver_that_knows_everything_succeeds(name: str) -> None:
    world = World(load_scene(name), 1)
    referee, driver = Referee(world), AllKnowingDriver(world)
    while not referee.done:
        world.step()
        box = referee.true_box(world.moment.seq)
        found = box is not None
        seq = world.moment.seq
        distance = None if box is None else referee.true_range(seq, box)
        referee.observe(Claim(world.now, "track", found, box, distance, seq))
        driver.act(found)
    report = referee.report()
    world.close()
    assert report["success"] is True, report["reason"]
    assert report["collisions"] == 0
    assert report["false_detections"] == 0
    assert report["range_error_median"] == 0.0
    assert isinstance(report["spl"], float)
    assert 0.85 < report["spl"] <= 1.0
    if name in ("post", "step", "hidden", "trap", "demo"):
        assert (report["detour_needed"], report["detour_taken"]) == (True, True)
