"""The command protocol of docs/commands.md as a finite model, and a search through all it can do.

Two senders and two robots share one key. The attacker is the wire: whatever was ever said can be dropped,
delayed, repeated, reordered and delivered to anybody; what carries no proof can be forged. Time is counted in
windows: a command is fresh in the window of the announcement it answers and in the next.
"""

from __future__ import annotations

from collections import deque
from dataclasses import dataclass, replace
from functools import partial
from typing import NamedTuple

FRESH = 1  # windows; command_timeout_s of the robot
JUMP = 3  # how far a sequence may grow at once; 1000 on the robot
COUNTER_MAX = 9  # of the model's sequence counter

# Rules that can be taken away one by one; each must then be missed.
RULES = frozenset(
    {
        "announcements are signed",
        "sender checks the robot's name",
        "sender waits for an answer to itself",
        "sender checks who is confirmed",
        "sender counts for itself",
        "command is bound to the session",
        "command answers a recent announcement",
        "sequence grows",
        "sequence jumps are bounded",
        "command is bound to the turn",
        "disarm begins a turn",
        "arm request expires",
    }
)


class Announcement(NamedTuple):
    robot: int
    session: int
    clock: int
    turn: int
    turn_sender: int  # who began the turn, and with which message; -1: the start did
    turn_sequence: int
    to: int  # whom it answers; -1: everybody
    sequence: int  # the last of `to` that was taken


class Message(NamedTuple):
    session: int
    heard: int
    sender: int
    sequence: int
    turn: int
    action: str  # ask, arm, disarm, drive
    signed_at: int  # ghost: the world's clock


class Robot(NamedTuple):
    session: int
    started: int  # the world's clock at its start; its own begins at 0
    turn: int = 0
    turn_sender: int = -1
    turn_sequence: int = 0
    on: bool = False
    pending: int = -1  # world time until which an arm request may still take effect; -1: none
    pending_signed: int = -1
    ready: bool = True
    senders: tuple = ((0, -1), (0, -1))  # last sequence, newest announcement answered


class Sender(NamedTuple):
    phase: str = "idle"  # idle, asked, bound, done, overtaken
    session: int = -1
    clock: int = -1
    turn: int = -1
    sequence: int = 0
    first: int = 0  # sequence of the act's first signature
    signatures: int = 0
    obeyed: tuple = ()  # ghosts: what of it the robot did, somebody disarmed since, others began a turn since
    disarmed_since: bool = False
    turns_since: bool = False


class State(NamedTuple):
    now: int
    robots: tuple
    senders: tuple
    air: frozenset


@dataclass(frozen=True)
class Scenario:
    """What the two senders want of which robot."""

    acts: tuple  # (action, robot) per sender
    ready: bool = True  # false: the robot could arm only later
    restart: bool = False  # robot 0 may be started again
    rules: frozenset = RULES
    signatures: int = 2  # how often a sender signs one act: the second is a retransmission
    horizon: int = 2  # windows


class Violation(Exception):
    pass


def put(values: tuple, index: int, value) -> tuple:
    return (*values[:index], value, *values[index + 1 :])


