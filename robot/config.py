"""All settings: one frozen tree read from TOML. Units are in the names; unknown keys are refused.

`load(path)` returns a `Config`, or raises `UserError` whose one line names the file, the key and the
allowed range. `commented_defaults()` writes the whole tree with its ranges and words as TOML.
"""

from __future__ import annotations

from pathlib import Path
from typing import Annotated, Any

from msgspec import Meta, Struct, field

from robot import settings_file


def _doc(words: str, **bounds: Any) -> Meta:
    return Meta(description=words, **bounds)


class Cameras(Struct, frozen=True, forbid_unknown_fields=True):
    """The two eyes."""

    driver: Annotated[str, _doc("what delivers the pictures", pattern="^(mock|folder|v4l2|http|video)$")] = (
        "mock"
    )
    left: Annotated[
        str, _doc("left eye: /dev/v4l/by-path/..., http://..., a video file, or a folder of pictures")
    ] = ""
    right: Annotated[
        str,
        _doc("right eye likewise; empty: one device gives both side by side (folder: left_*, right_*)"),
    ] = ""
    calibration: Annotated[str, _doc("calibration file of the pair; empty: the nominal figures below")] = ""
    width_px: Annotated[int, _doc("picture width", ge=64, le=4096)] = 352
    height_px: Annotated[int, _doc("picture height", ge=48, le=4096)] = 288
    focal_px: Annotated[float, _doc("nominal focal length", ge=20.0, le=10000.0)] = 305.0
    baseline_m: Annotated[float, _doc("nominal distance between the lenses", ge=0.005, le=2.0)] = 0.06
    rate_hz: Annotated[float, _doc("pictures a second", ge=1.0, le=120.0)] = 25.0
    pixel_format: Annotated[
        str, _doc("v4l2: MJPG needs little of the USB bus, YUYV loses nothing", pattern="^(MJPG|YUYV)$")
    ] = "MJPG"
    exposure_100us: Annotated[
        int, _doc("exposure of both eyes in 0.1 ms; 0: the left eye settles, both keep that", ge=0, le=10000)
    ] = 0
    white_balance_k: Annotated[
        int, _doc("colour temperature of both eyes in kelvin; 0: as the left eye settles", ge=0, le=12000)
    ] = 0


class Head(Struct, frozen=True, forbid_unknown_fields=True):
    """The pan-tilt head and where it sits."""

    driver: Annotated[str, _doc("what stands behind it", pattern="^(mock|uvc|nxt-pan|none)$")] = "mock"
    device: Annotated[
        str, _doc("uvc: the camera that turns, /dev/v4l/by-path/... or http://HOST:PORT; empty: cameras.left")
    ] = ""
    zoom: Annotated[int, _doc("uvc: zoom control's value, kept fixed; 0: not touched", ge=0, le=10000)] = 0
    slew_deg_s: Annotated[float, _doc("how fast the head turns", ge=5.0, le=1000.0)] = 200.0
    pan_motor: Annotated[str, _doc("nxt-pan: brick port of the pan motor", pattern="^[ABC]$")] = "C"
    pan_gear: Annotated[
        float, _doc("nxt-pan: motor turns per head turn; negative: the other way", ge=-100.0, le=100.0)
    ] = 1.0
    forward_m: Annotated[float, _doc("pan axis ahead of the axle", ge=-1.0, le=1.0)] = 0.06
    height_m: Annotated[float, _doc("tilt axis above the floor", ge=0.02, le=3.0)] = 0.25
    eye_forward_m: Annotated[float, _doc("lenses ahead of the axes", ge=-0.2, le=0.2)] = 0.02
    pan_limit_deg: Annotated[float, _doc("largest pan to either side", ge=0.0, le=180.0)] = 80.0
    tilt_up_limit_deg: Annotated[float, _doc("largest tilt upwards", ge=0.0, le=90.0)] = 20.0
    tilt_down_limit_deg: Annotated[float, _doc("largest tilt downwards", ge=0.0, le=90.0)] = 50.0
    rest_tilt_deg: Annotated[float, _doc("tilt down while driving", ge=-20.0, le=50.0)] = 20.0


class LampSettings(Struct, frozen=True, forbid_unknown_fields=True):
    """The LED lamp."""

    driver: Annotated[str, _doc("what stands behind it", pattern="^(mock|sysfs|modbus|gpiozero|none)$")] = (
        "mock"
    )
    device: Annotated[
        str, _doc("sysfs: LED's name; gpiozero: pin, e.g. GPIO18; modbus: HOST:PORT or a serial port")
    ] = ""
    coil: Annotated[int, _doc("modbus: the lamp's coil", ge=0, le=65535)] = 4
    on_below: Annotated[float, _doc("mean picture brightness that switches it on", ge=0.0, le=255.0)] = 45.0
    off_above: Annotated[float, _doc("mean brightness that switches it off again", ge=0.0, le=255.0)] = 110.0


