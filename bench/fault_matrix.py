"""The fault matrix: every row of the fault table in every state, run and judged in simulated time."""

from __future__ import annotations

import math
from collections.abc import Callable

from bench.fault_cases import Case, Outcome
from bench.fault_rig import STANDS_RAD_S, FaultRobot
from robot.chart import AUTONOMOUS
from robot.faults import Action
from robot.hal.teleop.frames import Button

TICK_S = 0.04
STOP_BAR_S = 0.5
"""From the fault to the stop order, for every row that stops or halts."""
LEAD_S = 0.3
"""The longest pulse the wheels' motors are ever given."""
COASTING_S = 0.3
"""After the lead has run out by itself."""
HOLDING_S = 0.4
"""From a hold until the wheels have swung in: the brick's regulation takes back what they rolled too far."""
ARM_BRAKES_S = 0.3
SLOW_BY_NATURE = frozenset(
    {"camera.swapped", "camera.misrectified", "head.stuck", "base.moved", "base.battery_empty"}
)
"""Rows that stop or halt and may take longer than STOP_BAR_S to notice: their own `detection_s`."""
_SETTLE_S = 0.64
_CARRY_ON_S = 0.4
_PATIENCE_S = 6.0
_HALTED_S = 0.6
_RESUME_S = 0.8
_EPSILON_S = 1e-6
_UNHEARD = frozenset({"teleop.link", "teleop.silent"})
_RESUMES_IN = ("recognize", "search")


def run(case: Case) -> Outcome:
    """Run one case from the robot's start to its recovery."""
    trial = _Trial(case)
    trial.break_it()
    trial.watch()
    trial.mend_it()
    return trial.outcome()


