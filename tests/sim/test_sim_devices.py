"""Simulated head, lamp, cameras, target mover and ordered faults, each by itself."""

from __future__ import annotations

import math

import numpy as np
import pytest

from robot.errors import UserError
from robot.hal.interfaces import LampDevice, PanTilt, StereoCamera
from robot.messages import HeadPose, Image, Pose2, StereoFrame
from robot.sim.cameras import EXPOSURE_LIMITS, EyeEmulation, EyeSettings, SimStereoCamera
from robot.sim.head import SimHead
from robot.sim.injected import KINDS, InjectedFault
from robot.sim.lamp import SimLamp
from robot.sim.layout import Motion, Stop
from robot.sim.mover import KEEP_AWAY_M, Mover

W, H = 352, 288


def moved(head: SimHead, ticks: int, start: float = 0.0) -> SimHead:
    for k in range(1, ticks + 1):
        head.advance(0.04, start + 0.04 * k)
    return head


def test_head_keeps_its_limits_speed_and_accuracy() -> None:
    head = SimHead(np.random.default_rng(3))
    asked = head.send(HeadPose(math.radians(120), math.radians(-40)), 0.0)
    assert (math.degrees(asked.pan), math.degrees(asked.tilt)) == pytest.approx((80.0, -20.0))
    moved(head, 5)
    assert math.radians(25) < head.true_pose.pan < math.radians(200 * 0.2) + 0.01
    moved(head, 20)
    reading = head.read(1.0)
    assert abs(reading.pan - asked.pan) <= math.radians(0.2)
    assert abs(reading.pan - head.true_pose.pan) <= math.radians(0.2)
    assert head.faults(1.0) == ()
    assert isinstance(head, PanTilt)


def test_stuck_head_stays_and_says_so() -> None:
    head = SimHead(np.random.default_rng(3))
    head.break_with(frozenset({"stuck"}), 0.0)
    head.send(HeadPose(0.5, 0.0), 0.0)
    moved(head, 25)
    assert head.read(1.0).pan == pytest.approx(0.0, abs=math.radians(0.2))
    assert [f.key for f in head.faults(1.0)] == ["head.stuck"]
    head.break_with(frozenset(), 0.0)
    moved(head, 25, 1.0)
    assert head.faults(2.0) == ()


def test_lamp_and_dead_lamp() -> None:
    lamp = SimLamp()
    assert isinstance(lamp, LampDevice)
    assert lamp.send(-1.0, 0.0) == 0.0
    assert lamp.send(0.6, 0.0) == 0.6
    lamp.break_with(frozenset({"dead"}), 0.0)
    assert (lamp.send(1.0, 0.0), lamp.light) == (1.0, 0.0)


def test_a_lamp_that_does_not_answer_keeps_its_level_and_is_told() -> None:
    lamp = SimLamp()
    lamp.send(0.6, 0.0)
    lamp.break_with(frozenset({"link"}), 0.4)
    assert (lamp.send(1.0, 0.4), lamp.light) == (0.6, 0.6)
    (fault,) = lamp.faults(0.8)
    assert (fault.key, fault.since) == ("lamp.link", 0.4)
    lamp.break_with(frozenset(), 1.0)
    assert (lamp.send(1.0, 1.0), lamp.faults(1.0)) == (1.0, ())


def test_a_head_that_does_not_answer_hears_nothing_and_its_reading_is_old() -> None:
    head = moved(SimHead(np.random.default_rng(3)), 5)
    before = head.read(0.2)
    head.send(HeadPose(0.5, 0.0), 0.2)
    head.break_with(frozenset({"link"}), 0.2)
    asked = head.send(HeadPose(-0.5, 0.1), 0.24)
    moved(head, 25, 0.2)
    assert asked == HeadPose(0.5, 0.0), "what it heard last"
    assert head.true_pose.pan == pytest.approx(0.5, abs=0.01), "it goes there all the same"
    assert head.read(1.2) == before
    assert [(f.key, f.since) for f in head.faults(1.2)] == [("head.link", 0.2)]
    head.break_with(frozenset(), 1.2)
    moved(head, 1, 1.2)
    assert head.faults(1.24) == ()
    assert head.read(1.24).pan == pytest.approx(0.5, abs=0.01)