class Base(Struct, frozen=True, forbid_unknown_fields=True):
    """The drive base."""

    driver: Annotated[str, _doc("what stands behind it", pattern="^(mock|nxt-usb|nxt-serial|none)$")] = "mock"
    port: Annotated[str, _doc("serial port of nxt-serial, e.g. /dev/rfcomm0")] = ""
    brick: Annotated[str, _doc("USB serial number of the brick; empty: the only one there")] = ""
    left_motor: Annotated[str, _doc("brick port of the left wheel", pattern="^[ABC]$")] = "B"
    right_motor: Annotated[str, _doc("brick port of the right wheel", pattern="^[ABC]$")] = "C"
    motors_reversed: Annotated[bool, _doc("true if the motors are mounted to run backwards")] = False
    wheel_radius_m: Annotated[float, _doc("radius of the driven wheels", ge=0.005, le=0.5)] = 0.028
    track_width_m: Annotated[float, _doc("distance between the wheels' contact points", ge=0.02, le=2.0)] = (
        0.15
    )
    radius_m: Annotated[
        float,
        _doc("radius of the smallest circle about the axle's middle that holds the body", ge=0.02, le=2.0),
    ] = 0.13
    body_height_m: Annotated[float, _doc("what is higher than this can be passed under", ge=0.02, le=3.0)] = (
        0.32
    )
    max_speed_m_s: Annotated[float, _doc("top forward speed", ge=0.0, le=2.0)] = 0.25
    max_turn_deg_s: Annotated[float, _doc("top turning rate", ge=0.0, le=360.0)] = 70.0
    max_acceleration_m_s2: Annotated[float, _doc("acceleration and braking", ge=0.05, le=10.0)] = 0.6
    pulse_s: Annotated[float, _doc("dead-man: a command drives at most this long", ge=0.05, le=0.3)] = 0.3
    bumper_ports: Annotated[
        str, _doc("brick inputs with touch sensors as bumper, e.g. 1 or 12; empty: none", pattern="^[1-4]*$")
    ] = ""
    sonar_port: Annotated[
        str, _doc("brick input with the ultrasonic sensor; empty: none", pattern="^[1-4]?$")
    ] = ""
    sonar_forward_m: Annotated[float, _doc("the sonar's face ahead of the axle", ge=-1.0, le=1.0)] = 0.12


class ArmSettings(Struct, frozen=True, forbid_unknown_fields=True):
    """The robot arm."""

    driver: Annotated[str, _doc("what stands behind it", pattern="^(mock|modbus|none)$")] = "none"
    address: Annotated[str, _doc("its controller: HOST:PORT (TCP) or a serial port (RTU)")] = ""
    baudrate: Annotated[int, _doc("of a serial port", ge=1200, le=1000000)] = 115200
    unit: Annotated[int, _doc("Modbus unit number", ge=1, le=247)] = 1
    word_order: Annotated[str, _doc("of 32-bit values", pattern="^(high-first|low-first)$")] = "high-first"
    watchdog_ms: Annotated[int, _doc("the controller stops by itself after this silence", ge=100, le=400)] = (
        300
    )
    forward_m: Annotated[float, _doc("the arm's base ahead of the robot's origin", ge=-2.0, le=2.0)] = 0.0
    left_m: Annotated[float, _doc("the arm's base left of the robot's origin", ge=-2.0, le=2.0)] = 0.0
    slow_from_m: Annotated[float, _doc("something this near: the arm slows down", ge=0.05, le=3.0)] = 0.5
    stop_at_m: Annotated[float, _doc("something this near: the arm stands", ge=0.0, le=2.0)] = 0.12


class TeleopSettings(Struct, frozen=True, forbid_unknown_fields=True):
    """The person at the stick."""

    driver: Annotated[str, _doc("what stands behind it", pattern="^(mock|serial|none)$")] = "none"
    port: Annotated[str, _doc("serial port, e.g. /dev/ttyUSB0")] = ""
    baudrate: Annotated[int, _doc("of the serial port", ge=1200, le=1000000)] = 115200
    timeout_s: Annotated[float, _doc("silence after which the robot stops", ge=0.1, le=0.5)] = 0.4
    blind_speed_m_s: Annotated[float, _doc("top speed without working vision", ge=0.0, le=0.2)] = 0.08


