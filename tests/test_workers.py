"""Where vision jobs run: simulated latency in lockstep, a thread in real time, errors as data."""

import numpy as np

from robot.clock import MonotonicClock
from robot.messages import HeadPose, Pose2, StereoFrame, View
from robot.workers import Job, SteppedWorker, ThreadWorker

PICTURE = np.zeros((4, 4, 3), np.uint8)
VIEW = View(StereoFrame(PICTURE, PICTURE, 1.0, 1), HeadPose(), Pose2())


def test_lockstep_releases_each_result_after_its_cost():
    worker = SteppedWorker({"a": 0.03, "b": 0.03})
    worker.submit([Job("a", VIEW, lambda view: 1), Job("b", VIEW, lambda view: 2)], now=1.0)
    assert worker.collect(1.02) == []
    assert not worker.idle(1.04)
    assert [result.value for result in worker.collect(1.04)] == [1]
    assert [result.value for result in worker.collect(1.08)] == [2]
    assert worker.idle(1.08)


def test_slow_multiplies_the_latency():
    worker = SteppedWorker({"a": 0.03}, slow=3)
    worker.submit([Job("a", VIEW, lambda view: 1)], now=0.0)
    assert worker.collect(0.08) == []
    assert [result.seconds for result in worker.collect(0.0901)] == [0.09]


def test_an_error_in_a_stage_is_told_not_thrown():
    worker = SteppedWorker({"a": 0.0})
    worker.submit([Job("a", VIEW, lambda view: 1 / 0)], now=0.0)
    (result,) = worker.collect(0.0)
    assert result.error is not None
    assert "ZeroDivisionError" in result.error


def test_the_thread_works_the_same_jobs():
    worker = ThreadWorker(MonotonicClock())
    worker.submit([Job("a", VIEW, lambda view: view.frame.seq), Job("b", VIEW, lambda view: 1 / 0)], now=0.0)
    worker.close()  # joins: everything submitted is done
    results = worker.collect(0.0)
    assert [(result.stage, result.value, result.error is None) for result in results] == [
        ("a", 1, True),
        ("b", None, False),
    ]
    assert worker.idle(0.0)
