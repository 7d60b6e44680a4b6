"""The control tick: read -> see -> judge faults -> person -> state -> body -> guard -> act -> publish.

It never waits: vision is asked for and collected, devices return their newest value. Motors are stopped
before an event is sent, for sending runs other code.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from dataclasses import replace
from typing import TypeVar

from robot import authority, faults
from robot.clock import Clock
from robot.fault_watch import FaultSource, FaultWatch
from robot.guard import GuardInput, guard
from robot.hal.interfaces import DatedHead
from robot.lamp_control import LampWatch, lamp_level
from robot.loop_interfaces import BodyLike, ChartLike, Devices, LoopSettings, PerceptionLike, StateLike
from robot.messages import (
    Clearance,
    Command,
    Event,
    Fault,
    HeadPose,
    Intent,
    Near,
    Odometry,
    Percepts,
    Sent,
    Situation,
    Tick,
    Transition,
    Twist,
    View,
)
from robot.pose_history import PoseHistory
from robot.status_line import status_line

T = TypeVar("T")

GLANCE_WITHIN = 0.5  # metres: unseen floor nearer than this is worth a look down
TELL_EVERY = 0.5  # seconds between two status lines for the person at the stick
BEGIN_AUTONOMY = ("armed", "teleop_resumed")
AUTONOMOUS = ("search", "recognize", "range", "track", "avoid")


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
        self._lamp_watch = LampWatch()
        self._poses = PoseHistory()
        self._dated = devices.head if isinstance(devices.head, DatedHead) else None
        held = (devices.camera, devices.head, devices.lamp, devices.base, devices.teleop, devices.near)
        told = [device.faults for device in (*held, devices.arm) if device is not None]
        sources = [*told, perception.faults, self._lamp_watch.faults, *watched]
        self._watch = FaultWatch(sources, settings.frame_max_age, clock.now(), settings.period)
        self._acted_at = clock.now()
        self._sent = Sent(Twist(), None, 0.0)
        self._intent = Intent()
        self._blocked_by_unknown = False
        self._handled_word_at = -1.0
        self._held = False
        self._told_at = -TELL_EVERY
        self._stopped = False
        self._entered = False

    # ------------------------------------------------------------------------------------- one tick

    def tick(self) -> Tick:
        """Run one control tick and return everything it saw and did."""
        now = self._clock.now()
        odometry = self._devices.base.read(now)
        head = self._devices.head.read(now)
        near = self._devices.near.read(now) if self._devices.near is not None else None
        nothing: tuple[View | None, Percepts] = (None, Percepts())
        view, percepts = self._guarded("seeing", lambda: self._see(now, odometry, head), nothing, now)
        situation = Situation(now, percepts, odometry, head)
        verdict = self._listen(now)
        active = self._watch.gather(now, percepts, verdict.silent, near)
        transitions = self._decide(situation, active, verdict)
        sent = self._act(situation, active, verdict, near)
        self._tell(sent, active, now)
        tick = Tick(
            now, self._chart.leaf, view, percepts, odometry, head, self._intent, sent, active, transitions
        )
        self._publish(tick)
        return tick

    def close(self) -> None:
        """Stop the wheels, put the lamp out. The devices themselves are closed by whoever opened them."""
        now = self._clock.now()
        self._devices.base.stop(now)
        self._devices.lamp.send(0.0, now)

    def _tell(self, sent: Sent, active: tuple[Fault, ...], now: float) -> None:
        """A status line for the person at the stick."""
        teleop = self._devices.teleop
        if teleop is not None and now - self._told_at >= TELL_EVERY - 1e-9:
            self._told_at = now
            teleop.tell(status_line(self._chart.leaf, sent, self._devices.base.battery_volts(), active), now)

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
        """Submit a new picture with where base and head were when it was taken; collect what was seen."""
        self._poses.add(odometry, head, self._dated.read_at if self._dated is not None else now)
        frame = self._devices.camera.latest(now)
        view = None
        if frame is not None and frame.seq != self._seq:
            self._seq = frame.seq
            view = View(frame, self._poses.head(frame.captured_at), self._poses.base(frame.captured_at))
            self._perception.submit(view, self._intent.wants, now)
        return view, self._perception.collect(now)

    def _guarded(self, where: str, work: Callable[[], T], otherwise: T, now: float) -> T:
        """A mistake of the program must stop the wheels, not end the process: the person needs the loop."""
        try:
            return work()
        except Exception as error:
            words = f"{self._chart.leaf}: {where}: {type(error).__name__}: {error}"
            self._watch.remember(Fault("loop", "error", now, words))
            return otherwise

    # --------------------------------------------------------------------------------------- decide

    def _listen(self, now: float) -> authority.Verdict:
        """What the person at the stick says."""
        link, settings = self._devices.teleop, self._settings
        if link is None:
            return authority.Verdict()
        word = link.latest(now)
        verdict = authority.decide(
            word,
            self._handled_word_at,
            self._chart.leaf,
            now,
            settings.teleop_timeout,
            settings.teleop_max_v,
            settings.teleop_max_w,
            link_down=any(fault.kind == "link" for fault in link.faults(now)),
            held=self._held,
        )
        self._held = verdict.held
        if word is not None:
            self._handled_word_at = max(self._handled_word_at, word.at)
        return verdict

    def _decide(
        self, situation: Situation, active: tuple[Fault, ...], verdict: authority.Verdict
    ) -> tuple[Transition, ...]:
        """Faults first, then the person, then the state; returns the transitions taken."""
        leaf = self._chart.leaf
        action = faults.worst_action(active, leaf)
        transitions: list[Transition] = []
        if not self._entered:
            self._enter(leaf, situation)
        if action is faults.Action.HALT and leaf != "halted":
            return (self._go(_fault_event("fault_halted", active, action), situation),)
        if verdict.event is not None and not _refused(verdict.event, active):
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
        nothing: list[Transition] = []
        return self._guarded(event.name, lambda: [self._go(event, situation)], nothing, situation.now)

    def _step(self, leaf: str, situation: Situation) -> tuple[Intent, Event | None]:
        standing: tuple[Intent, Event | None] = (Intent(), None)
        return self._guarded("step", lambda: self._states[leaf].step(situation), standing, situation.now)

    def _go(self, event: Event, situation: Situation) -> Transition:
        """Take a transition. The wheels stand before the chart moves: sending runs other code."""
        source = self._chart.leaf
        self._devices.base.stop(situation.now)
        self._intent = Intent(look=self._intent.look, wants=self._intent.wants)
        if event.name in ("teleop_taken", "fault_halted", "disarmed"):
            self._perception.forget_target()
        if event.name == "armed":
            self._perception.set_down()
        self._chart.send(event.name)
        self._enter(self._chart.leaf, situation)
        return Transition(source, self._chart.leaf, event)

    def _enter(self, leaf: str, situation: Situation) -> None:
        self._entered = True
        self._guarded("enter", lambda: self._states[leaf].enter(situation), None, situation.now)

    # ------------------------------------------------------------------------------------------ act

    def _act(
        self,
        situation: Situation,
        active: tuple[Fault, ...],
        verdict: authority.Verdict,
        near: Near | None,
    ) -> Sent:
        """Body, guard, devices. Returns what was really sent."""
        now, pose, percepts = situation.now, situation.odometry.pose, situation.percepts
        leaf = self._chart.leaf
        teleop = leaf == "teleop"
        command = self._guarded(
            "body",
            lambda: self._body.command(self._intent, situation.odometry, self._blocked_by_unknown, now),
            # Expired, so that the guard stops; a person at the stick needs no body to drive on.
            Command(expires_at=now + self._settings.period if teleop else 0.0),
            now,
        )
        if teleop:
            command = replace(command, twist=verdict.twist)
        command = replace(command, lamp=self._lamp(percepts, now))
        stop = next((f.key for f in active if faults.action(f, leaf) >= faults.Action.STOP), None)
        clearance: list[Clearance] = []

        def ask(twist: Twist) -> Clearance:
            clearance.append(self._perception.clearance(pose, twist, now))
            return clearance[-1]

        free_space = percepts.free_space
        if teleop and any(faults.row(fault).action >= faults.Action.STOP for fault in active):
            free_space = None  # a person drives on past a fault of the eyes: blind, at the guard's speed
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
                near=near,
            ),
            self._settings.guard,
        )
        self._acted_at = now
        self._blocked_by_unknown = sent.limited_by is not None and any(
            way.limited_by == "unknown" and way.distance < GLANCE_WITHIN for way in clearance
        )
        self._sent = self._send(sent, now)
        if self._devices.arm is not None:
            self._devices.arm.act(situation, stop is not None or leaf not in AUTONOMOUS)
        return self._sent

    def _lamp(self, percepts: Percepts, now: float) -> float:
        health, settings = percepts.health, self._settings
        brightness = health.value.brightness if health is not None else None
        seen_at = health.at if health is not None else None
        self._lamp_watch.note(self._sent.lamp, brightness, seen_at, now)
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


def _refused(event: Event, active: tuple[Fault, ...]) -> bool:
    """Autonomy is not begun over a fault that would end it at once."""
    return event.name in BEGIN_AUTONOMY and faults.worst_action(active) is faults.Action.HALT


def _fault_event(name: str, active: tuple[Fault, ...], action: faults.Action) -> Event:
    """The chart's event for the first fault that asks for this action, in the table's words."""
    fault = next(fault for fault in active if faults.row(fault).action is action)
    return Event(name, faults.row(fault).words, {"fault": fault.key, "seen": fault.evidence})