class Search:
    def __init__(self, scenario: Scenario):
        self.scenario = scenario
        self.states = 0

    def has(self, rule: str) -> bool:
        assert rule in RULES, rule
        return rule in self.scenario.rules

    # The robot

    def announcement(self, state: State, r: int, to: int = -1) -> Announcement:
        robot = state.robots[r]
        sequence = robot.senders[to][0] if to >= 0 else max(last for last, _ in robot.senders)
        return Announcement(
            r,
            robot.session,
            state.now - robot.started,
            robot.turn,
            robot.turn_sender,
            robot.turn_sequence,
            to,
            sequence,
        )

    def take(self, state: State, r: int, m: Message) -> State | None:
        """The robot's judgement of an authentic message; None: refused without a word."""
        robot = state.robots[r]
        clock = state.now - robot.started
        last, newest = robot.senders[m.sender]
        if self.has("command is bound to the session") and m.session != robot.session:
            return None
        recent = newest <= m.heard <= clock and clock - m.heard <= FRESH
        if self.has("command answers a recent announcement") and not recent:
            return None
        if self.has("sequence grows") and m.sequence <= last:
            return None
        if self.has("sequence jumps are bounded") and m.sequence - last > JUMP:
            return None
        robot = robot._replace(senders=put(robot.senders, m.sender, (m.sequence, m.heard)))
        state = state._replace(robots=put(state.robots, r, robot))
        if m.action != "ask" and (m.turn == robot.turn or not self.has("command is bound to the turn")):
            state = self.obey(state, r, m)
        reply = self.announcement(state, r, m.sender)
        return state._replace(air=state.air | {reply})

    def obey(self, state: State, r: int, m: Message) -> State:
        self.judge_obedience(state, r, m)
        robot, senders = state.robots[r], state.senders
        if m.action != "drive" and (m.action != "disarm" or self.has("disarm begins a turn")):
            robot = robot._replace(turn=robot.turn + 1, turn_sender=m.sender, turn_sequence=m.sequence)
        if m.action == "arm":
            until = m.heard + robot.started + FRESH if self.has("arm request expires") else 99
            robot = robot._replace(pending=until, pending_signed=m.signed_at)
        if m.action == "disarm":
            robot = robot._replace(on=False, pending=-1)
        senders = put(
            senders, m.sender, senders[m.sender]._replace(obeyed=(*senders[m.sender].obeyed, m.sequence))
        )
        for s, (_, target) in enumerate(self.scenario.acts):
            if s != m.sender and target == r:
                disarmed = senders[s].disarmed_since or m.action == "disarm"
                senders = put(senders, s, senders[s]._replace(disarmed_since=disarmed, turns_since=True))
        return self.settle(state._replace(robots=put(state.robots, r, robot), senders=senders), r)

    def settle(self, state: State, r: int) -> State:
        """A wanted robot that is ready arms; a request whose time is over is forgotten."""
        robot = state.robots[r]
        if robot.pending >= 0 and state.now > robot.pending:
            robot = robot._replace(pending=-1)
        if robot.pending >= 0 and robot.ready:
            if state.now - robot.pending_signed > FRESH:
                raise Violation("late: armed long after it was asked")
            robot = robot._replace(on=True, pending=-1)
        return state._replace(robots=put(state.robots, r, robot))

    def judge_obedience(self, state: State, r: int, m: Message) -> None:
        sender = state.senders[m.sender]
        if self.scenario.acts[m.sender][1] != r:
            raise Violation("wrong robot")
        if state.now - m.signed_at > FRESH:
            raise Violation("late: obeyed long after it was signed")
        if sender.disarmed_since and m.action != "disarm":
            raise Violation("after a later disarm")
        if m.sequence in sender.obeyed or (m.action != "drive" and sender.obeyed):
            raise Violation("twice")

    # The sender

    def hear(self, state: State, s: int, a: Announcement) -> State | None:
        sender = state.senders[s]
        action, target = self.scenario.acts[s]
        if self.has("sender checks the robot's name") and a.robot != target:
            return None
        if sender.phase == "idle":
            bound = self.next_of(sender, a)._replace(turns_since=False)
            if not self.has("sender waits for an answer to itself"):
                return self.decide(state, s, bound, a)
            return self.say(state, s, bound._replace(phase="asked"), a, "ask")
        proven = a.to == s and a.sequence >= sender.first
        if sender.phase == "asked":
            if a.session != sender.session or not proven or a.clock < sender.clock:
                return None
            return self.decide(state, s, self.next_of(sender, a), a)
        if sender.phase == "bound":
            return self.follow(state, s, a, action, proven)
        return None

    def next_of(self, sender: Sender, a: Announcement) -> Sender:
        last = sender.sequence if self.has("sender counts for itself") else a.sequence
        first = last + 1
        return sender._replace(
            session=a.session, clock=a.clock, turn=a.turn, sequence=first, first=first, signatures=1
        )

    def decide(self, state: State, s: int, sender: Sender, a: Announcement) -> State:
        sender = sender._replace(phase="bound", disarmed_since=False)
        return self.say(state, s, sender, a, self.scenario.acts[s][0])

    def say(self, state: State, s: int, sender: Sender, a: Announcement, action: str) -> State:
        m = Message(
            sender.session, a.clock, s, min(sender.sequence, COUNTER_MAX), sender.turn, action, state.now
        )
        return state._replace(senders=put(state.senders, s, sender), air=state.air | {m})

    def follow(self, state: State, s: int, a: Announcement, action: str, proven: bool) -> State | None:
        sender = state.senders[s]
        if self.has("sender checks who is confirmed"):
            if a.session != sender.session or a.clock < sender.clock:
                return None
            mine = (a.turn_sender == s and a.turn_sequence >= sender.first) or (
                action == "drive" and a.turn == sender.turn and proven
            )
        else:
            mine = a.sequence >= sender.first  # any robot's, any sender's
        if mine:
            if not sender.obeyed:
                raise Violation("false success: the sender was told so, the robot did nothing")
            return state._replace(senders=put(state.senders, s, sender._replace(phase="done")))
        if a.turn > sender.turn:
            if not sender.turns_since:
                raise Violation("locked out: the sender gave up although nobody was faster")
            return state._replace(senders=put(state.senders, s, sender._replace(phase="overtaken")))
        if sender.signatures < self.scenario.signatures:
            again = sender._replace(
                clock=a.clock, sequence=sender.sequence + 1, signatures=sender.signatures + 1
            )
            return self.say(state, s, again, a, action)
        return None

    def forged(self, state: State, s: int) -> list[Announcement]:
        """What an announcement without proof may say."""
        if self.has("announcements are signed"):
            return []
        sender, target = state.senders[s], self.scenario.acts[s][1]
        robot = state.robots[target]
        clock = state.now - robot.started
        confirms = Announcement(target, robot.session, clock, robot.turn + 1, s, sender.sequence, s, 9)
        exhausts = Announcement(target, robot.session, clock, robot.turn, -1, 0, s, COUNTER_MAX)
        return [confirms, exhausts]

    # Everything that can happen next

    def next_states(self, state: State):
        """What can happen, as functions that do it."""
        if state.now < self.scenario.horizon:
            yield partial(self.later, state)
        for r, robot in enumerate(state.robots):
            if not robot.ready:
                yield partial(self.made_ready, state, r)
            if r == 0 and self.scenario.restart and robot.started == 0 and state.now > 0:
                yield partial(self.started_again, state, r)
        senders = range(len(state.senders))
        for m in state.air:
            if isinstance(m, Message):
                yield from (partial(self.take, state, r, m) for r in range(len(state.robots)))
            else:
                yield from (partial(self.hear, state, s, m) for s in senders if m.to in (-1, s))
        for s in senders:
            yield from (partial(self.hear, state, s, a) for a in self.forged(state, s))

    def made_ready(self, state: State, r: int) -> State:
        return self.settle(
            state._replace(robots=put(state.robots, r, state.robots[r]._replace(ready=True))), r
        )

    def started_again(self, state: State, r: int) -> State:
        again = Robot(session=10, started=state.now, ready=state.robots[r].ready)
        return self.heard_by_all(state._replace(robots=put(state.robots, r, again)))

    def heard_by_all(self, state: State) -> State:
        said = {self.announcement(state, r) for r in range(len(state.robots))}
        return state._replace(air=state.air | said)

    def later(self, state: State) -> State:
        state = state._replace(now=state.now + 1)
        for r in range(len(state.robots)):
            state = self.settle(state, r)
        return self.heard_by_all(state)

    # What can never again change anything is forgotten; only where the rule that makes it so is in force

    def tidy(self, state: State) -> State:
        air = frozenset(
            m
            for m in state.air
            if not (self.spent(state, m) if isinstance(m, Message) else self.stale(state, m))
        )
        return state._replace(air=air)

    def spent(self, state: State, m: Message) -> bool:
        if not self.has("command is bound to the session"):
            return False
        robot = next((robot for robot in state.robots if robot.session == m.session), None)
        if robot is None:
            return True
        late = state.now - robot.started > m.heard + FRESH
        used = m.sequence <= robot.senders[m.sender][0]
        return (late and self.has("command answers a recent announcement")) or (
            used and self.has("sequence grows")
        )

    def stale(self, state: State, a: Announcement) -> bool:
        if not self.has("sender checks who is confirmed"):
            return False
        for s, sender in enumerate(state.senders):
            if a.to not in (-1, s) or sender.phase in ("done", "overtaken"):
                continue
            if self.has("sender checks the robot's name") and a.robot != self.scenario.acts[s][1]:
                continue
            if sender.phase == "idle":
                return False
            news = (
                a.turn > sender.turn
                or sender.phase == "asked"
                or sender.signatures < self.scenario.signatures
            )
            confirms = a.to == s or a.turn_sender == s
            if a.session == sender.session and a.clock >= sender.clock and (news or confirms):
                return False
        return True

    def still_commandable(self, state: State) -> None:
        """Nobody is ever locked out: with the wire at peace, the robot takes a sender's next message."""
        for s, (_, r) in enumerate(self.scenario.acts):
            sender = state.senders[s]
            a = self.announcement(state, r)
            sequence = 1 + (sender.sequence if self.has("sender counts for itself") else a.sequence)
            last = state.robots[r].senders[s][0]
            if sequence > COUNTER_MAX or (self.has("sequence grows") and sequence <= last):
                raise Violation("locked out: the counter is exhausted")

    def start(self) -> State:
        robots = tuple(Robot(session=r, started=0, ready=self.scenario.ready) for r in range(2))
        senders = tuple(Sender() for _ in self.scenario.acts)
        on = any(action != "arm" for action, _ in self.scenario.acts)
        robots = tuple(robot._replace(on=on) for robot in robots)
        return self.heard_by_all(State(0, robots, senders, frozenset()))

    def run(self, sought: str = "") -> str | None:
        """The first violation whose name begins so, or None when no reachable state has one. Ways through
        other violations are not followed."""
        first = self.start()
        seen, queue = {first}, deque([first])
        try:
            while queue:
                state = queue.popleft()
                self.still_commandable(state)
                for happens in self.next_states(state):
                    try:
                        following = happens()
                    except Violation as found:
                        if str(found).startswith(sought):
                            raise
                        continue
                    following = following and self.tidy(following)
                    if following and following not in seen:
                        seen.add(following)
                        queue.append(following)
        except Violation as found:
            return str(found)
        finally:
            self.states = len(seen)
        return None


def without(scenario: Scenario, *rules: str) -> Scenario:
    return replace(scenario, rules=scenario.rules - set(rules))
