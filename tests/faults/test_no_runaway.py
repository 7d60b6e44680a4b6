"""No path through chart, guard, authority and loop on which the robot moves when it must not.

Hypothesis says, breaks, mends and lets time pass in any order; after every tick the rules are checked that
hold whatever happened. Words come as the drivers give them: stamped with the tick they were heard in.
"""

import math
from dataclasses import replace

import hypothesis.strategies as st
import pytest
from hypothesis import HealthCheck, settings
from hypothesis.stateful import RuleBasedStateMachine, initialize, precondition, rule
from parts_by_hand import CRUISE, Body, Bumper, Driving, Eyes, Link

from bench.fault_eyes import textured_pairs
from bench.fault_parts import BenchClock, SteppedWorker
from robot import faults
from robot.authority import NEUTRAL
from robot.chart import AUTONOMOUS, RobotChart
from robot.faults import TABLE, Action
from robot.guard import GuardLimits
from robot.hal.kinematics import limited
from robot.hal.mock import MockBase, MockCamera, MockHead, MockLamp
from robot.hal.mock.base import DEFAULT_LIMITS, DEFAULT_WHEELS
from robot.hal.threaded import ThreadedBase
from robot.loop import Loop
from robot.loop_interfaces import Devices, LoopSettings
from robot.messages import Clearance, Event, Fault, TeleopInput, Twist
from robot.states.behaviour import Behaviour
from robot.states.halted import Halted
from robot.states.idle import Idle
from robot.states.teleop import Teleop

STEP_MS = 20
PULSE_S = 0.3
ROLLS_S = 1e-6
EVENTS = ("armed", "candidate_seen", "candidate_rejected", "target_confirmed", "target_ranged", "target_lost",
          "way_blocked", "way_free", "given_up", "disarmed", "interrupted", "nonsense")  # fmt: skip
NEXT = {
    "search": "candidate_seen",
    "recognize": "target_confirmed",
    "range": "target_ranged",
    "track": "way_blocked",
    "avoid": "way_free",
}
PERSONAL = {"armed": "arm", "teleop_taken": "take", "teleop_released": "release", "teleop_resumed": "arm"}
ASKS = ("", "", "", "take", "release", "stop", "arm", "take arm", "stop take", "release arm")
FLOORS = ("free", "nothing", "no more", "wall", "near", "unknown")


