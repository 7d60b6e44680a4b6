"""The control tick: read -> see -> judge faults -> person -> state -> body -> guard -> act -> publish.

It never waits: vision is asked for and collected, devices return their newest value. Motors are stopped
before an event is sent, for sending runs other code.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, replace
from typing import Protocol

from robot import authority, faults
from robot.clock import Clock
from robot.fault_watch import FaultSource, FaultWatch
from robot.guard import GuardInput, GuardLimits, guard
from robot.hal.interfaces import DriveBase, LampDevice, PanTilt, StereoCamera, TeleopLink
from robot.lamp_control import lamp_level
from robot.messages import (
    Clearance,
    Command,
    Event,
    Fault,
    HeadPose,
    Intent,
    Odometry,
    Percepts,
    Pose2,
    Sent,
    Situation,
    TeleopInput,
    Tick,
    Transition,
    Twist,
    View,
    Want,
)

GLANCE_WITHIN = 0.5  # metres: unseen floor nearer than this is worth a look down
AUTONOMOUS = ("search", "recognize", "range", "track", "avoid")


class StateLike(Protocol):
    """A state as the loop sees it."""

    def enter(self, situation: Situation) -> None:
        """Called once when the chart enters the state."""
        ...

    def step(self, situation: Situation) -> tuple[Intent, Event | None]:
        """Called every tick."""
        ...


class ChartLike(Protocol):
    """The chart as the loop sees it."""

    @property
    def leaf(self) -> str:
        """The innermost active state."""
        ...

    def send(self, event: str) -> object:
        """Take the transition of this event."""
        ...


class PerceptionLike(Protocol):
    """Perception as the loop sees it."""

    def submit(self, view: View, wants: frozenset[Want], now: float) -> None:
        """Start what is due on this view."""
        ...

    def collect(self, now: float) -> Percepts:
        """The newest percepts."""
        ...

    def faults(self, now: float) -> tuple[Fault, ...]:
        """What is wrong with vision."""
        ...

    def forget_target(self) -> None:
        """Drop the stale track."""
        ...

    def clearance(self, pose: Pose2, twist: Twist, now: float) -> Clearance:
        """How far the way of this twist is free."""
        ...

    def may_turn(self, pose: Pose2) -> bool:
        """True if nothing stands within the circle the body turns in."""
        ...


class BodyLike(Protocol):
    """The body as the loop sees it."""

    def command(self, intent: Intent, odometry: Odometry, blocked_by_unknown: bool, now: float) -> Command:
        """Turn an intent into a command."""
        ...


@dataclass(frozen=True, slots=True)
class Devices:
    """What the loop reads and moves."""

    camera: StereoCamera
    head: PanTilt
    lamp: LampDevice
    base: DriveBase
    teleop: TeleopLink | None = None


@dataclass(frozen=True, slots=True)
class LoopSettings:
    """Numbers of the control tick."""

    guard: GuardLimits
    frame_max_age: float = 0.5
    teleop_timeout: float = 0.4
    teleop_max_v: float = 0.25
    teleop_max_w: float = 1.2
    lamp_on_below: float = 45.0
    lamp_off_above: float = 110.0


class Loop:
    """One robot's control loop; call `tick` 25 times a second.

    observers are told every tick; watched are asked every tick for faults of what is no device (the record).
    """

    def __init__(
        self,
        clock: Clock,
        devices: Devices,
        perception: PerceptionLike,
        chart: ChartLike,
        states: Mapping[str, StateLike],
        body: BodyLike,
        settings: LoopSettings,
        observers: Sequence[Callable[[Tick], None]] = (),
        watched: Sequence[FaultSource] = (),
    ) -> None:
        self._clock = clock
        self._devices = devices
        self._perception = perception
        self._chart = chart
        self._states = states
        self._body = body
        self._settings = settings
        self._observers = list(observers)
        self._seq = -1
        held = (devices.camera, devices.head, devices.lamp, devices.base, devices.teleop)
        sources = [device.faults for device in held if device is not None]
        self._watch = FaultWatch([*sources, perception.faults, *watched], settings.frame_max_age, clock.now())
        self._acted_at = clock.now()
        self._sent = Sent(Twist(), None, 0.0)
        self._intent = Intent()
        self._blocked_by_unknown = False
        self._handled_word_at = -1.0
        self._stopped = False
        self._entered = False

    # ------------------------------------------------------------------------------------- one tick

    def tick(self) -> Tick:
        """Run one control tick and return everything it saw and did."""
        now = self._clock.now()
        odometry = self._devices.base.read(now)
        head = self._devices.head.read(now)
        view, percepts = self._see(now, odometry, head)
        situation = Situation(now, percepts, odometry, head)
        word = self._devices.teleop.latest(now) if self._devices.teleop else None
        verdict = self._judge_word(word, now)
        active = self._watch.gather(now, percepts, verdict.silent)
        transitions = self._decide(situation, active, verdict)
        sent = self._act(situation, percepts, active, verdict)
        tick = Tick(
            now, self._chart.leaf, view, percepts, odometry, head, self._intent, sent, active, transitions
        )
        self._publish(tick)
        return tick

    def close(self) -> None:
        """Stop the wheels. The devices themselves are closed by whoever opened them."""
        self._devices.base.stop(self._clock.now())

    def _publish(self, tick: Tick) -> None:
        """Tell the observers; one that fails is told no more, for watching must never end the run."""
        for observe in tuple(self._observers):
            try:
                observe(tick)
            except Exception as error:
                self._observers.remove(observe)
                words = f"{type(error).__name__}: {error}"
                self._watch.remember(Fault("recorder", "error", tick.now, words))

    # ------------------------------------------------------------------------------------------ see

    def _see(self, now: float, odometry: Odometry, head: HeadPose) -> tuple[View | None, Percepts]:
        frame = self._devices.camera.latest(now)
        view = None
        if frame is not None and frame.seq != self._seq:
            self._seq = frame.seq
            view = View(frame, head, odometry.pose)
            self._perception.submit(view, self._intent.wants, now)
        return view, self._perception.collect(now)

    # --------------------------------------------------------------------------------------- decide

    def _judge_word(self, word: TeleopInput | None, now: float) -> authority.Verdict:
        if self._devices.teleop is None:
            return authority.Verdict()
        settings = self._settings
        verdict = authority.decide(
            word,
            self._handled_word_at,
            self._chart.leaf,
            now,
            settings.teleop_timeout,
            settings.teleop_max_v,
            settings.teleop_max_w,
        )
        if word is not None:
            self._handled_word_at = max(self._handled_word_at, word.at)
        return verdict

    def _decide(
        self, situation: Situation, active: tuple[Fault, ...], verdict: authority.Verdict
    ) -> tuple[Transition, ...]:
        """Faults first, then the person, then the state; returns the transitions taken."""
        action = faults.worst_action(active)
        leaf = self._chart.leaf
        transitions: list[Transition] = []
        if not self._entered:
            self._enter(leaf, situation)
        if action is faults.Action.HALT and leaf != "halted":
            return (self._go(_fault_event("fault_halted", active, action), situation),)
        if verdict.event is not None:
            return (self._go(verdict.event, situation),)
        if action >= faults.Action.STOP and leaf in AUTONOMOUS:
            if not self._stopped:
                self._stopped = True
                self._perception.forget_target()
                transitions.append(self._go(_fault_event("interrupted", active, action), situation))
            self._intent = Intent(look=self._intent.look, wants=self._intent.wants)
            return tuple(transitions)
        self._stopped = False
        self._intent, event = self._step(leaf, situation)
        if event is not None:
            transitions.extend(self._try(event, situation))
        return tuple(transitions)

    def _try(self, event: Event, situation: Situation) -> list[Transition]:
        """Take a state's own event; one the chart does not know here is that state's mistake."""
        try:
            return [self._go(event, situation)]
        except Exception as error:
            words = f"{self._chart.leaf}: {event.name}: {error}"
            self._watch.remember(Fault("loop", "error", situation.now, words))
            return []

    def _step(self, leaf: str, situation: Situation) -> tuple[Intent, Event | None]:
        try:
            return self._states[leaf].step(situation)
        except Exception as error:  # a state's mistake must stop the wheels, not end the process
            words = f"{leaf}: {type(error).__name__}: {error}"
            self._watch.remember(Fault("loop", "error", situation.now, words))
            return Intent(), None

    def _go(self, event: Event, situation: Situation) -> Transition:
        """Take a transition. The wheels stand before the chart moves: sending runs other code."""
        source = self._chart.leaf
        self._devices.base.stop(situation.now)
        self._intent = Intent(look=self._intent.look, wants=self._intent.wants)
        if event.name in ("teleop_taken", "fault_halted", "disarmed"):
            self._perception.forget_target()
        self._chart.send(event.name)
        self._enter(self._chart.leaf, situation)
        return Transition(source, self._chart.leaf, event)

    def _enter(self, leaf: str, situation: Situation) -> None:
        self._entered = True
        self._states[leaf].enter(situation)

    # ------------------------------------------------------------------------------------------ act

    def _act(
        self, situation: Situation, percepts: Percepts, active: tuple[Fault, ...], verdict: authority.Verdict
    ) -> Sent:
        """Body, guard, devices. Returns what was really sent."""
        now, pose = situation.now, situation.odometry.pose
        teleop = self._chart.leaf == "teleop"
        command = self._body.command(self._intent, situation.odometry, self._blocked_by_unknown, now)
        if teleop:
            command = replace(command, twist=verdict.twist)
        command = replace(command, lamp=self._lamp(percepts))
        stop = next((fault.key for fault in active if faults.row(fault).action >= faults.Action.STOP), None)
        if teleop and stop is not None and stop.startswith("camera."):
            stop = None  # a person may drive on blind, at the guard's blind speed
        clearance: list[Clearance] = []

        def ask(twist: Twist) -> Clearance:
            clearance.append(self._perception.clearance(pose, twist, now))
            return clearance[-1]

        free_space = percepts.free_space
        if stop is None and teleop and any(fault.device == "camera" for fault in active):
            free_space = None
        sent = guard(
            command,
            GuardInput(
                now=now,
                period=now - self._acted_at,
                previous=self._sent.twist,
                free_space_at=free_space.at if free_space is not None else None,
                clearance=ask,
                turn_free=self._perception.may_turn(pose),
                stop=stop,
                teleop=teleop,
            ),
            self._settings.guard,
        )
        self._acted_at = now
        self._blocked_by_unknown = sent.limited_by is not None and any(
            way.limited_by == "unknown" and way.distance < GLANCE_WITHIN for way in clearance
        )
        self._sent = self._send(sent, now)
        return self._sent

    def _lamp(self, percepts: Percepts) -> float:
        brightness = percepts.health.value.brightness if percepts.health is not None else None
        settings = self._settings
        return lamp_level(
            self._intent.lamp, brightness, self._sent.lamp, settings.lamp_on_below, settings.lamp_off_above
        )

    def _send(self, sent: Sent, now: float) -> Sent:
        """Hand over to the devices; returns what they really took."""
        devices = self._devices
        if sent.twist.is_zero and sent.limited_by is not None:
            devices.base.stop(now)
            twist = sent.twist
        else:
            twist = devices.base.send(sent.twist, now)
        head = devices.head.send(sent.head, now) if sent.head is not None else None
        return replace(sent, twist=twist, head=head, lamp=devices.lamp.send(sent.lamp, now))


def _fault_event(name: str, active: tuple[Fault, ...], action: faults.Action) -> Event:
    """The chart's event for the first fault that asks for this action, in the table's words."""
    fault = next(fault for fault in active if faults.row(fault).action is action)
    return Event(name, faults.row(fault).words, {"fault": fault.key, "seen": fault.evidence})
