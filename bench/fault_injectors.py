"""How every row of the fault table is brought about: at the device's far end wherever that can be reached."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass

from bench.fault_rig import PLAIN, VARIANTS, WORKER, FaultRobot
from robot.chart import AUTONOMOUS, LEAVES
from robot.messages import Fault

Action = Callable[[FaultRobot], None]

_RIGHT_WHEEL = 2
_FRESH_MV, _LOW_MV, _EMPTY_MV = 7900.0, 6700.0, 6000.0
_DRIVING = (*AUTONOMOUS, "teleop")


@dataclass(frozen=True, slots=True)
class Injector:
    """One way a row of the table comes about.

    begin breaks it and end mends it (None: it stays broken until the next start). states, variants: where it
    makes sense. wheels_deaf: no telegram can stop them any more, they run out by themselves. arm_runs_on:
    nothing but its red button stops the arm. prepare: what goes before, so long ahead of the fault. spoilt:
    the camera's state from the start, for what happens then only.
    """

    name: str
    begin: Action
    end: Action | None
    states: tuple[str, ...] = LEAVES
    variants: tuple[str, ...] = VARIANTS
    wheels_deaf: bool = False
    arm_runs_on: bool = False
    prepare: Action | None = None
    prepared_s: float = 0.0
    spoilt: str = ""


def _nothing(robot: FaultRobot) -> None:
    """It is so already."""


def _camera(name: str, spoilt: str) -> Injector:
    return Injector(name, _spoil(spoilt), _spoil(""), variants=(PLAIN,))


def _spoil(how: str) -> Action:
    def act(robot: FaultRobot) -> None:
        robot.camera.spoilt = how

    return act


def _brick(name: str, begin: Action, end: Action | None, deaf: bool = False) -> Injector:
    return Injector(name, begin, end, wheels_deaf=deaf)


def _battery(millivolts: float) -> Injector:
    return _brick(
        f"{millivolts / 1000:.1f} V",
        lambda robot: robot.brick.set_battery(millivolts),
        lambda robot: robot.brick.set_battery(_FRESH_MV),
    )


def _told(device: str, kind: str) -> Injector:
    key = f"{device}.{kind}"

    def begin(robot: FaultRobot) -> None:
        robot.vision.told[key] = Fault(device, kind, robot.now, "as scripted")

    return Injector("told", begin, lambda robot: robot.vision.told.clear(), variants=(PLAIN,))


def _hang(device: str, deaf: bool = False) -> Injector:
    return Injector(
        "its driver hangs",
        lambda robot: robot.workers[device].hang(True),
        lambda robot: robot.workers[device].hang(False),
        variants=(WORKER,),
        wheels_deaf=deaf,
    )


def _attribute(part: str, name: str, broken: object, whole: object) -> tuple[Action, Action]:
    """Set an attribute of one of the robot's parts, and set it back."""

    def setter(value: object) -> Action:
        return lambda robot: setattr(getattr(robot, part), name, value)

    return setter(broken), setter(whole)


def _refuse_arm(robot: FaultRobot) -> None:
    robot.arm_controller.refusing = True
    if not robot.arm.read(robot.now).enabled:
        robot.arm.enable(robot.now)
    robot.order_arm()


def _head(kinds: frozenset[str]) -> Action:
    return lambda robot: robot.head.break_with(kinds, robot.now)


def _stick_head(robot: FaultRobot) -> None:
    _head(frozenset({"stuck"}))(robot)
    robot.look_elsewhere()


def _bump(robot: FaultRobot) -> None:
    robot.touch.pressed = True
    robot.person.v = -robot.person.v  # only backwards leads away from it


def _unbump(robot: FaultRobot) -> None:
    robot.touch.pressed = False
    robot.person.v = -robot.person.v


def _darken(robot: FaultRobot) -> None:
    robot.camera.dark, robot.camera.lamp_works = True, False


def _mend_lamp(robot: FaultRobot) -> None:
    robot.camera.lamp_works = True


def _strand(robot: FaultRobot) -> None:
    robot.brick.cut_link()


def _unstrand(robot: FaultRobot) -> None:
    robot.brick.release(_RIGHT_WHEEL)
    robot.brick.restore_link()


def _mistake_of_state(robot: FaultRobot) -> None:
    robot.states[robot.tick.state].error = ZeroDivisionError("a mistake, on order")


def _mistake_of_observer(robot: FaultRobot) -> None:
    robot.observer_error = ValueError("a mistake, on order")


def _noise(robot: FaultRobot) -> None:
    robot.line.say(bytes(range(0x80, 0xC0)))


def _speak(speaking: bool) -> Action:
    def act(robot: FaultRobot) -> None:
        robot.person.speaking = speaking

    return act


def _late(steps: int) -> Action:
    def act(robot: FaultRobot) -> None:
        robot.steps_a_tick = steps

    return act