def test_cameras_that_do_not_answer_are_missing_or_give_the_wrong_size() -> None:
    eyes = camera(EyeSettings(dropped=0.0))
    eyes.capture(1, 0.04)
    first = eyes.latest(0.04)
    eyes.break_with(frozenset({"link"}), 0.08)
    eyes.capture(2, 0.08)
    assert eyes.latest(0.08) is first, "the last pair, which grows old"
    assert [(f.key, f.since) for f in eyes.faults(0.2)] == [("camera.link", 0.08)]
    eyes.break_with(frozenset({"missing"}), 0.12)
    eyes.capture(3, 0.12)
    assert eyes.latest(0.12) is None
    assert eyes.faults(0.12) == ()
    eyes.break_with(frozenset({"size"}), 0.16)
    eyes.capture(4, 0.16)
    small = eyes.latest(0.16)
    assert small is not None
    assert small.left.shape == small.right.shape == (H // 2, W // 2, 3)
    eyes.break_with(frozenset(), 0.2)
    eyes.capture(5, 0.2)
    whole = eyes.latest(0.2)
    assert whole is not None
    assert whole.left.shape == (H, W, 3)


def grey(level: int) -> Image:
    return np.full((H, W, 3), level, np.uint8)


def camera(settings: EyeSettings, level: int = 100) -> SimStereoCamera:
    rngs = np.random.default_rng(1), np.random.default_rng(2)
    return SimStereoCamera(lambda skew: (grey(level), grey(level // 2)), W, H, settings, *rngs)


def test_camera_gives_each_ticks_pair_once_and_the_same_bytes_for_the_same_seed() -> None:
    first, second = camera(EyeSettings(dropped=0.0)), camera(EyeSettings(dropped=0.0))
    assert isinstance(first, StereoCamera)
    assert first.latest(0.0) is None
    for eyes in (first, second):
        eyes.capture(1, 0.04)
    a, b = first.latest(0.04), second.latest(0.04)
    assert a is not None
    assert b is not None
    assert (a.seq, a.captured_at) == (1, 0.04)
    assert a.left.tobytes() == b.left.tobytes()
    assert first.latest(0.05) is a
    first.capture(2, 0.08)
    c = first.latest(0.08)
    assert c is not None
    assert c.left.tobytes() != a.left.tobytes()  # the noise is fresh


def test_frames_nobody_asks_for_do_not_change_later_ones() -> None:
    lazy, eager = camera(EyeSettings(dropped=0.0)), camera(EyeSettings(dropped=0.0))
    for seq in range(1, 6):
        lazy.capture(seq, 0.04 * seq)
        eager.capture(seq, 0.04 * seq)
        eager.latest(0.04 * seq)
    a, b = lazy.latest(0.2), eager.latest(0.2)
    assert a is not None
    assert b is not None
    np.testing.assert_array_equal(a.right, b.right)


def test_noise_grows_with_the_exposure_and_darkness_stays_dark() -> None:
    eye = EyeEmulation(W, H, EyeSettings(), np.random.default_rng(1))
    bright, dark = eye.expose(grey(100), 1.0, 1), eye.expose(grey(4), EXPOSURE_LIMITS[1], 1)
    middle = (slice(H // 2 - 20, H // 2 + 20), slice(W // 2 - 20, W // 2 + 20))
    assert 0.8 < bright[middle].std() < 6.0
    assert dark.mean() < 35.0
    assert dark[middle].std() / dark[middle].mean() > 3 * bright[middle].std() / bright[middle].mean()
    assert eye.expose(grey(255), 1.0, 1)[0, 0].mean() < eye.expose(grey(255), 1.0, 1)[middle].mean()


def test_exposure_adapts_slowly() -> None:
    levels = [40]
    rngs = np.random.default_rng(1), np.random.default_rng(2)
    eyes = SimStereoCamera(lambda s: (grey(levels[0]),) * 2, W, H, EyeSettings(dropped=0.0), *rngs)
    exposures = []
    for seq in range(1, 60):
        if seq == 10:
            levels[0] = 160
        eyes.capture(seq, 0.04 * seq)
        eyes.latest(0.04 * seq)
        exposures.append(eyes.exposure)
    assert exposures[0] == pytest.approx(min(105 / 40, EXPOSURE_LIMITS[1]))
    assert exposures[10] > 0.8 * exposures[0]
    assert exposures[-1] == pytest.approx(105 / 160, rel=0.1)


def test_camera_faults() -> None:
    eyes = camera(EyeSettings(dropped=0.0))
    eyes.capture(1, 0.04)
    good = eyes.latest(0.04)
    assert good is not None

    def at(kind: str, seq: int) -> StereoFrame:
        eyes.break_with(frozenset({kind}), 0.04 * seq)
        eyes.capture(seq, 0.04 * seq)
        frame = eyes.latest(0.04 * seq)
        assert frame is not None
        return frame

    frozen = at("frozen", 2)
    assert frozen.left.tobytes() == good.left.tobytes()
    assert frozen.seq == 2
    assert at("black", 3).left.max() == 0
    swapped = at("swapped", 4)
    assert swapped.left.mean() < swapped.right.mean()
    assert at("stale", 5) is swapped
    assert at("unpaired", 6) is swapped
    assert [f.key for f in eyes.faults(0.3)] == ["camera.unpaired"]
    eyes.break_with(frozenset({"dropped"}), 0.4)
    fresh = 0
    for seq in range(10, 60):
        eyes.capture(seq, 0.04 * seq)
        frame = eyes.latest(0.04 * seq)
        fresh += frame is not None and frame.seq == seq
    assert 12 <= fresh <= 38


def test_target_walks_its_stops_rests_and_returns() -> None:
    mover = Mover(
        Pose2(0.0, 0.0), Motion((Stop(1.0, 0.0, 2.0), Stop(0.0, 0.0, 0.0)), speed=0.1, starts_at=1.0)
    )
    far = (9.0, 9.0)
    for k in range(1, 1200):
        mover.advance(0.04, 0.04 * k, far)
        if k == 24:
            assert mover.pose.x == 0.0
        if k == 25 + 290:
            assert mover.pose.x == pytest.approx(1.0)  # at rest for two seconds
        if k == 25 + 251:
            assert mover.pose.x == pytest.approx(1.0)
    assert mover.finished
    assert mover.pose.x == pytest.approx(0.0, abs=1e-9)


def test_target_waits_for_the_robot_and_never_runs_into_it() -> None:
    mover = Mover(Pose2(0.0, 0.0), Motion((Stop(2.0, 0.0, 0.0),), speed=0.1, starts_within=1.5))
    for k in range(100):
        mover.advance(0.04, 0.04 * k, (3.0, 0.0))
    assert mover.pose.x == 0.0
    for k in range(2000):
        mover.advance(0.04, 4 + 0.04 * k, (1.2, 0.0))
    assert mover.pose.x == pytest.approx(1.2 - KEEP_AWAY_M, abs=0.005)


def test_ordered_faults() -> None:
    fault = InjectedFault("base", "stall", 2.0, 1.0)
    assert [fault.active(t) for t in (1.96, 2.0, 2.96, 3.0)] == [False, True, True, False]
    assert InjectedFault("lamp", "dead", 0.0).active(1e6)
    assert set(KINDS) == {"camera", "head", "lamp", "base"}
    for device, kind, at in (("camera", "melted", 1.0), ("toaster", "black", 1.0), ("camera", "black", -1.0)):
        with pytest.raises(UserError, match="fault"):
            InjectedFault(device, kind, at)
