"""A robot that stands where it was put fails every scene, even if it always knows where the target is."""

import pytest

from robot.sim.referee import Claim, Referee
from robot.sim.scene import load_scene, shipped_scenes
from robot.sim.world import World

REACHABLE = [name for name in shipped_scenes() if load_scene(name).expect == "found"]


def outcome_of_standing_still(name, seed):
    world = World(load_scene(name), seed)
    referee = Referee(world)
    try:
        while not referee.done:
            world.step()
            box = referee.true_box(world.moment.seq)
            referee.observe(Claim(world.now, "track", box is not None, box, None, world.moment.seq))
        return referee.report()
    finally:
        world.close()


@pytest.mark.parametrize("name", ["standing", "moving"])
def test_standing_still_fails(name):
    assert not outcome_of_standing_still(name, seed=1)["success"]


@pytest.mark.slow
@pytest.mark.parametrize("name", REACHABLE)
@pytest.mark.parametrize("seed", range(1, 6))
def test_standing_still_fails_with_every_seed(name, seed):
    assert not outcome_of_standing_still(name, seed)["success"]