class AnyPath(RuleBasedStateMachine):
    """Everything that may happen to the robot."""

    @initialize(threaded=st.booleans(), errors=st.sampled_from([False, False, False, True]))
    def build(self, threaded, errors):
        """errors: states make mistakes, which last; without them a run gets further."""
        self.errors = errors
        self.clock = BenchClock()
        self.wheels = MockBase(pulse_s=PULSE_S)
        self.worker = SteppedWorker("base", self.clock) if threaded else None
        base = self.wheels
        if threaded:
            base = ThreadedBase(
                self.wheels, self.worker, lambda t: limited(t, DEFAULT_LIMITS, DEFAULT_WHEELS), 0.2
            )
        self.link, self.eyes, self.near, self.body = Link(), Eyes(), Bumper(), Body()
        self.limits = GuardLimits()
        self.settings = LoopSettings(self.limits, teleop_max_v=0.25, teleop_max_w=math.radians(70.0))
        behaviour = Behaviour()
        own = {"idle": Idle(behaviour), "teleop": Teleop(behaviour), "halted": Halted(behaviour)}
        self.states = own | {name: Driving() for name in AUTONOMOUS}
        devices = Devices(
            MockCamera(textured_pairs()[:2]), MockHead(), MockLamp(), base, self.link, self.near
        )
        self.loop = Loop(self.clock, devices, self.eyes, RobotChart(), self.states, self.body, self.settings)
        self.next_word = None
        self.leaf = "idle"
        self.stop_holds = False
        self.tick()

    # ------------------------------------------------------------------------------------- what happens

    @rule(ticks=st.integers(1, 12))
    def time_passes(self, ticks):
        for _ in range(ticks):
            self.tick()

    def they_go_on(self, ticks):
        """Time passes, and a person who drives goes on saying so."""
        for _ in range(ticks):
            if self.leaf == "teleop":
                self.next_word = TeleopInput(at=0.0, v=1.0, w=0.5)
            self.tick()

    @rule(milliseconds=st.sampled_from([60, 100, 200, 260, 500, 3000]))
    def nothing_ticks_for_a_while(self, milliseconds):
        """The process was held up. The wheels may go on for one pulse, no longer."""
        before = self.wheels.read(self.clock.now()).pose
        speed = abs(self.wheels.read(self.clock.now()).twist.v)
        self.pass_time(milliseconds)
        after = self.wheels.read(self.clock.now())
        rolled = math.hypot(after.pose.x - before.x, after.pose.y - before.y)
        assert rolled <= speed * min(PULSE_S, milliseconds / 1000.0) + ROLLS_S, "a command outlived its pulse"
        if milliseconds > 1000 * PULSE_S + STEP_MS:
            assert after.twist.is_zero, "it moves without a tick"
        self.tick()

    @rule(
        v=st.sampled_from([-2.0, -1.0, -0.5, -0.04, 0.0, 0.0, 0.04, 0.5, 1.0, 2.0, math.nan, math.inf]),
        w=st.sampled_from([-1.0, -0.3, 0.3, 1.0]),
        asks=st.sampled_from(
            ["", "", "", "take", "release", "stop", "arm", "take arm", "stop take", "release arm"]
        ),
        kind=st.sampled_from(["frames", "frames", "keys", "mavlink"]),
        ticks=st.integers(1, 6),
    )
    def somebody_speaks(self, v, w, asks, kind, ticks):
        """Moving words turn always (w is not 0): so they are told from what the body wants."""
        words = {ask: True for ask in asks.split()}
        self.next_word = TeleopInput(at=0.0, v=v, w=0.0 if v == 0.0 else w, kind=kind, **words)
        self.time_passes(ticks)

    @rule(ask=st.sampled_from(["take", "arm", "release", "stop"]), kind=st.sampled_from(["frames", "keys"]))
    def somebody_asks_with_neutral_sticks(self, ask, kind):
        self.next_word = TeleopInput(at=0.0, kind=kind, **{ask: True})
        self.tick()

    @rule(
        times=st.integers(2, 8),
        v=st.sampled_from([-1.0, 1.0]),
        kind=st.sampled_from(["frames", "keys", "mavlink"]),
        then=st.sampled_from(["", "silence", "link"]),
    )
    def somebody_drives(self, times, v, kind, then):
        for _ in range(times):
            self.next_word = TeleopInput(at=0.0, v=v, w=0.5, kind=kind)
            self.tick()
        self.link.down = self.link.down or then == "link"
        self.time_passes(15 if then else 0)

    @rule(ticks=st.integers(4, 12), times=st.integers(0, 5))
    def all_is_well_and_a_person_arms(self, ticks, times):
        self.all_is_well()
        for ask in ("release", "release", "arm"):
            self.somebody_asks_with_neutral_sticks(ask, "frames")
        for _ in range(times):
            self.the_mission_goes_on(0)
        self.time_passes(ticks)
        assert self.leaf == "halted" or not self.wheels.read(self.clock.now()).twist.is_zero, (
            "it stands for ever"
        )

    @rule(ticks=st.integers(4, 12), v=st.sampled_from([-1.0, 1.0]))
    def all_is_well_and_a_person_drives(self, ticks, v):
        self.all_is_well()
        self.somebody_asks_with_neutral_sticks("take", "frames")
        self.somebody_drives(ticks, v, "frames", "")
        assert self.leaf == "halted" or not self.wheels.read(self.clock.now()).twist.is_zero, (
            "it stands for ever"
        )

    def all_is_well(self):
        self.eyes.floor_frozen, self.eyes.free = False, Clearance(1.5, "range")
        self.all_faults_clear(ticks=1)
        if self.leaf == "teleop":
            self.somebody_asks_with_neutral_sticks("release", "frames")

    @precondition(lambda self: self.leaf in AUTONOMOUS)
    @rule(ticks=st.integers(0, 10))
    def the_mission_goes_on(self, ticks):
        if self.leaf in AUTONOMOUS:
            self.states[self.leaf].event = Event(NEXT[self.leaf], "on order")
            self.tick()
        self.time_passes(ticks)

    @precondition(lambda self: self.leaf in AUTONOMOUS and self.errors)
    @rule(name=st.sampled_from(EVENTS))
    def a_state_sends_any_event(self, name):
        self.states[self.leaf].event = Event(name, "on order")
        self.time_passes(2)
        for state in AUTONOMOUS:
            self.states[state].event = None

    @precondition(lambda self: self.leaf in AUTONOMOUS and self.errors)
    @rule()
    def a_state_raises(self):
        leaf = self.leaf
        self.states[leaf].error = ZeroDivisionError("on order")
        self.time_passes(2)
        self.states[leaf].error = None

    @rule(key=st.sampled_from([*TABLE, "camera.unheard_of"]), ticks=st.integers(0, 4), passes=st.booleans())
    def a_fault_appears(self, key, ticks, passes):
        self.eyes.told[key] = Fault(*key.split("."), since=self.clock.now())
        self.they_go_on(ticks)
        if passes:
            del self.eyes.told[key]

    @rule(ticks=st.integers(0, 4))
    def all_faults_clear(self, ticks):
        self.eyes.told.clear()
        self.eyes.picture, self.near.bumped, self.link.down = None, False, False
        self.time_passes(ticks)

    @rule(kind=st.sampled_from(["black", "frozen", "size", "swapped"]))
    def a_picture_is_bad(self, kind):
        self.eyes.picture = kind
        self.they_go_on(2)

    @rule(bumped=st.booleans())
    def the_bumper(self, bumped):
        self.near.bumped = bumped
        self.they_go_on(2)

    @rule(down=st.booleans(), ticks=st.integers(1, 20))
    def the_link(self, down, ticks):
        self.link.down = down
        self.time_passes(ticks)

    @precondition(lambda self: self.leaf in AUTONOMOUS)
    @rule(
        v=st.sampled_from([0.2, 0.2, 5.0, math.nan, math.inf, -math.inf]),
        life=st.sampled_from([0.2, 0.2, 0.0, -1.0, math.nan]),
    )
    def the_body_commands(self, v, life):
        self.body.twist, self.body.life = Twist(v, 0.0), life
        self.they_go_on(5)
        self.body.twist, self.body.life = CRUISE, 0.2

    @rule(
        seen=st.sampled_from(FLOORS),
        ticks=st.integers(1, 10),
    )
    def the_floor(self, seen, ticks):
        self.eyes.floor_frozen = seen in ("nothing", "no more")
        if seen == "nothing":
            self.eyes.floor_at = None
        ways = {"wall": Clearance(0.0, "obstacle"), "near": Clearance(0.15, "obstacle"),
                "unknown": Clearance(0.02, "unknown")}  # fmt: skip
        self.eyes.free = ways.get(seen, Clearance(1.5, "range"))
        self.they_go_on(ticks)

    # ------------------------------------------------------------------------------------------ the rules

    def pass_time(self, milliseconds):
        for _ in range(milliseconds // STEP_MS):
            self.clock.advance(STEP_MS)
            if self.worker is not None:
                self.worker.poll()

    def tick(self):
        self.pass_time(40)
        now = self.clock.now()
        word, self.next_word = self.next_word, None
        if word is not None:
            word = self.link.word = replace(word, at=now)
            self.note_stop(word)
        before = self.leaf
        calls = len(self.wheels.calls)
        tick = self.loop.tick()
        self.leaf = tick.state
        self.check_transitions(tick, before, word, self.wheels.calls[calls:])
        self.check_speed(tick, self.wheels.calls[calls:])
        self.check_faults(tick)
        self.check_authority(tick, now)
        if self.stop_holds:
            assert tick.sent.twist.is_zero, "it moves after a stop that nobody lifted"

    def note_stop(self, word):
        """A stop holds until somebody lets go of the sticks, presses a key, or arms."""
        let_go = (abs(word.v) < NEUTRAL and abs(word.w) < NEUTRAL) or word.kind == "keys"
        self.stop_holds = word.stop or (self.stop_holds and not (let_go or word.arm))

    def check_transitions(self, tick, before, word, calls):
        if tick.transitions:
            assert [call.method for call in calls if call.method in ("stop", "send")][:1] == ["stop"]
        here = before
        asked = {name for name in ("take", "release", "arm") if word is not None and getattr(word, name)}
        for transition in tick.transitions:
            assert transition.source == here
            here = transition.target
            need = PERSONAL.get(transition.event.name)
            assert need is None or need in asked, f"{transition.event.name} by itself"
            if transition.source not in AUTONOMOUS and here in AUTONOMOUS:
                assert "arm" in asked, "autonomy began without a person's word"
            if transition.source == "halted":
                assert asked & {"release", "take"}, "a halt ended by itself"
        assert tick.state == here

    def check_speed(self, tick, calls):
        asked = [call.args[0] for call in calls if call.method == "send"]
        for twist in (tick.sent.twist, self.wheels.read(self.clock.now()).twist, *asked):
            assert math.isfinite(twist.v)
            assert math.isfinite(twist.w)
            assert abs(twist.v) <= self.limits.max_speed + 1e-9
            assert abs(twist.w) <= self.limits.max_turn + 1e-9

    def check_faults(self, tick):
        keys = [fault.key for fault in tick.faults]
        worst = faults.worst_action(tick.faults, tick.state)
        if worst >= Action.STOP:
            assert tick.sent.twist.is_zero, f"it moves in spite of {keys}"
        if worst is Action.HALT and not tick.transitions:  # a person's word comes first, for one tick
            assert tick.state == "halted"
        if tick.state in ("idle", "halted"):
            assert tick.sent.twist.is_zero

    def check_authority(self, tick, now):
        sent, floor = tick.sent.twist, tick.percepts.free_space
        blind = floor is None or floor.age(now) > self.limits.free_space_max_age
        if tick.state != "teleop":
            assert sent.w == 0.0, "the person's twist moves the robot in autonomy"
            assert not blind or sent.v == 0.0, "it drives blindly"
            wanted = self.body.twist.v if math.isfinite(self.body.twist.v) and self.body.life > 0.0 else 0.0
            assert 0.0 <= sent.v <= max(wanted, 0.0)
            return
        word = self.link.word
        heard = not self.link.down and now - word.at <= self.settings.teleop_timeout and not word.stop
        v, w = word.v * self.settings.teleop_max_v, word.w * self.settings.teleop_max_w
        if not (heard and math.isfinite(v) and math.isfinite(w)):
            assert sent.is_zero, "the robot moves although nobody says so"
            return
        assert between(sent.v, v), "not what the person said"
        assert between(sent.w, w), "not what the person said"
        if blind or any(faults.row(fault).action >= Action.STOP for fault in tick.faults):
            assert abs(sent.v) <= self.limits.blind_speed + 1e-9


def between(value, limit):
    return min(limit, 0.0) - 1e-12 <= value <= max(limit, 0.0) + 1e-12


AnyPath.TestCase.settings = settings(
    deadline=None,
    max_examples=110,
    report_multiple_bugs=False,
    stateful_step_count=40,
    derandomize=True,
    database=None,
    suppress_health_check=list(HealthCheck),
)
TestAnyPath = AnyPath.TestCase


class LongPaths(AnyPath):
    """The same, much longer."""


LongPaths.TestCase.settings = settings(AnyPath.TestCase.settings, max_examples=1000, stateful_step_count=60)
TestLongPaths = pytest.mark.slow(LongPaths.TestCase)
