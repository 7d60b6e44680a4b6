"""The world as a whole: pictures, determinism, driving, contacts, faults, and the referee's score."""

from __future__ import annotations

import hashlib
import math
from collections.abc import Iterator
from itertools import islice
from typing import Any

import cv2
import numpy as np
import pytest

from robot.errors import UserError
from robot.messages import Box, HeadPose, Pose2
from robot.sim.injected import InjectedFault
from robot.sim.referee import Claim, Referee
from robot.sim.scene import load_scene, parse_scene
from robot.sim.teaching import studios, views
from robot.sim.world import World


def plain(with_target: bool = True, **tables: Any) -> World:
    """A small room with the robot at (0.8, 0) and, if asked for, the package 1.5 m before it."""
    scene: dict[str, Any] = {
        "mirror": False,
        "room": {"length_m": 4.0, "width_m": 3.0, "height_m": 2.0},
        "robot": {"x": 0.8, "heading_deg": 0.0},
        "camera": {"dropped": 0.0},
        **tables,
    }
    if with_target:
        scene.setdefault("target", {"object": "box", "x": 2.3, "y": 0.0, "heading_deg": 180.0})
    else:
        scene["expect"] = "not found"
    return World(parse_scene(scene, "plain"), 5)


@pytest.fixture(scope="module")
def facing() -> Iterator[World]:
    world = plain()
    for _ in range(3):
        world.step()
    yield world
    world.close()


def power(world: World, left: int, right: int) -> None:
    """Tell the brick: port B and C on at these powers, unregulated, for ever."""
    for port, percent in ((1, left), (2, right)):
        world.brick.handle(bytes([0x80, 0x04, port, percent & 0xFF, 0x03, 0, 0, 0x20, 0, 0, 0, 0]))


def digest(name: str, seed: int, ticks: int = 6) -> str:
    world = World(load_scene(name), seed)
    sum_ = hashlib.sha256()
    power(world, 60, 40)
    world.head.send(HeadPose(0.3, 0.1), 0.0)
    for _ in range(ticks):
        world.step()
        frame = world.camera.latest(world.now)
        assert frame is not None
        sum_.update(frame.left.tobytes() + frame.right.tobytes() + world.data.qpos.tobytes())
    world.close()
    return sum_.hexdigest()


def test_same_seed_same_bytes_other_seed_others() -> None:
    once = digest("moving", 3)
    assert once == digest("moving", 3)
    assert once != digest("moving", 4)


def test_pictures_agree_with_the_rig(facing: World) -> None:
    """Dense stereo gives the depth that a ray gives: focal length, baseline and poses are right."""
    frame = facing.camera.latest(facing.now)
    assert frame is not None
    assert frame.left.shape == frame.right.shape == (288, 352, 3)
    referee = Referee(facing)
    box = referee.true_box(frame.seq)
    assert box is not None
    truth = referee.true_range(frame.seq, box)
    assert truth == pytest.approx(1.5 - 0.05 - 0.08, abs=0.01)
    matcher = cv2.StereoSGBM.create(0, 64, 5, P1=600, P2=2400, uniquenessRatio=5)
    disparity = matcher.compute(frame.left, frame.right).astype(float) / 16
    u, v = (round(c) for c in box.centre)
    measured = float(np.median(disparity[v - 4 : v + 5, u - 4 : u + 5]))
    assert facing.rig.depth(measured) == pytest.approx(truth, rel=0.03)
    assert (disparity[:, 70:] > 0).mean() > 0.85  # walls and floor can be matched
    # The box is where its geometry says: 0.16 m wide, 0.22 m high, its face 1.37 m away.
    assert box.w == pytest.approx(305 * 0.16 / 1.37, rel=0.05)
    assert box.h == pytest.approx(305 * 0.22 / 1.37, rel=0.12)


def test_pan_moves_the_picture_to_the_other_side(facing: World) -> None:
    facing.head.send(HeadPose(math.radians(12), math.radians(5)), facing.now)
    for _ in range(15):
        facing.step()
    box = Referee(facing).true_box(facing.moment.seq)
    assert box is not None
    # Looking left moves the target to the right; it hangs on the left eye, 3 cm left of the middle.
    eye = facing.moment.position
    bearing = math.atan2(-eye[1], 2.3 - eye[0]) - math.radians(12)
    assert box.centre[0] == pytest.approx(facing.rig.left.cx - 305 * math.tan(bearing), abs=4.0)
    facing.head.send(HeadPose(), facing.now)


