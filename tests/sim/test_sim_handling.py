"""Hands on the simulated robot: what they do to the base, what its wheels feel of it, and that it ends."""

from __future__ import annotations

import math
from collections.abc import Sequence

import numpy as np
import pytest

from robot.messages import Pose2
from robot.sim.handling import KINDS, LIFT_M, QUICK, SLOW, TIP_RAD
from robot.sim.injected import InjectedFault
from robot.sim.scene import parse_scene
from robot.sim.world import TICK_S, World

SCENE = {
    "mirror": False,
    "expect": "not found",
    "room": {"length_m": 4.0, "width_m": 3.0, "height_m": 2.0},
    "robot": {"x": 1.5, "heading_deg": 0.0},
}


def world_with(*faults: InjectedFault, **tables: object) -> World:
    return World(parse_scene({**SCENE, **tables}, "plain"), 5, faults)


def run(world: World, seconds: float) -> list[tuple[float, float, Pose2]]:
    """Height of the base's origin, lean of its upright, place: each tick."""
    track = []
    for _ in range(round(seconds / TICK_S)):
        world.step()
        upright = world.data.xmat[world.model.body("base").id].reshape(3, 3)[:, 2]
        height = float(world.data.qpos[2])
        track.append((height, math.acos(min(float(upright[2]), 1.0)), world.robot_pose))
    return track


def drive(world: World, left: int, right: int) -> None:
    for port, percent in ((1, left), (2, right)):
        world.brick.handle(bytes([0x80, 0x04, port, percent & 0xFF, 0x03, 0, 0, 0x20, 0, 0, 0, 0]))


def tachos(world: World) -> Sequence[float]:
    return [
        float(world.data.qpos[world.model.joint(name).qposadr[0]]) for name in ("wheel_left", "wheel_right")
    ]


def test_a_lifted_base_rises_keeps_its_place_and_is_set_down_again() -> None:
    world = world_with(InjectedFault("base", "lifted", 0.2, 1.0))
    drive(world, 60, 60)
    before = run(world, 0.16)[-1]
    held = run(world, 1.0)
    assert held[-1][0] == pytest.approx(LIFT_M, abs=0.005)
    assert held[-1][1] < math.radians(1.0)
    begun, moved = tachos(world), held[-1][2]
    assert moved.x - before[2].x < 0.03
    run(world, 0.04)
    assert min(np.subtract(tachos(world), begun)) > 0.1, "the wheels turn in the air"
    drive(world, 0, 0)
    down = run(world, 1.2)[-1]
    assert down[0] == pytest.approx(before[0], abs=0.002)
    assert math.dist((down[2].x, down[2].y), (moved.x, moved.y)) < 0.05
    world.close()


def test_a_tipped_base_leans_and_stands_upright_again() -> None:
    world = world_with(InjectedFault("base", "tipped", 0.2, 1.0))
    leans = [lean for _, lean, _ in run(world, 1.2)]
    assert max(leans[:4]) < math.radians(1.0)
    assert leans[-1] == pytest.approx(TIP_RAD, abs=math.radians(1.0))
    assert run(world, 1.0)[-1][1] < math.radians(1.0)
    world.close()


def test_a_pushed_base_goes_aside_turns_and_stays_there_while_its_wheels_stand() -> None:
    world = world_with(InjectedFault("base", "pushed", 0.2))
    track = run(world, 2.0)
    heights = [height for height, _, _ in track]
    assert max(heights) - min(heights) < 0.005, "on the floor"
    end = track[-1][2]
    way = math.hypot(end.x - 1.5, end.y)
    assert way == pytest.approx(QUICK.push * QUICK.push_s, rel=0.15)
    assert end.y > 0.15, "to its left"
    assert end.yaw == pytest.approx(QUICK.push_turn * QUICK.push_s, rel=0.2)
    assert np.abs(tachos(world)).max() * 0.028 < 0.4 * way, "the wheels slide"
    earlier = track[-10][2]
    assert (end.x, end.y, end.yaw) == pytest.approx((earlier.x, earlier.y, earlier.yaw), abs=1e-4)
    world.close()


def test_slow_hands_lift_tip_and_push_as_far_but_slowly() -> None:
    begin, at = 0.2, 1.0
    lifted, tipped, pushed = (
        run(world_with(InjectedFault("base", kind, begin)), begin + at)
        for kind in ("lifted_slowly", "tipped_slowly", "pushed_slowly")
    )
    assert lifted[-1][0] - lifted[0][0] == pytest.approx(SLOW.lift * at, abs=0.006)
    assert tipped[-1][1] == pytest.approx(SLOW.tip * at, abs=math.radians(1.0))
    assert pushed[-1][2].y == pytest.approx(SLOW.push * at, rel=0.2)
    assert max(height for height, _, _ in pushed) < 0.01, "on the floor"


def test_every_way_of_handling_can_be_ordered() -> None:
    for kind in KINDS:
        assert InjectedFault("base", kind, 1.0).active(1.5)


@pytest.mark.parametrize("kind", ["pushed", "pushed_slowly"])
def test_a_wall_holds_a_push_up(kind: str) -> None:
    world = world_with(InjectedFault("base", kind, 0.04), robot={"x": 1.5, "y": 1.28, "heading_deg": 0.0})
    touched: set[str] = set()
    for _ in range(20 if kind == "pushed" else 80):
        height, _, place = run(world, TICK_S)[-1]
        touched |= world.touched
        assert height < 0.02, "it does not climb"
        assert place.y < 1.42, "the wall is at 1.5, and the base reaches 0.08-0.1 to its side"
    assert "room_left" in touched
    world.close()


def test_a_robot_nobody_touches_is_not_changed_by_one_bit() -> None:
    plain, later = world_with(), world_with(InjectedFault("base", "lifted", 50.0))
    for world in (plain, later):
        drive(world, 50, 70)
        run(world, 0.8)
    assert plain.data.qpos.tobytes() == later.data.qpos.tobytes()
    plain.close()
    later.close()


def test_the_same_hands_do_the_same_bit_for_bit() -> None:
    worlds = [world_with(InjectedFault("base", "tipped", 0.1, 0.5)) for _ in range(2)]
    for world in worlds:
        run(world, 1.0)
    assert worlds[0].data.qpos.tobytes() == worlds[1].data.qpos.tobytes()
    for world in worlds:
        world.close()
