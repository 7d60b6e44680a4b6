"""The control tick: who is heard first, what reaches the wheels, and that it stops on any doubt."""

import numpy as np
import pytest

from robot.chart import RobotChart
from robot.clock import SteppedClock
from robot.guard import GuardLimits
from robot.hal.mock import MockBase, MockCamera, MockHead, MockLamp, MockTeleop
from robot.loop import Loop
from robot.loop_interfaces import Devices, LoopSettings
from robot.messages import (
    Clearance,
    Command,
    Event,
    Fault,
    Follow,
    FreeSpace,
    HeadPose,
    Health,
    Intent,
    Near,
    Percepts,
    TeleopInput,
    Timed,
    Twist,
)

NONE = np.zeros(0)
FLOOR = FreeSpace(NONE, NONE, NONE, np.zeros((0, 2)))
DRIVE = Intent(motion=Follow(((0.0, 0.0), (5.0, 0.0))))


class ScriptedPerception:
    """Sees free floor and a good picture, unless told otherwise."""

    def __init__(self):
        self.free = Clearance(1.5, "range")
        self.fault = None
        self.extra = ()
        self.floor_age = 0.05
        self.blind = False
        self.forgotten = 0
        self.downs = 0
        self._at = None

    def submit(self, view, wants, now):
        self._at = view.frame.captured_at

    def collect(self, now):
        if self._at is None or self.blind:
            return Percepts()
        floor = Timed(FLOOR, now - self.floor_age)
        return Percepts(health=Timed(Health(90.0, self.fault), self._at), free_space=floor)

    def faults(self, now):
        return self.extra

    def set_down(self):
        self.downs += 1

    def forget_target(self):
        self.forgotten += 1

    def clearance(self, pose, twist, now):
        return self.free

    def may_turn(self, pose):
        return True


class ScriptedState:
    """Intends to drive; sends the event it was given once."""

    def __init__(self):
        self.event = None
        self.error = None
        self.entered = 0

    def enter(self, situation):
        self.entered += 1

    def step(self, situation):
        if self.error is not None:
            raise self.error
        event, self.event = self.event, None
        return DRIVE, event


class StraightBody:
    def command(self, intent, odometry, blocked_by_unknown, now):
        v = 0.2 if isinstance(intent.motion, Follow) else 0.0
        return Command(Twist(v, 0.0), HeadPose(), 0.0, now + 0.2)


class Bench:
    """A robot of mocks, steppable."""

    def __init__(self, *words, watched=(), near=None):
        picture = np.full((8, 8, 3), 90, np.uint8)
        self.clock = SteppedClock()
        self.camera = MockCamera([(picture, picture)])
        self.base, self.teleop, self.lamp = MockBase(), MockTeleop(words), MockLamp()
        self.head, self.perception = MockHead(), ScriptedPerception()
        names = ("idle", "search", "recognize", "range", "track", "avoid", "teleop", "halted")
        self.states = {name: ScriptedState() for name in names}
        self.chart = RobotChart()
        self.ticks = []
        self.loop = Loop(
            self.clock,
            Devices(self.camera, self.head, self.lamp, self.base, self.teleop, near),
            self.perception,
            self.chart,
            self.states,
            StraightBody(),
            LoopSettings(GuardLimits()),
            [self.ticks.append],
            watched,
        )

    def run(self, ticks=1):
        for _ in range(ticks):
            self.clock.step()
            last = self.loop.tick()
        return last

    def in_state(self, *events):
        self.run()
        for event in events:
            self.states[self.chart.leaf].event = Event(event, "test")
            self.run()
        return self


TRACK = ("armed", "candidate_seen", "target_confirmed", "target_ranged")


def test_a_free_way_is_driven_and_told_to_the_observers():
    bench = Bench().in_state("armed")
    tick = bench.run(20)
    assert tick.sent.twist.v == pytest.approx(0.2)
    assert bench.ticks[-1] is tick
    assert tick.odometry.pose.x > 0.05