def test_positive_motor_rotation_drives_forward_and_touching_a_wall_is_noticed() -> None:
    world = plain(with_target=False, robot={"x": 3.4, "heading_deg": 0.0})
    power(world, 60, 60)
    for _ in range(15):
        world.step()
    assert world.robot_pose.x > 3.45
    assert abs(world.robot_pose.y) < 0.02
    assert not world.touched
    referee = Referee(world)
    for _ in range(40):
        world.step()
        referee.observe(Claim(world.now, "search", False))
    report = referee.report()
    assert report["collisions"] == 1
    assert report["collided_with"] == "room"
    assert report["success"] is False
    assert report["clearance_min"] == pytest.approx(0.0, abs=0.01)
    world.close()


def test_right_wheel_faster_turns_left() -> None:
    world = plain(with_target=False)
    power(world, -40, 40)
    for _ in range(20):
        world.step()
    assert world.robot_pose.yaw > 0.3
    assert math.hypot(world.robot_pose.x - 0.8, world.robot_pose.y) < 0.03
    world.close()


def test_table_top_is_passed_under_and_its_leg_is_not() -> None:
    table = {"shape": "table", "x": 1.6, "y": 0.0, "length_m": 0.9, "width_m": 0.5, "height_m": 0.5}
    under = plain(with_target=False, obstacles=[table])
    leg = plain(with_target=False, obstacles=[{**table, "y": 0.42}])
    touched = []
    for world in (under, leg):
        power(world, 90, 90)
        hit: set[str] = set()
        for _ in range(60):
            world.step()
            hit |= world.touched
        touched.append({name.split("_")[0] for name in hit})
        world.close()
    assert touched == [set(), {"obstacle0"}]


def test_lamp_lights_the_dark_and_a_dead_one_does_not() -> None:
    means = []
    for faults in ((), (InjectedFault("lamp", "dead", 0.0),)):
        world = World(load_scene("dark"), 2, faults)
        world.lamp.send(1.0, 0.0)
        world.step()
        frame = world.camera.latest(world.now)
        assert frame is not None
        means.append(frame.left.mean())
        world.close()
    assert means[1] < 40
    assert means[0] > 1.8 * means[1]


def test_ordered_faults_begin_and_end() -> None:
    faults = (InjectedFault("base", "link", 0.08, 0.08), InjectedFault("camera", "black", 0.04))
    world = World(load_scene("standing"), 1, faults)
    assert world.brick.handle(b"\x00\x0b") is not None
    world.step()
    frame = world.camera.latest(world.now)
    assert frame is not None
    assert frame.left.max() == 0
    world.step()
    with pytest.raises(ConnectionError):
        world.brick.handle(b"\x00\x0b")
    world.step()
    world.step()
    assert world.brick.handle(b"\x00\x0b") is not None
    world.close()


def test_bad_seed_is_told() -> None:
    with pytest.raises(UserError, match="seed"):
        World(load_scene("standing"), -1)


# ---------------------------------------------------------------------------------------------- referee


def true_claim(world: World, referee: Referee, error: float = 0.0) -> Claim:
    seq = world.moment.seq
    box = referee.true_box(seq)
    if box is None:
        return Claim(world.now, "search", False)
    distance = referee.true_range(seq, box)
    assert distance is not None
    return Claim(world.now, "track", True, box, distance * (1 + error), seq)


def test_a_robot_at_the_set_distance_that_tells_the_truth_succeeds() -> None:
    beyond_eyes = 0.7 + 0.05
    target = {"object": "box", "x": 0.8 + 0.08 + beyond_eyes, "y": 0.0, "heading_deg": 180.0}
    world = plain(target=target, hold_s=1.0)
    world.head.send(HeadPose(0.0, math.radians(8)), 0.0)
    referee = Referee(world)
    while not referee.done:
        world.step()
        referee.observe(true_claim(world, referee, error=0.02))
    report = referee.report()
    assert report["success"] is True
    assert world.now < 2.0
    assert report["range_error_median"] == pytest.approx(0.02, abs=1e-6)
    assert (report["in_view"], report["at_distance"]) == (1.0, 1.0)
    assert (report["collisions"], report["false_detections"]) == (0, 0)
    assert report["spl"] == 1.0
    world.close()


