"""One run in a simulated room: the world, the robot in it, the referee beside it, in lockstep."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass

import msgspec

from robot.app import build_loop, build_perception, nominal_rig, stepped_worker
from robot.clock import SteppedClock
from robot.config import Config
from robot.fault_watch import FaultSource
from robot.hal.factory import nxt_settings
from robot.hal.links import MemoryLink
from robot.hal.nxt.base import NxtBase
from robot.hal.nxt.brick import Brick
from robot.hal.nxt.near import NxtNear
from robot.hal.nxt.settings import USB, USB_NEAR
from robot.looker import Recognizes
from robot.loop import Loop
from robot.loop_interfaces import Devices
from robot.messages import Box, Tick
from robot.perception import Perception
from robot.sim.injected import InjectedFault
from robot.sim.referee import Claim, Referee
from robot.sim.scene import Scene
from robot.sim.world import World
from robot.told_faults import Drill, ToldFault
from robot.workers import Worker

CLAIMING = ("range", "track", "avoid")


@dataclass(frozen=True, slots=True)
class SimOptions:
    """How a run differs from the plain one: slower vision, broken devices, drills."""

    slow: float = 1.0
    faults: tuple[InjectedFault, ...] = ()
    told: tuple[ToldFault, ...] = ()


class Claims:
    """Turns ticks into what the robot publicly claims, for the referee to judge.

    A percept names its frame by the capture time; the referee wants the frame's number.
    """

    def __init__(self) -> None:
        self._seq_at: dict[float, int] = {}
        self._gave_up = False

    def of(self, tick: Tick) -> Claim:
        """The claim of one tick."""
        if tick.view is not None:
            self._seq_at[tick.view.frame.captured_at] = tick.view.frame.seq
            for old in [at for at in self._seq_at if at < tick.now - 1.0]:
                del self._seq_at[old]
        if any(t.event.name == "given_up" for t in tick.transitions):
            self._gave_up = True
        box: Box | None = None
        distance: float | None = None
        seq: int | None = None
        track, target = tick.percepts.track, tick.percepts.target
        if tick.state in CLAIMING and track is not None and not track.value.lost:
            box = track.value.box
            seq = self._seq_at.get(track.at)
            if target is not None and target.at == track.at:
                distance = target.value.distance
        return Claim(
            now=tick.now,
            state=tick.state,
            found=box is not None,
            box=box,
            range_m=distance,
            frame_seq=seq,
            gave_up=self._gave_up,
        )


class SimRun:
    """World, robot and referee joined; `step` until `done`."""

    def __init__(
        self,
        scene: Scene,
        seed: int,
        recognizer: Recognizes,
        config: Config | None = None,
        options: SimOptions | None = None,
        observers: Sequence[Callable[[Tick], None]] = (),
        worker: Worker | None = None,
        height_m: float | None = None,
        watched: Sequence[FaultSource] = (),
    ) -> None:
        options = options or SimOptions()
        self.config = armed(config or Config(), scene, seed)
        self.world = World(scene, seed, options.faults)
        self.referee = Referee(self.world)
        self.clock = SteppedClock()
        self.perception: Perception = build_perception(
            self.config,
            nominal_rig(self.config),
            recognizer,
            worker or stepped_worker(self.config, options.slow),
            height_m,
        )
        self._claims = Claims()
        self.devices = open_simulated(self.world, self.config)
        sources = [*watched, Drill(options.told).faults]
        self.loop: Loop = build_loop(
            self.config, self.devices, self.perception, self.clock, observers, sources
        )

    @property
    def done(self) -> bool:
        """True once the referee has seen enough."""
        return self.referee.done

    def step(self) -> Tick:
        """One control tick of world, robot and referee."""
        self.world.step()
        self.clock.step()
        tick = self.loop.tick()
        self.observe(tick)
        return tick

    def observe(self, tick: Tick) -> None:
        """Let the referee judge what the robot claims."""
        self.referee.observe(self._claims.of(tick))

    def close(self) -> None:
        """Stop the wheels and release the world. May be called twice."""
        self.loop.close()
        self.perception.close()
        self.devices.base.close()
        self.world.close()


def open_simulated(world: World, config: Config) -> Devices:
    """The world's devices; base, bumper and sonar through the real NXT drivers and the emulated brick.

    Its bumper is plugged into input 1, its sonar into input 4: they are used if the config names them.
    """
    brick = Brick(MemoryLink(world.brick.handle))
    base = NxtBase(brick, nxt_settings(config.base, USB))
    named = config.base.bumper_ports or config.base.sonar_port
    figures = USB_NEAR.plugged(config.base.bumper_ports, config.base.sonar_port)
    near = NxtNear(brick, figures) if named else None
    return Devices(world.camera, world.head, world.lamp, base, near=near)


def armed(config: Config, scene: Scene, seed: int) -> Config:
    """The config for a simulated mission: autonomy from the start, the scene's stand-off."""
    mission = msgspec.structs.replace(
        config.mission, armed_at_start=True, seed=seed, stand_off_m=scene.stand_off_m
    )
    return msgspec.structs.replace(config, mission=mission)
