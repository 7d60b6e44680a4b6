"""The composition root: config -> perception, states, body, loop. The only file that knows everyone."""

from __future__ import annotations

import math
from collections.abc import Callable, Sequence

import cv2

from calib.model import HeadMount, StereoRig
from robot.arm_guard import ArmGuardSettings
from robot.arm_keeper import ArmKeeper
from robot.body.wheels import WheelsBody, WheelsSettings
from robot.chart import RobotChart
from robot.clock import Clock
from robot.config import Config
from robot.fault_watch import FaultSource
from robot.guard import GuardLimits
from robot.hal.hardware import Hardware
from robot.looker import Recognizes
from robot.loop import Loop
from robot.loop_interfaces import Devices, LoopSettings
from robot.messages import Pose2, Tick
from robot.nav.grid import MapSettings, ObstacleMap
from robot.perception import HANDS_WIDTH, STAGES, Perception
from robot.states.avoid import Avoid
from robot.states.behaviour import Behaviour, State
from robot.states.halted import Halted
from robot.states.idle import Idle
from robot.states.range import Range
from robot.states.recognize import Recognize
from robot.states.search import Search
from robot.states.teleop import Teleop
from robot.states.track import Track
from robot.workers import SteppedWorker, Worker

PLANNED_BESIDE = 0.03  # metres a planned way keeps beside the body: a little more than the guard insists on


def nominal_rig(config: Config) -> StereoRig:
    """The pair as the config describes it, for want of a calibration file."""
    eyes = config.cameras
    return StereoRig.parallel(eyes.width_px, eyes.height_px, eyes.focal_px, eyes.baseline_m)


def head_mount(config: Config) -> HeadMount:
    """Where the head sits."""
    head = config.head
    return HeadMount(head.forward_m, head.height_m, head.eye_forward_m, config.cameras.baseline_m)


def stepped_worker(config: Config, slow: float = 1.0) -> SteppedWorker:
    """The lockstep worker with the configured costs of the stages."""
    return SteppedWorker({name: getattr(config.vision, name).cost_s for name in STAGES}, slow)


def devices_of(config: Config, hardware: Hardware) -> Devices:
    """What the loop reads and moves, out of all that is open."""
    arm = config.arm
    keeper = None
    if hardware.arm is not None:
        settings = ArmGuardSettings(slow_from=arm.slow_from_m, stop_at=arm.stop_at_m)
        keeper = ArmKeeper(hardware.arm, settings, arm.forward_m, arm.left_m)
    return Devices(
        hardware.camera,
        hardware.head,
        hardware.lamp,
        hardware.base,
        hardware.teleop,
        hardware.near,
        keeper,
    )


def build_states(config: Config, obstacle_map: ObstacleMap) -> dict[str, State]:
    """One object a state, by the chart's names."""
    behaviour = Behaviour(
        stand_off=config.mission.stand_off_m,
        search_timeout=config.mission.search_timeout_s,
        confirm_frames=config.vision.confirm_frames,
        body_radius=config.base.radius_m + PLANNED_BESIDE,
        head_forward=config.head.forward_m,
        head_height=config.head.height_m,
        pan_limit=math.radians(config.head.pan_limit_deg),
        rest_tilt=math.radians(config.head.rest_tilt_deg),
    )
    return {
        "idle": Idle(behaviour, config.mission.armed_at_start),
        "search": Search(behaviour, obstacle_map),
        "recognize": Recognize(behaviour),
        "range": Range(behaviour),
        "track": Track(behaviour, obstacle_map),
        "avoid": Avoid(behaviour, obstacle_map),
        "teleop": Teleop(behaviour),
        "halted": Halted(behaviour),
    }


def loop_settings(config: Config) -> LoopSettings:
    """The control tick's numbers."""
    base, safety = config.base, config.safety
    return LoopSettings(
        guard=GuardLimits(
            max_speed=base.max_speed_m_s,
            max_turn=math.radians(base.max_turn_deg_s),
            max_acceleration=base.max_acceleration_m_s2,
            margin=safety.margin_m,
            latency=safety.actuation_latency_s,
            free_space_max_age=safety.free_space_max_age_s,
            blind_speed=config.teleop.blind_speed_m_s,
            sonar_inset=max(0.0, base.radius_m - base.sonar_forward_m),
        ),
        frame_max_age=safety.frame_max_age_s,
        teleop_timeout=config.teleop.timeout_s,
        teleop_max_v=base.max_speed_m_s,
        teleop_max_w=math.radians(base.max_turn_deg_s),
        lamp_on_below=config.lamp.on_below,
        lamp_off_above=config.lamp.off_above,
    )


def wheels_settings(config: Config) -> WheelsSettings:
    """The wheeled body's numbers."""
    base, head = config.base, config.head
    return WheelsSettings(
        cruise=base.max_speed_m_s,
        max_turn=math.radians(base.max_turn_deg_s),
        command_life=config.safety.command_life_s,
        pan_limit=math.radians(head.pan_limit_deg),
        tilt_up_limit=math.radians(head.tilt_up_limit_deg),
        tilt_down_limit=math.radians(head.tilt_down_limit_deg),
    )


def build_perception(
    config: Config, rig: StereoRig, recognizer: Recognizes, worker: Worker, height_m: float | None = None
) -> Perception:
    """Vision with its map; the floor the robot was put on counts as free. height_m: the target's, or None."""
    obstacle_map = ObstacleMap(MapSettings(body_radius=config.base.radius_m))
    obstacle_map.start_disc(Pose2(), config.base.radius_m + HANDS_WIDTH)
    return Perception(config, rig, head_mount(config), recognizer, worker, obstacle_map, height_m)


def build_loop(
    config: Config,
    devices: Devices,
    perception: Perception,
    clock: Clock,
    observers: Sequence[Callable[[Tick], None]] = (),
    watched: Sequence[FaultSource] = (),
) -> Loop:
    """Everything joined, ready to tick."""
    cv2.setNumThreads(1)
    body = WheelsBody(wheels_settings(config))
    states = build_states(config, perception.map)
    return Loop(
        clock, devices, perception, RobotChart(), states, body, loop_settings(config), observers, watched
    )