def test_standing_still_too_far_away_fails() -> None:
    world = plain(duration_s=1.0, hold_s=0.4)
    referee = Referee(world)
    while not referee.done:
        world.step()
        referee.observe(true_claim(world, referee))
    report = referee.report()
    assert report["success"] is False
    assert "distance" in str(report["reason"])
    assert report["found_s"] == 0.04
    assert report["in_view"] == 1.0
    world.close()


def test_a_box_beside_the_target_is_one_false_detection_per_episode(facing: World) -> None:
    referee = Referee(facing)
    wrong = Box(5.0, 5.0, 30.0, 40.0)
    for claims in (True, True, False, True):
        facing.step()
        referee.observe(Claim(facing.now, "track", claims, wrong if claims else None, 1.0, facing.moment.seq))
    report = referee.report()
    assert report["false_detections"] == 2
    assert report["found_s"] is None
    assert report["range_samples"] == 0


def test_an_empty_room_wants_not_found_and_no_claim() -> None:
    verdicts: list[object] = []
    for claim in (False, True):
        world = plain(with_target=False)
        referee = Referee(world)
        world.step()
        if claim:
            referee.observe(Claim(world.now, "track", True, Box(9, 9, 30, 40), 1.0, world.moment.seq))
            world.step()
        assert not referee.done
        referee.observe(Claim(world.now, "search", False, gave_up=True))
        assert referee.done
        verdicts.append(referee.report()["success"])
        world.close()
    assert verdicts == [True, False]


def test_what_hides_the_target_hides_it_from_the_referee() -> None:
    block = {"shape": "block", "x": 1.6, "y": 0.0, "length_m": 0.8, "height_m": 0.6}
    world = plain(obstacles=[block])
    referee = Referee(world)
    assert referee.true_box(world.moment.seq) is None
    in_front = referee.true_range(world.moment.seq, Box(171, 139, 10, 10))
    assert in_front == pytest.approx(1.6 - 0.15 - 0.88, abs=0.01)
    report = referee.report()
    assert report["detour_needed"] is True
    assert report["detour_taken"] is False
    scenery = referee.scenery()
    assert [t.kind for t in scenery.things] == ["block"]
    assert scenery.room[2] == (4.0, 1.5)
    world.close()


def test_past_frames_are_judged_by_the_truth_of_their_own_moment(facing: World) -> None:
    referee = Referee(facing)
    seq = facing.moment.seq
    box = referee.true_box(seq)
    assert box is not None
    before = referee.true_range(seq, box)
    target = facing.target_pose
    assert target is not None
    facing.place_target(target.x + 0.5, target.y + 0.6, target.yaw + 1.0)
    facing.step()
    assert referee.true_range(seq, box) == pytest.approx(before, abs=1e-6)
    assert referee.true_box(seq) == box
    moved = referee.true_box(facing.moment.seq)
    assert moved is None or moved.iou(box) < 0.3
    facing.place_target(target.x, target.y, target.yaw)
    facing.step()


# --------------------------------------------------------------------------------------------- teaching


@pytest.mark.parametrize("studio", studios())
def test_teaching_views_show_the_target_tightly(studio: str) -> None:
    seen = list(islice(views(studio, 1), 4))
    assert len({round(v.yaw, 3) for v in seen}) == 4
    for view in seen:
        box = view.box
        assert 0.3 < view.depth_m < 2.6
        assert box.x >= 0
        assert box.x + box.w <= 352
        assert box.h > 20
        rows, columns = slice(round(box.y), round(box.y + box.h)), slice(round(box.x), round(box.x + box.w))
        assert view.image_bgr[rows, columns].std() > 18.0  # printed, not plain


def test_teaching_views_are_the_same_for_the_same_seed() -> None:
    first, again = (next(iter(views("teach-box", 1))) for _ in range(2))
    assert first.image_bgr.tobytes() == again.image_bgr.tobytes()
    assert first.box == again.box


def test_poses_compose_as_messages_say() -> None:
    world = plain(with_target=False, robot={"x": 1.0, "y": 0.5, "heading_deg": 90.0})
    assert world.robot_pose.yaw == pytest.approx(math.pi / 2, abs=1e-3)
    eye = world.robot_pose.to_local(world.moment.position[None, :2])[0]
    assert eye == pytest.approx((0.08, 0.03), abs=2e-3)
    assert isinstance(world.robot_pose, Pose2)
    world.close()