def test_every_transition_is_told_with_its_reason_after_the_wheels_were_stopped():
    bench = Bench().in_state("armed")
    bench.run(10)
    bench.states["search"].event = Event("candidate_seen", "something red", {"score": 0.9})
    tick = bench.run()
    (transition,) = tick.transitions
    assert (transition.source, transition.target) == ("search", "recognize")
    assert transition.event.evidence == {"score": 0.9}
    assert bench.states["recognize"].entered == 1
    assert [call.method for call in bench.base.calls if call.now == tick.now].index("stop") == 1, (
        "right after read"
    )


def test_an_obstacle_stops_the_wheels_and_says_so():
    bench = Bench().in_state("armed")
    bench.run(10)
    bench.perception.free = Clearance(0.01, "obstacle")
    tick = bench.run()
    assert tick.sent.twist.is_zero
    assert "obstacle" in tick.sent.limited_by


def test_old_free_space_stops_translation():
    bench = Bench().in_state("armed")
    bench.perception.floor_age = 0.35
    assert bench.run(5).sent.twist.v == 0.0


@pytest.mark.parametrize("kind", ["black", "frozen", "unpaired"])
def test_a_bad_picture_stops_the_robot_and_track_is_never_taken_up_again_stale(kind):
    bench = Bench().in_state(*TRACK)
    bench.run(10)
    bench.perception.fault = kind
    tick = bench.run()
    assert tick.sent.twist.is_zero
    assert tick.state == "recognize"
    assert bench.perception.forgotten
    bench.run(10)
    assert bench.base.read(bench.clock.now()).twist.is_zero
    bench.perception.fault = None
    assert bench.run().state == "recognize"


def test_swapped_eyes_halt_until_a_person_acknowledges():
    bench = Bench().in_state(*TRACK)
    bench.perception.fault = "swapped"
    assert bench.run().state == "halted"
    bench.perception.fault = None
    assert bench.run(50).state == "halted"
    bench.teleop.say(TeleopInput(at=bench.clock.now(), release=True))
    assert bench.run(2).state == "idle"


def test_a_camera_that_shows_nothing_new_is_a_fault():
    bench = Bench().in_state("armed")
    bench.camera.fail("latest", "link")
    tick = bench.run(20)
    assert {"camera.link", "camera.stale"} <= {fault.key for fault in tick.faults}
    assert tick.sent.twist.is_zero


def test_no_picture_at_all_is_a_fault_after_half_a_second():
    bench = Bench()
    bench.perception.blind = True
    assert bench.run(5).faults == ()
    assert [fault.key for fault in bench.run(10).faults] == ["camera.missing"]


def test_a_states_mistake_stops_the_wheels_and_halts():
    bench = Bench().in_state("armed")
    bench.run(10)
    bench.states["search"].error = KeyError("oops")
    tick = bench.run(2)
    assert tick.state == "halted"
    assert any(fault.key == "loop.error" and "oops" in fault.evidence for fault in tick.faults)
    assert tick.sent.twist.is_zero


def test_an_event_the_chart_does_not_know_here_halts_instead_of_ending_the_process():
    bench = Bench().in_state("armed")
    bench.states["search"].event = Event("way_free", "nonsense")
    assert bench.run(2).state == "halted"


def test_carry_on_faults_do_not_stop_the_mission():
    bench = Bench().in_state("armed")
    bench.perception.extra = (Fault("vision", "late", 0.0),)
    tick = bench.run(20)
    assert tick.sent.twist.v == pytest.approx(0.2)
    assert tick.state == "search"


def test_a_person_takes_drives_and_gives_back_by_recognize():
    bench = Bench(
        TeleopInput(at=0.5, take=True),
        TeleopInput(at=0.6, v=0.5),
        TeleopInput(at=0.8, v=0.5),
        TeleopInput(at=1.0, arm=True),
    ).in_state(*TRACK)
    while bench.clock.now() < 0.55:
        tick = bench.run()
    assert tick.state == "teleop"
    assert tick.sent.twist.is_zero
    while bench.clock.now() < 0.9:
        tick = bench.run()
    assert tick.sent.twist.v == pytest.approx(0.125)
    while bench.clock.now() < 1.05:
        tick = bench.run()
    assert tick.state == "recognize"


