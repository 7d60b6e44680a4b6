"""A whole robot on the bench in simulated time, without pictures being drawn: what the fault matrix breaks.

Real are loop, chart, guard, authority, fault watch, the drivers of base, bumper, sonar, arm and teleop line,
and the emulators at their far ends. Scripted are vision, states and body; head and lamp are simple devices.
"""

from __future__ import annotations

import math
from collections.abc import Callable
from dataclasses import dataclass, replace

import numpy as np

from bench.fault_eyes import ScriptedCamera, ScriptedVision
from bench.fault_parts import (
    COMMAND_LIFE_S,
    BenchClock,
    LooseSonar,
    Person,
    ScriptedState,
    SteppedWorker,
    StraightBody,
    TeleopLine,
    WatchedWire,
)
from robot.app import loop_settings
from robot.arm_guard import ArmGuardSettings
from robot.arm_keeper import ArmKeeper
from robot.chart import AUTONOMOUS, LEAVES, RobotChart
from robot.config import Config
from robot.hal.arm.modbus_arm import ModbusArm
from robot.hal.factory import nxt_settings
from robot.hal.head_limits import DEFAULT_LIMITS as HEAD_LIMITS
from robot.hal.interfaces import Arm, DriveBase, LampDevice, NearSensors, PanTilt, TeleopLink
from robot.hal.kinematics import limited
from robot.hal.links import MemoryLink
from robot.hal.mock import MockLamp
from robot.hal.modbus import ModbusLink
from robot.hal.nxt.base import NxtBase
from robot.hal.nxt.brick import Brick
from robot.hal.nxt.near import NxtNear
from robot.hal.nxt.settings import USB, USB_NEAR
from robot.hal.teleop.frames import Button
from robot.hal.teleop.serial import SerialTeleop
from robot.hal.threaded import ThreadedBase, ThreadedHead, ThreadedLamp, ThreadedNear, ThreadedTeleop
from robot.hal.threaded_arm import ThreadedArm
from robot.loop import Loop
from robot.loop_interfaces import Devices
from robot.messages import Event, HeadPose, Tick, Twist
from robot.record.recording import Recording
from robot.sim.arm_controller import HOME, ArmController
from robot.sim.arm_registers import ArmRegisters
from robot.sim.brick_emulator import BrickEmulator
from robot.sim.brick_inputs import TouchSensor
from robot.sim.head import SimHead
from robot.sim.modbus_memory import MemoryModbusClient
from robot.sim.motor import FreeMotor

PLAIN, WORKER = "plain", "worker"
VARIANTS = (PLAIN, WORKER)
STEP_MS, TICK_STEPS = 20, 2
STANDS_RAD_S = 0.05
"""Slower than this a wheel stands: 1.4 mm/s at its rim."""
_ARM_SPEED = 0.2
_ARM_GOALS = (
    HOME,
    tuple(angle + math.radians(60.0) if joint == 0 else angle for joint, angle in enumerate(HOME)),
)
_WAY = ("armed", "candidate_seen", "target_confirmed", "target_ranged", "way_blocked")
_EVENTS = {
    "idle": (),
    "search": _WAY[:1],
    "recognize": _WAY[:2],
    "range": _WAY[:3],
    "track": _WAY[:4],
    "avoid": _WAY[:5],
    "halted": ("fault_halted",),
}


@dataclass(frozen=True, slots=True)
class _Drivers:
    base: DriveBase
    near: NearSensors
    head: PanTilt
    lamp: LampDevice
    arm: Arm
    teleop: TeleopLink