class _Trial:
    """One robot, one fault."""

    def __init__(self, case: Case) -> None:
        self.case = case
        # The driver's own period once; in the other states the same in a fifth of the time.
        battery_period_s = 5.0 if case.state == "search" else 1.0
        self.robot = FaultRobot(case.variant, case.injector.spoilt, battery_period_s)
        self.broken: list[str] = []
        self.begun_at = self.detected_at = math.nan
        self.wheels_moved_at = self.arm_moved_at = -math.inf
        self.orders_before = 0
        self.watched_until = math.nan

    # -------------------------------------------------------------------------------------- the fault

    def break_it(self) -> None:
        """Reach the state, break it, wait until it is noticed."""
        robot, injector = self.robot, self.case.injector
        if injector.spoilt:
            self.begun_at = 0.0
            robot.reach(self.case.state, settle=False)
        else:
            robot.reach(self.case.state)
            if injector.prepare is not None:
                injector.prepare(robot)
                robot.run(injector.prepared_s)
            self._expect(not self.case.drives or robot.wheel_speed > 1.0, "the wheels did not turn before")
            arm_moves = robot.arm_controller.moving or self.case.state not in AUTONOMOUS
            self._expect(arm_moves, "the arm did not move before")
            self.begun_at = robot.now
            injector.begin(robot)
        self.orders_before = len(robot.wire.orders)
        latest = self.begun_at + self.case.row.detection_s + 0.4
        while not self._told and robot.now < latest:
            self._step()
        if self._told:
            self.detected_at = robot.now
        late = self.detected_at - self.begun_at
        self._expect(late <= self.case.row.detection_s + _EPSILON_S, f"noticed after {late:.2f} s")

    def watch(self) -> None:
        """What the table asks for comes to pass, and stays so for a while."""
        self._check_state()
        stops = self.case.action > Action.CARRY_ON
        until = self.robot.now + (_SETTLE_S if stops else _CARRY_ON_S)
        while self.robot.now < until - _EPSILON_S:
            self._step()
            self._check_state()
        self.watched_until = self.robot.now
        if not stops:
            return
        if self.case.drives:
            self._check_wheels()
        else:
            self._expect(not self._driven_since(0.0), "the wheels were told to turn")
        if self.case.key == "base.stranded":
            self._expect(self.robot.pushes, "the jammed wheel does not push: it could have been stopped")
        self._check_arm()

    def _step(self) -> None:
        robot = self.robot
        robot.step()
        if robot.wheel_speed > STANDS_RAD_S:
            self.wheels_moved_at = robot.now
        if any(abs(speed) > 1e-6 for speed in robot.arm_controller.speeds):
            self.arm_moved_at = robot.now

    @property
    def _told(self) -> bool:
        return any(fault.key == self.case.key for fault in self.robot.tick.faults)

    # -------------------------------------------------------------------------------------- its verdicts

    def _expect(self, holds: bool, words: str) -> None:
        if not holds and words not in self.broken:
            self.broken.append(words)

    def _check_state(self) -> None:
        """The state and the twist that the action asks for, this tick."""
        tick, case = self.robot.tick, self.case
        match case.action:
            case Action.HALT:
                self._expect(tick.state == "halted", f"{tick.state} instead of halted")
            case Action.STOP if case.state in AUTONOMOUS:
                self._expect(tick.state in _RESUMES_IN, f"{tick.state} during a stop")
            case _:
                self._expect(tick.state == case.state, f"{tick.state} instead of {case.state}")
        if case.action > Action.CARRY_ON:
            self._expect(tick.sent.twist.is_zero, "a twist was sent after the fault was noticed")
        elif case.person_drives_on:
            blind = self.robot.settings.guard.blind_speed
            self._expect(
                0.02 < abs(tick.sent.twist.v) <= blind + 1e-9, "the person does not drive on blindly"
            )
        elif case.drives:
            self._expect(tick.sent.twist.v > 0.1, "it does not drive on")
            self._expect(self.robot.wheel_speed > 3.0, "the wheels do not turn on")

    def _check_wheels(self) -> None:
        stopped = self.stopped_s
        after = self.begun_at + stopped - self.detected_at
        self._expect(after <= TICK_S + _EPSILON_S, f"stop {after:.2f} s after the fault was noticed")
        self._expect(stopped <= self._stop_bar_s + _EPSILON_S, f"stop {stopped:.2f} s after the fault")
        stand = self.wheels_moved_at - self.begun_at
        rolling = LEAD_S + COASTING_S if self.case.injector.wheels_deaf else stopped + HOLDING_S
        self._expect(stand <= rolling + _EPSILON_S, f"the wheels turn until {stand:.2f} s")
        if not self.case.injector.wheels_deaf:
            self._expect(self._held_since(self.begun_at), "the motors were not held")

    def _check_arm(self) -> None:
        if self.case.state not in AUTONOMOUS or self.case.injector.arm_runs_on:
            return
        stand = self.arm_moved_at - self.begun_at
        self._expect(stand <= self._stop_bar_s + ARM_BRAKES_S, f"the arm moves until {stand:.2f} s")

    @property
    def _stop_bar_s(self) -> float:
        slow = self.case.key in SLOW_BY_NATURE
        return self.case.row.detection_s + TICK_S if slow else STOP_BAR_S

    @property
    def stopped_s(self) -> float:
        """From the fault until the order after which nothing drives the wheels any more.

        That is a hold. Where none can arrive it is the silence after the last drive: the first tick that
        could have renewed it and did not.
        """
        orders = [order for order in self.robot.wire.orders if order.at <= self.watched_until]
        last = max((index for index, order in enumerate(orders) if order.drives), default=-1)
        driven_at = orders[last].at if last >= 0 else -math.inf
        holds_at = [order.at for order in orders[last + 1 :] if order.at > self.begun_at]
        if holds_at and not self.case.injector.wheels_deaf:
            return holds_at[0] - self.begun_at
        return max(driven_at, self.begun_at) + TICK_S - self.begun_at

    def _driven_since(self, at: float) -> bool:
        return any(order.drives and order.at > at for order in self.robot.wire.orders)

    def _held_since(self, at: float) -> bool:
        return any(not order.drives and order.at > at for order in self.robot.wire.orders)

    # -------------------------------------------------------------------------------------- afterwards

    def mend_it(self) -> None:
        """When it is over the robot goes on, or waits for a person, as the table says."""
        case, robot = self.case, self.robot
        if case.injector.end is None or case.row.clears in ("the next start", "the next run"):
            if case.action is Action.HALT:
                self._check_halted()
                self._stays_halted()
            return
        ended_at = robot.now
        case.injector.end(robot)
        over = self._until(lambda: not self._told, _PATIENCE_S)
        self._expect(over, f"still told {robot.now - ended_at:.1f} s after its end")
        if not over:
            return
        if case.action is Action.HALT:
            self._check_halted()
            self._rearm()
        elif case.action is Action.STOP and case.state in (*AUTONOMOUS, "teleop"):
            if case.key in _UNHEARD:
                self._check_let_go_first()
            self._check_resumed(case.state)

    def _check_let_go_first(self) -> None:
        """Whoever was not heard for a while drives again only after having let go."""
        robot = self.robot
        robot.run(_HALTED_S)
        self._expect(robot.tick.sent.twist.is_zero, "a stick that was never let go drives again by itself")
        robot.person.v = 0.0
        robot.run(0.2)
        robot.person.v = 0.8

    def _check_resumed(self, state: str) -> None:
        drives = self._until(lambda: self._turns, _RESUME_S)
        self._expect(drives, f"it does not go on in {self.robot.tick.state}")
        allowed = ("teleop",) if state == "teleop" else _RESUMES_IN
        self._expect(self.robot.tick.state in allowed, f"it went on in {self.robot.tick.state}")

    def _check_halted(self) -> None:
        """A halt outlives its reason."""
        at = self.robot.now
        self.robot.run(_HALTED_S)
        self._expect(self.robot.tick.state == "halted", "the halt ended by itself")
        self._expect(not self._driven_since(at), "the wheels were told to turn while halted")

    def _rearm(self) -> None:
        self._press(Button.RELEASE)
        self._expect(
            self._until(lambda: self.robot.tick.state == "idle", 0.3), "release did not end the halt"
        )
        self._press(Button.GIVE)
        self._check_resumed("search")

    def _stays_halted(self) -> None:
        """What lasts until the next start halts it again at once."""
        at = self.robot.now
        self._press(Button.RELEASE)
        self.robot.run(0.3)
        self._press(Button.GIVE)
        self.robot.run(0.3)
        self._expect(self.robot.tick.state == "halted", f"{self.robot.tick.state}: a lasting fault halts")
        self._expect(not self._driven_since(at), "the wheels were told to turn while halted")

    def _press(self, button: Button) -> None:
        person = self.robot.person
        person.speaking, person.v = True, 0.0
        person.press(button)

    @property
    def _turns(self) -> bool:
        return abs(self.robot.tick.sent.twist.v) > 0.1 and self.robot.wheel_speed > 1.0

    def _until(self, holds: Callable[[], bool], seconds: float) -> bool:
        """Step until it holds; False if it does not within so many seconds."""
        until = self.robot.now + seconds
        while not holds():
            if self.robot.now >= until:
                return False
            self.robot.step()
        return True

    def outcome(self) -> Outcome:
        """All that was measured."""
        case = self.case
        stops = case.action > Action.CARRY_ON and case.drives
        arm_stops = stops and case.state in AUTONOMOUS and not case.injector.arm_runs_on
        return Outcome(
            case,
            self.detected_at - self.begun_at,
            self.stopped_s if stops else math.nan,
            self.wheels_moved_at - self.begun_at if stops else math.nan,
            max(self.arm_moved_at - self.begun_at, 0.0) if arm_stops else math.nan,
            tuple(self.broken),
        )
