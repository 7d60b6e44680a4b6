"""`python -m robot.sim.wire FD...`: the world's process, started by `robot.sim.wire.launch`."""

from __future__ import annotations

import sys
from multiprocessing.connection import Connection

from robot.sim.wire.process import serve

if __name__ == "__main__":
    serve([Connection(int(descriptor)) for descriptor in sys.argv[1:]])
