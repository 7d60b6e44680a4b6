"""Bumper and sonar of the simulated robot: what they feel is what is there."""

from __future__ import annotations

import math

import msgspec
import pytest

from robot.config import Config
from robot.messages import Twist
from robot.run_sim import open_simulated
from robot.sim.scene import load_scene
from robot.sim.world import World


@pytest.fixture
def world():  # type: ignore[no-untyped-def]
    world = World(load_scene("empty"), 1)
    yield world
    world.close()


def driven(world: World, seconds: float, v: float):  # type: ignore[no-untyped-def]
    """Drive straight on; yields what bumper and sonar say each tick."""
    config = Config()
    base = msgspec.structs.replace(config.base, bumper_ports="1", sonar_port="4")
    devices = open_simulated(world, msgspec.structs.replace(config, base=base))
    assert devices.near is not None
    for _ in range(round(seconds / 0.04)):
        world.step()
        devices.base.read(world.now)
        devices.base.send(Twist(v), world.now)
        yield devices.near.read(world.now)
    assert devices.near.faults(world.now) == ()
    devices.near.close()
    devices.base.close()


def test_driving_on_the_sonar_falls_and_the_bumper_is_pressed_at_the_end(world: World) -> None:
    readings = list(driven(world, 40.0, 0.25))
    first = next(reading.distance for reading in readings if reading.distance is not None)
    bumped = next(index for index, reading in enumerate(readings) if reading.bumped)
    at_the_wall = readings[bumped].distance
    assert not any(reading.bumped for reading in readings[: bumped - 5])
    assert at_the_wall is None or at_the_wall < 0.15
    assert first > 0.3
    assert world.touched


def test_the_sonar_measures_to_what_is_ahead(world: World) -> None:
    before = world.robot_pose
    readings = [reading for reading in driven(world, 2.0, 0.2) if reading.distance is not None]
    way = math.hypot(world.robot_pose.x - before.x, world.robot_pose.y - before.y)
    assert readings, "a room has walls within reach, or this scene is the wrong one"
    assert readings[0].distance - readings[-1].distance == pytest.approx(way, abs=0.05)