class Safety(Struct, frozen=True, forbid_unknown_fields=True):
    """What the guard keeps."""

    margin_m: Annotated[float, _doc("distance kept to whatever stands in the way", ge=0.0, le=1.0)] = 0.06
    actuation_latency_s: Annotated[float, _doc("from decision to turning wheels", ge=0.0, le=1.0)] = 0.12
    command_life_s: Annotated[float, _doc("a command expires after this", ge=0.05, le=0.5)] = 0.2
    free_space_max_age_s: Annotated[float, _doc("older free space: no translation", ge=0.05, le=0.3)] = 0.3
    frame_max_age_s: Annotated[float, _doc("older frames are a fault", ge=0.05, le=2.0)] = 0.45
    step_height_m: Annotated[
        float, _doc("what stands up (or falls away) more is an obstacle", ge=0.005, le=0.2)
    ] = 0.03


class Stage(Struct, frozen=True, forbid_unknown_fields=True):
    """One vision stage: how often it runs, and its share of time in lockstep."""

    rate_hz: Annotated[float, _doc("wanted rate", ge=0.1, le=100.0)]
    cost_s: Annotated[float, _doc("time it takes in lockstep (simulated latency)", ge=0.0, le=2.0)]


class Vision(Struct, frozen=True, forbid_unknown_fields=True):
    """The vision stages and what they look for."""

    model: Annotated[str, _doc("file of the taught target (`robot teach`); empty: none")] = ""
    method: Annotated[
        str,
        _doc(
            "how it is looked for: all of windows, ferns and NMF (half hidden too), or NMF alone",
            pattern="^(all|nmf)$",
        ),
    ] = "all"
    disparities: Annotated[
        int, _doc("searched disparities, a multiple of 16", ge=16, le=512, multiple_of=16)
    ] = 64
    confirm_frames: Annotated[int, _doc("agreeing frames before a candidate is the target", ge=1, le=20)] = 3
    max_load: Annotated[float, _doc("share of one core vision may use", ge=0.1, le=1.0)] = 0.9
    health: Annotated[Stage, _doc("whether the pair is one: eyes in order, rows that agree")] = field(
        default_factory=lambda: Stage(rate_hz=6.0, cost_s=0.003)
    )
    track: Annotated[Stage, _doc("following the target and its range")] = field(
        default_factory=lambda: Stage(rate_hz=25.0, cost_s=0.008)
    )
    free_space: Annotated[Stage, _doc("dense stereo, ground plane, free floor and passage")] = field(
        default_factory=lambda: Stage(rate_hz=8.4, cost_s=0.03)
    )
    motion: Annotated[Stage, _doc("the base's own motion by the eyes, held against its wheels")] = field(
        default_factory=lambda: Stage(rate_hz=8.0, cost_s=0.006)
    )
    review: Annotated[Stage, _doc("while following: is something more like the target in view")] = field(
        default_factory=lambda: Stage(rate_hz=1.0, cost_s=0.025)
    )
    recognize: Annotated[Stage, _doc("looking for the target in the whole picture")] = field(
        default_factory=lambda: Stage(rate_hz=5.0, cost_s=0.07)
    )


class Mission(Struct, frozen=True, forbid_unknown_fields=True):
    """What the robot is to do."""

    armed_at_start: Annotated[bool, _doc("start autonomy without being asked")] = False
    stand_off_m: Annotated[float, _doc("distance to keep to the target", ge=0.3, le=5.0)] = 0.7
    search_timeout_s: Annotated[float, _doc("give up searching after this", ge=5.0, le=3600.0)] = 50.0
    seed: Annotated[int, _doc("for everything random in the robot", ge=0)] = 0


class Config(Struct, frozen=True, forbid_unknown_fields=True):
    """Every setting of the robot."""

    mission: Mission = field(default_factory=Mission)
    cameras: Cameras = field(default_factory=Cameras)
    head: Head = field(default_factory=Head)
    lamp: LampSettings = field(default_factory=LampSettings)
    base: Base = field(default_factory=Base)
    arm: ArmSettings = field(default_factory=ArmSettings)
    teleop: TeleopSettings = field(default_factory=TeleopSettings)
    safety: Safety = field(default_factory=Safety)
    vision: Vision = field(default_factory=Vision)


def load(path: Path) -> Config:
    """Read a config file. Raises `UserError` naming file, key and allowed range if anything is wrong."""
    return settings_file.read(path, Config)


def commented_defaults() -> str:
    """The whole tree as TOML: every key with its default, its range and what it means."""
    return settings_file.commented(Config())
