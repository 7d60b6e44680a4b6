"""How long a control tick takes, how old percepts are when decided on, and what share of a core vision takes.

The demo runs in lockstep, but each vision stage is charged the wall time it really took here, on one core.
"""

from __future__ import annotations

import sys
import time
from collections.abc import Sequence
from typing import Any

import numpy as np

from bench.report import Bar, arguments, publish
from robot.clock import SteppedClock
from robot.missions import recognizer_for
from robot.run_sim import SimOptions, SimRun
from robot.sim.scene import load_scene
from robot.workers import Job, Result, SteppedWorker, run


class ChargedWorker(SteppedWorker):
    """Like the lockstep worker, but a job costs the wall time it took."""

    def __init__(self) -> None:
        super().__init__({})
        self.wall = 0.0

    def submit(self, jobs: Sequence[Job], now: float) -> None:
        """Run the jobs and charge what they took."""
        at = now
        for job in jobs:
            start = time.perf_counter()
            result = run(job, 0.0)
            seconds = time.perf_counter() - start
            self.wall += seconds
            at += seconds
            self._pending.append((at, Result(result.stage, result.view, result.value, seconds, result.error)))
        self._busy_until = at