INJECTORS: dict[str, tuple[Injector, ...]] = {
    "camera.missing": (
        Injector("none from the start", _nothing, _spoil(""), variants=(PLAIN,), spoilt="missing"),
    ),
    "camera.stale": (_camera("no new pairs", "stopped"), _camera("old pairs", "old")),
    "camera.frozen": (_camera("the same picture", "frozen"),),
    "camera.black": (_camera("lens caps", "black"),),
    "camera.unpaired": (_camera("never at one moment", "unpaired"),),
    "camera.size": (_camera("seen", "odd"), _camera("told by the driver", "odd told")),
    "camera.swapped": (_camera("exchanged pictures", "swapped"),),
    "camera.misrectified": (_camera("a bumped eye", "bumped"),),
    "camera.link": (_camera("unplugged", "unplugged"),),
    "head.link": (
        Injector("no answer", _head(frozenset({"link"})), _head(frozenset())),
        _hang("head"),
    ),
    "head.stuck": (Injector("does not turn", _stick_head, _head(frozenset())),),
    "lamp.link": (
        Injector("no answer", lambda robot: robot.lamp.fail("send", "link"), lambda robot: robot.lamp.mend()),
        _hang("lamp"),
    ),
    "lamp.dead": (Injector("no light", _darken, _mend_lamp, variants=(PLAIN,)),),
    "base.link": (
        _brick("cable out", lambda r: r.brick.cut_link(), lambda r: r.brick.restore_link(), deaf=True),
        _brick("silent", lambda r: r.brick.silence_link(), lambda r: r.brick.restore_link(), deaf=True),
        _brick("garbage", *_attribute("brick", "garbage", True, False), deaf=True),
        _brick("switched off", lambda r: r.brick.power_off(), None, deaf=True),
        _hang("base", deaf=True),
    ),
    "base.stall": (
        Injector(
            "wheel jammed",
            lambda robot: robot.brick.stall(_RIGHT_WHEEL),
            lambda robot: robot.brick.release(_RIGHT_WHEEL),
            states=_DRIVING,
        ),
    ),
    "base.stranded": (
        Injector(
            "cable out, wheel jammed",
            _strand,
            _unstrand,
            states=_DRIVING,
            wheels_deaf=True,
            prepare=lambda robot: robot.brick.stall(_RIGHT_WHEEL),
            prepared_s=0.16,
        ),
    ),
    "base.moved": (Injector("pushed", *_attribute("vision", "pushed", True, False), variants=(PLAIN,)),),
    "base.battery_low": (_battery(_LOW_MV),),
    "base.battery_empty": (_battery(_EMPTY_MV),),
    "base.refused": (
        Injector("error answers", *_attribute("wire", "refusing", True, False), wheels_deaf=True),
    ),
    "near.bump": (Injector("bumper pressed", _bump, _unbump),),
    "near.link": (
        Injector("answers get lost", *_attribute("wire", "inputs_mute", True, False)),
        _hang("near"),
    ),
    "near.sensor": (Injector("sonar unplugged", *_attribute("sonar", "unplugged", True, False)),),
    "arm.link": (
        Injector("connection cut", *_attribute("arm_client", "cut", True, False)),
        Injector("no answer", *_attribute("arm_registers", "silent", True, False)),
        Injector("nothing but exceptions", *_attribute("arm_registers", "storm", True, False)),
        Injector(
            "its program stands still",
            *_attribute("arm_controller", "frozen", True, False),
            arm_runs_on=True,
        ),
        _hang("arm"),
    ),
    "arm.fault": (
        Injector(
            "controller's fault",
            lambda robot: robot.arm_controller.fail(3),
            lambda robot: robot.arm_controller.reset(),
        ),
    ),
    "arm.stopped": (
        Injector(
            "emergency stop",
            lambda robot: robot.arm_controller.press_emergency_stop(),
            lambda robot: robot.arm_controller.release_emergency_stop(),
        ),
        Injector(
            "protective stop",
            lambda robot: robot.arm_controller.trip_protective_stop(),
            lambda robot: robot.arm_controller.release_protective_stop(),
        ),
    ),
    "arm.refused": (
        Injector("refuses", _refuse_arm, *_attribute("arm_controller", "refusing", True, False)[1:]),
    ),
    "teleop.link": (Injector("hang-up", *_attribute("line", "cut", True, False)), _hang("teleop")),
    "teleop.silent": (Injector("says nothing more", _speak(False), _speak(True), states=("teleop",)),),
    "teleop.noise": (Injector("strange bytes", _noise, _nothing),),
    "recorder.full": (
        Injector(
            "disk full", lambda robot: robot.recording.stop(robot.now, "no space"), None, variants=(PLAIN,)
        ),
    ),
    "recorder.error": (Injector("its own mistake", _mistake_of_observer, None, variants=(PLAIN,)),),
    "vision.late": (_told("vision", "late"),),
    "vision.error": (_told("vision", "error"),),
    "driver.error": (
        Injector(
            "all of the brick's",
            *_attribute("wire", "mistake", "all", ""),
            variants=(WORKER,),
            wheels_deaf=True,
        ),
        Injector("the bumper's", *_attribute("wire", "mistake", "inputs", ""), variants=(WORKER,)),
    ),
    "loop.late": (Injector("slow ticks", _late(4), _late(2), variants=(PLAIN,)),),
    "loop.error": (Injector("a state's mistake", _mistake_of_state, None, variants=(PLAIN,)),),
}
"""For each row of the table the ways it is brought about."""
