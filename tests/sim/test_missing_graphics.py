"""Without software OpenGL one line says which packages to install, and the exit code is 2."""

import os
import subprocess
import sys

import pytest

DRAW_ONCE = """
from robot.errors import UserError
try:
    from robot.sim.scene import load_scene
    from robot.sim.world import World
    world = World(load_scene("standing"), 1)
    world.step()
    world.camera.latest(world.now).left
except UserError as error:
    print(error)
    raise SystemExit(2)
"""


@pytest.mark.parametrize(
    "missing",
    [{"__EGL_VENDOR_LIBRARY_DIRS": "/nonexistent"}, {"MUJOCO_GL": "osmesa"}],
    ids=["no driver", "no library"],
)
def test_the_packages_to_install_are_named(missing):
    ended = subprocess.run(
        [sys.executable, "-c", DRAW_ONCE],
        env=os.environ | missing,
        capture_output=True,
        text=True,
        timeout=60,
    )
    if "MUJOCO_GL" in missing and ended.returncode == 0:
        return  # this machine has that library too
    assert ended.returncode == 2, ended.stderr
    assert ended.stdout.count("\n") == 1
    assert "apt-get install libegl1 libegl-mesa0 libgl1-mesa-dri" in ended.stdout