def test_silence_at_the_stick_stops_and_never_gives_back_to_autonomy():
    bench = Bench(TeleopInput(at=0.5, take=True), TeleopInput(at=0.6, v=1.0)).in_state(*TRACK)
    tick = bench.run(100)
    assert tick.state == "teleop"
    assert tick.sent.twist.is_zero
    assert "teleop.silent" in {fault.key for fault in tick.faults}


def test_a_person_drives_with_dead_cameras_slowly():
    words = [TeleopInput(at=0.1, take=True), *(TeleopInput(at=0.2 + 0.1 * k, v=1.0) for k in range(20))]
    bench = Bench(*words)
    bench.perception.fault = "black"
    tick = bench.run(40)
    assert tick.state == "teleop"
    assert tick.sent.twist.v == pytest.approx(0.08)
    assert "blind" in tick.sent.limited_by


def test_close_stops_the_wheels():
    bench = Bench().in_state("armed")
    bench.run(10)
    bench.loop.close()
    assert bench.base.calls[-1].method == "stop"


def test_an_observer_that_fails_is_told_no_more_and_the_run_goes_on():
    bench = Bench().in_state("armed")
    told = []

    def watch(tick):
        told.append(tick.now)
        raise ValueError("NaN in the evidence")

    bench.loop._observers.append(watch)
    tick = bench.run(20)
    assert len(told) == 1
    assert tick.sent.twist.v == pytest.approx(0.2)
    assert {"recorder.error"} == {fault.key for fault in tick.faults}


def test_what_is_watched_beside_the_devices_is_told_as_a_fault():
    bench = Bench(watched=[lambda now: (Fault("recorder", "full", now),)])
    assert [fault.key for fault in bench.run(2).faults] == ["recorder.full"]
    assert bench.run(2).state == "idle"


# ------------------------------------------------------------- a person and broken eyes, late ticks


@pytest.mark.parametrize("kind", ["black", "swapped", "size"])
def test_a_person_drives_on_blind_when_the_cameras_are_dead(kind):
    bench = Bench().in_state("armed")
    bench.perception.fault = kind
    bench.run(3)
    bench.teleop.say(TeleopInput(at=bench.clock.now() + 0.04, take=True))
    assert bench.run(2).state == "teleop"
    for _ in range(10):
        bench.teleop.say(TeleopInput(at=bench.clock.now() + 0.04, v=1.0))
        tick = bench.run()
    assert tick.state == "teleop"
    assert tick.sent.twist.v == pytest.approx(0.08)
    assert "blind" in tick.sent.limited_by
    assert any("you drive" in line and f"camera.{kind}" in line for line in bench.teleop.lines)


def test_a_broken_teleop_link_stops_and_never_gives_back_to_autonomy():
    bench = Bench().in_state("armed")
    bench.teleop.say(TeleopInput(at=bench.clock.now() + 0.04, take=True, kind="keys"))
    assert bench.run(2).state == "teleop"
    bench.teleop.say(TeleopInput(at=bench.clock.now() + 0.04, v=1.0, kind="keys"))
    assert bench.run(2).sent.twist.v > 0.0
    bench.teleop.fail("latest", "link")
    tick = bench.run(2)
    assert tick.sent.twist.is_zero
    assert {"teleop.silent", "teleop.link"} <= {fault.key for fault in tick.faults}
    assert bench.run(200).state == "teleop"


def test_a_person_may_say_stop_while_driving_and_must_let_go_first():
    bench = Bench().in_state("armed")
    bench.teleop.say(TeleopInput(at=bench.clock.now() + 0.04, take=True))
    bench.run(2)

    def say(ticks, **word):
        for _ in range(ticks):
            bench.teleop.say(TeleopInput(at=bench.clock.now() + 0.04, **word))
            tick = bench.run()
        return tick.sent.twist.v

    assert say(5, v=1.0) > 0.0
    assert say(1, v=1.0, stop=True) == 0.0
    assert say(5, v=1.0) == 0.0
    assert say(1) == 0.0
    assert say(2, v=1.0) > 0.0


