"""The one place that imports MuJoCo, with software OpenGL set up before and clear words if it is missing.

`from robot.sim.gl import mujoco` everywhere in this package. Raises `UserError` on import when the package
or a graphics library is missing.
"""

from __future__ import annotations

import os

from robot.errors import UserError

PACKAGES = "libegl1 libegl-mesa0 libgl1-mesa-dri"

# Both are read once, by the first import of MuJoCo and by the first context. One render thread: with more,
# a small picture takes longer and other work on the machine changes the timing.
os.environ.setdefault("MUJOCO_GL", "egl")
os.environ.setdefault("LP_NUM_THREADS", "1")


def missing_graphics(cause: BaseException) -> UserError:
    """The one line to show when OpenGL cannot be reached."""
    return UserError(
        f"the simulator cannot draw without software OpenGL; Debian and Ubuntu: apt-get install {PACKAGES} "
        f"({type(cause).__name__}: {cause})"
    )


try:
    import mujoco
except ModuleNotFoundError as cause:
    raise UserError("the simulator is not installed: pip install 'robot[sim]'") from cause
except (ImportError, OSError, AttributeError, RuntimeError) as cause:
    # PyOpenGL answers a missing libEGL with "NoneType has no attribute ..."
    raise missing_graphics(cause) from cause

__all__ = ["PACKAGES", "missing_graphics", "mujoco"]