class FaultRobot:
    """The robot. variant: PLAIN (the loop calls the drivers) or WORKER (each behind its worker).

    spoilt: what is wrong with the camera from the start. battery_period_s: how often the battery is read.
    """

    def __init__(self, variant: str = PLAIN, spoilt: str = "", battery_period_s: float = 5.0) -> None:
        self.clock = BenchClock()
        config = Config()
        self._build_brick()
        self.arm_controller = ArmController()
        self.arm_registers = ArmRegisters(self.arm_controller)
        self.arm_client = MemoryModbusClient(self.arm_registers)
        self.head = SimHead(np.random.default_rng(2))
        self.lamp = MockLamp()
        self.line = TeleopLine()
        self.person = Person(self.line)
        self.camera = ScriptedCamera(lambda: self.lamp.level, spoilt)
        self.vision = ScriptedVision()
        self.states = {name: ScriptedState(drives=name in AUTONOMOUS) for name in LEAVES}
        self.recording = Recording()
        self.observer_error: Exception | None = None
        self.workers: dict[str, SteppedWorker] = {}
        self.steps_a_tick = TICK_STEPS
        self._arm_goal = 0
        figures = replace(nxt_settings(config.base, USB), battery_period_s=battery_period_s)
        brick = Brick(MemoryLink(self.wire.handle))
        plain = _Drivers(
            base=NxtBase(brick, figures),
            near=NxtNear(brick, USB_NEAR.plugged("1", "4")),
            head=self.head,
            lamp=self.lamp,
            arm=ModbusArm(ModbusLink(self.arm_client, "the arm in memory")),
            teleop=SerialTeleop(self.line.open),
        )
        drivers = (
            plain
            if variant == PLAIN
            else self._behind_workers(plain, lambda t: limited(t, figures.limits, figures.wheels))
        )
        self.arm = drivers.arm
        devices = Devices(
            self.camera,
            drivers.head,
            drivers.lamp,
            drivers.base,
            drivers.teleop,
            drivers.near,
            ArmKeeper(drivers.arm, ArmGuardSettings()),
        )
        self.settings = loop_settings(config)
        self._loop = Loop(
            self.clock,
            devices,
            self.vision,
            RobotChart(),
            self.states,
            StraightBody(),
            self.settings,
            [self._observe],
            [self.recording.faults],
        )
        self.tick: Tick = self._loop.tick()

    def _build_brick(self) -> None:
        rng = np.random.default_rng(3)
        self.motors = (FreeMotor(rng, load_inertia=0.0005), FreeMotor(rng, load_inertia=0.0005))
        self.touch, self.sonar = TouchSensor(), LooseSonar()
        self.brick = BrickEmulator([None, *self.motors], rng, sensors={0: self.touch, 3: self.sonar})
        self.wire = WatchedWire(self.brick, self.clock)

    def _behind_workers(self, plain: _Drivers, limit: Callable[[Twist], Twist]) -> _Drivers:
        def worker(name: str) -> SteppedWorker:
            self.workers[name] = SteppedWorker(name, self.clock)
            return self.workers[name]

        return _Drivers(
            base=ThreadedBase(plain.base, worker("base"), limit, COMMAND_LIFE_S),
            near=ThreadedNear(plain.near, worker("near")),
            head=ThreadedHead(plain.head, worker("head"), HEAD_LIMITS.applied),
            lamp=ThreadedLamp(plain.lamp, worker("lamp")),
            arm=ThreadedArm(plain.arm, worker("arm")),
            teleop=ThreadedTeleop(plain.teleop, worker("teleop")),
        )

    # ----------------------------------------------------------------------------------------- its time

    @property
    def now(self) -> float:
        """Seconds since the start."""
        return self.clock.now()

    def step(self) -> Tick:
        """Let a period pass for everything, then tick."""
        for _ in range(self.steps_a_tick):
            self.clock.advance(STEP_MS)
            seconds = STEP_MS / 1000.0
            self.brick.advance(seconds)
            self.arm_controller.advance(seconds)
            self.head.advance(seconds, self.now)
            self.person.advance(self.now)
            for worker in self.workers.values():
                worker.poll()
        self.tick = self._loop.tick()
        self._use_arm()
        return self.tick

    def run(self, seconds: float) -> None:
        """Step for so long."""
        until = self.now + seconds
        while self.now < until - 1e-9:
            self.step()

    # ---------------------------------------------------------------------------------------- its script

    def reach(self, leaf: str, settle: bool = True) -> None:
        """From the start into a state. settle: let it come to speed there. Raises RuntimeError if it fails.

        >>> robot = FaultRobot()
        >>> robot.reach("track")
        >>> robot.tick.state, robot.tick.sent.twist, robot.wheel_speed > 5.0
        ('track', Twist(v=0.2, w=0.0), True)
        """
        if settle:
            self.run(0.2)
        if leaf == "teleop":
            self._take()
        else:
            for event in _EVENTS[leaf]:
                self.states[self.tick.state].event = Event(event, "the script")
                self.step()
        if self.tick.state != leaf:
            raise RuntimeError(
                f"the bench's robot is in {self.tick.state}, not in {leaf}: {self.tick.faults}"
            )
        if settle:
            self.run(0.6 if leaf in (*AUTONOMOUS, "teleop") else 0.16)

    def order_arm(self) -> int:
        """Whoever uses the arm sends it elsewhere."""
        self._arm_goal = 1 - self._arm_goal
        return self.arm.move_joints(_ARM_GOALS[self._arm_goal], _ARM_SPEED, self.now)

    def look_elsewhere(self) -> None:
        """All states look to the other side."""
        for state in self.states.values():
            state.look = HeadPose(-state.look.pan, state.look.tilt)

    def _take(self) -> None:
        self.person.speaking = True
        self.run(0.28)
        self.person.press(Button.TAKE)
        self.run(0.16)
        self.person.v = 0.8

    def _use_arm(self) -> None:
        """In autonomous states something is always wanted of it, but not while the robot has to stop."""
        if self.tick.state not in AUTONOMOUS or self.tick.sent.twist.is_zero:
            return
        state = self.arm.read(self.now)
        if not state.enabled:
            self.arm.enable(self.now)
        elif not state.moving:
            self.order_arm()

    def _observe(self, tick: Tick) -> None:
        if self.observer_error is not None:
            raise self.observer_error

    # ------------------------------------------------------------------------------------ what is true

    @property
    def wheel_speed(self) -> float:
        """Speed in rad/s of the faster of both true wheels."""
        return max(abs(motor.speed) for motor in self.motors)

    @property
    def pushes(self) -> bool:
        """True if a motor draws current: it turns or wants to."""
        return any(motor.current_amperes > 0.1 for motor in self.motors)