def test_a_base_is_not_said_to_be_moved_while_the_head_is_at_fault():
    bench = Bench().in_state("armed")
    bench.perception.extra = (Fault("base", "moved", 0.1),)
    assert "base.moved" in {fault.key for fault in bench.run().faults}
    bench.head.fail("read", "stuck")
    assert {fault.key for fault in bench.run().faults} == {"head.stuck"}


def test_arming_says_that_the_base_stands_on_the_floor():
    bench = Bench()
    bench.run()
    assert bench.perception.downs == 0
    bench.in_state("armed")
    assert bench.perception.downs == 1


def test_late_ticks_are_told():
    bench = Bench().in_state("armed")
    for _ in range(2):
        bench.clock.step()
        bench.clock.step()
        tick = bench.run()
    assert "loop.late" in {fault.key for fault in tick.faults}
    assert "loop.late" not in {fault.key for fault in bench.run(40).faults}


class ScriptedNear:
    """Bumper and sonar by hand."""

    def __init__(self):
        self.bumped = False

    def read(self, now):
        return Near(now, self.bumped)

    def faults(self, now):
        return ()

    def close(self):
        pass


def test_the_bumper_stops_autonomy_and_lets_a_person_drive_back():
    near = ScriptedNear()
    bench = Bench(near=near).in_state("armed")
    assert bench.run(10).sent.twist.v > 0.0
    near.bumped = True
    tick = bench.run()
    assert tick.sent.twist.is_zero
    assert "near.bump" in {fault.key for fault in tick.faults}
    bench.teleop.say(TeleopInput(at=bench.clock.now() + 0.04, take=True))
    bench.run(2)
    for v, moves in ((1.0, False), (-1.0, True)):
        for _ in range(3):
            bench.teleop.say(TeleopInput(at=bench.clock.now() + 0.04, v=v))
            tick = bench.run()
        assert (tick.sent.twist.v != 0.0) is moves


def test_closing_stops_the_wheels_and_puts_the_lamp_out():
    bench = Bench().in_state("armed")
    bench.run(5)
    bench.loop.close()
    assert bench.base.calls[-1].method == "stop"
    assert bench.lamp.calls[-1].args == (0.0,)


@pytest.mark.parametrize("where", ["body", "submit", "enter"])
def test_a_mistake_anywhere_stands_halted_and_leaves_the_person_the_stick(where):
    bench = Bench().in_state("armed")
    bench.run(5)

    def mistake(*_, **__):
        raise ZeroDivisionError("a mistake")

    if where == "body":
        bench.loop._body.command = mistake
    elif where == "submit":
        bench.perception.submit = mistake
    else:
        bench.states["halted"].enter = mistake
        bench.states["search"].error = ZeroDivisionError("a mistake")
    tick = bench.run(2)
    assert tick.state == "halted"
    assert tick.sent.twist.is_zero
    bench.run(100)
    (error,) = [fault for fault in bench.run().faults if fault.key == "loop.error"]
    assert "a mistake" in error.evidence
    bench.teleop.say(TeleopInput(at=bench.clock.now() + 0.04, take=True))
    assert bench.run(2).state == "teleop"
    for _ in range(5):
        bench.teleop.say(TeleopInput(at=bench.clock.now() + 0.04, v=-1.0))
        tick = bench.run()
    assert tick.sent.twist.v < 0.0


def test_autonomy_is_not_begun_over_a_fault_that_would_end_it_at_once():
    bench = Bench().in_state("armed")
    bench.perception.fault = "size"
    bench.run(2)
    bench.teleop.say(TeleopInput(at=bench.clock.now() + 0.04, take=True))
    assert bench.run(2).state == "teleop"
    bench.teleop.say(TeleopInput(at=bench.clock.now() + 0.04, arm=True))
    assert {bench.run().state for _ in range(5)} == {"teleop"}
