"""Energy-bounded display: what is known of the contact is felt at once, as far as an account of energy pays for it.

Three parts: the force of the contact at the hand, the account that bounds it
(`weberlink.control.account`), and a command that stays where the robot presses with what is felt. The robot's end keeps
no account. It follows, presses a contact gently that the operator cannot have answered yet, and tells what the scene
gave beyond what it took. See docs/control.md.
"""

from math import hypot, inf, sqrt
from typing import Any

from weberlink.control.account import Account
from weberlink.control.contract import (
    CREDIT_STEP,
    LEAST_CONTACT,
    MasterControl,
    SchemeParameters,
    SentCommands,
    SlaveControl,
    Surface,
)
from weberlink.geometry.vector import ZERO, Vector, add, distance, dot, interpolate, norm, scale, subtract

TURN = 0.1  # share by which an update turns the normal of the wall: friction tilts the force to both sides in turn
FORGET = 0.99  # share of the fit of the stiffness that a further value leaves
# Way on which a pair of samples has its full weight in that fit [m]: no single pair outweighs a lasting model.
LEAST_WAY = 1e-4
SOFTEST = 50.0  # softest wall [N/m]
SAME = 2.0  # largest ratio of the stiffness of a decoded surface and of the wall at which the surface is displayed
# Distance from the robot up to which the curvature of a decoded surface is displayed [m]. Beyond it the surface goes on
# flat: samples of the near side of a dome tell nothing of the far side, and a hand that sinks in pays for it.
REACH = 0.01
WRONG = 1e-3  # largest distance of a sample from the command of its time, and of a robot without force in a wall [m]
# Damping over stiffness of a stiff contact that is felt late [s]: without it a light hand bounces off, and the robot,
# which repeats that later, presses while nothing is felt. Round trips of less than this are not late.
CALM = 0.006
LATE = 0.01  # time beyond one and a half round trips in which the operator has answered a contact [s]
# Largest force of the robot on a contact that the operator cannot have answered, times the root of the time for which
# that is so [N s^0.5]: the longer the hand pushes on without knowing, the softer.
PRESS = 1.35
# Speed at which the command leaves the place of the hand, and the robot regains its command [m/s]: on a wall with
# damping a faster one lets the contact chatter.
LEAVE = 0.03
# Speed at which the command regains the place of the hand [m/s]: a slower one keeps the robot from a contact that is
# felt.
BACK = 0.1


class FeltContact:
    """The contact at the hand.

    Attributes:
        stiffness: that of the robot's coupling as long as none is known [N/m].
        softest: stiffness of the decoded surface as long as no sample has shown one, then infinite [N/m].
        normal: of the wall; None without one.
    """

    def __init__(self, settings: SchemeParameters) -> None:
        self._coupling, self._tick_period = settings.coupling, settings.tick_period
        self.reset()

    def reset(self) -> None:
        """Forget the contact and its stiffness."""
        self._squares = self._products = 0.0
        self.stiffness, self.softest = self._coupling, inf
        self.forget()

    def forget(self) -> None:
        """Forget where the contact was."""
        self._sample: tuple[Vector, Vector] | None = None
        self._surface: Surface = None
        self._model: Surface = None
        self.normal: Vector | None = None
        self._offset = self._found = self._measured = 0.0
        self._place: float | None = None

    def depth(self, position: Vector) -> float:
        """How deep a position is in the wall of the newest sample [m]; 0 outside, and without one.

        Not in the wall of now: a held force carries that along with a robot that yields.
        """
        return 0.0 if self.normal is None else max(0.0, self._measured - dot(self.normal, position))

    def learn(self, surface: Surface, force: Vector, position: Vector) -> None:
        """Take in an update, as `MasterControl.learn`."""
        size = norm(force)
        last, self._sample = self._sample, None if size < LEAST_CONTACT else (force, position)
        self._model, self._place = surface, None
        if size >= 2.0 * LEAST_CONTACT:
            n, old = scale(force, 1.0 / size), self.normal
            if old is not None and dot(old, n) > 0.8:
                n = (old[0] + TURN * (n[0] - old[0]), old[1] + TURN * (n[1] - old[1]), old[2] + TURN * (n[2] - old[2]))
                n = scale(n, 1.0 / norm(n))
            self.normal = n
            if last is not None:
                way = subtract(position, last[1])
                along = dot(n, way)
                if along * along > 0.5 * dot(way, way):  # pressed rather than slid
                    self._fit(along, dot(n, subtract(last[0], force)))
            self._offset = self._found = self._measured = dot(n, position) + dot(n, force) / self.stiffness
        if surface is not None and self._squares == 0.0:  # a surface that is right brings no sample to fit
            self.softest = max(SOFTEST, surface.stiffness)
        fits = surface is not None and self.stiffness < SAME * surface.stiffness < SAME * SAME * self.stiffness
        self._surface = surface if fits else None

    def _fit(self, way: float, fall: float) -> None:
        """Take in that over a way out of the wall [m] the force fell by so much [N]."""
        share = 1.0 if -LEAST_WAY <= way <= LEAST_WAY else LEAST_WAY / abs(way)
        self._squares = FORGET * self._squares + share * share * way * way
        self._products = FORGET * self._products + share * share * way * fall
        if self._squares > 0.1 * LEAST_WAY * LEAST_WAY:
            found, stiffest = self._products / self._squares, self._coupling
            self.stiffness = stiffest if found > stiffest else found if found > SOFTEST else SOFTEST
            self.softest = inf

    def at(self, hand: Vector, force: Vector, robot: Vector, tick: float, rtt: float = 0.0) -> Vector:
        """The force of the contact at the hand [N]; `force` is decoded there, `tick` is that of the other side from
        which the newest news can be: by now it is half a round trip `rtt` [s] ahead.
        """
        if self.normal is not None:
            self._anchor(self.normal, robot, force if self._model is None else self._model.at(tick, robot))
        n, surface, offset = self.normal, self._surface, self._offset
        if surface is not None and rtt > 0.0:  # one that moves is displayed where it is by now
            now = tick + 0.5 * rtt / self._tick_period
            force = add(force, subtract(surface.at(now, hand), surface.at(tick, hand)))
            tick = now
        size = norm(force)
        touches = size >= LEAST_CONTACT
        if n is None:
            if surface is not None and size >= 2.0 * LEAST_CONTACT:  # the robot's command needs a wall to leave
                self.normal = n = scale(force, 1.0 / size)
                self._offset = self._found = self._measured = dot(n, hand) + size / self.stiffness
            return force
        if surface is not None:
            far = distance(hand, robot)
            if far > REACH:
                edge = interpolate(robot, hand, REACH / far)
                there = surface.at(tick, edge)
                size = norm(there)
                if size < LEAST_CONTACT:  # the robot is above it: what is decoded is newer than the last wall
                    return force
                n = scale(there, 1.0 / size)
                offset = dot(n, edge) + size / self.stiffness
            elif touches:
                return force
        (a, b, c), (x, y, z) = n, force
        push = max(0.0, self.stiffness * (offset - (a * hand[0] + b * hand[1] + c * hand[2])))
        if push == 0.0 or not touches:
            return (a * push, b * push, c * push)
        along = a * x + b * y + c * z
        share = min(1.0, push / along) if along > 0.0 else 0.0  # of what friction adds
        push -= share * along
        return (share * x + push * a, share * y + push * b, share * z + push * c)

    def _anchor(self, n: Vector, robot: Vector, there: Vector) -> None:
        """Move the wall of the normal n to the newest known place of the robot [m] and its force there [N]."""
        (a, b, c), model = n, self._model
        place = a * robot[0] + b * robot[1] + c * robot[2]
        if norm(there) < LEAST_CONTACT:
            self._place = None
            if place < self._found - WRONG:
                self.normal = None  # the robot is in this wall and feels none
            self._offset = min(self._offset, place)
            return
        if model is not None and self._place is not None:
            way = place - self._place
            self._fit(way, way * model.stiffness)
        self._place = place
        # A robot that does not follow brings no update either, while the command goes on.
        sample = self._sample
        if sample is None or there != sample[0] or abs(place - dot(n, sample[1])) < WRONG:
            self._offset = self._found = place + (a * there[0] + b * there[1] + c * there[2]) / self.stiffness

    def damped(self, force: Vector, speed: Vector, time: float) -> Vector:
        """The force of the contact [N] at a hand of this speed [m/s], with damping: of one as stiff as the robot's
        coupling its stiffness times `time` [s], of a softer one less by the square, since no hand bounces off that.

        It neither pulls nor more than doubles, so it begins and ends with the contact; friction changes with it.
        """
        n = self.normal
        along = 0.0 if n is None else dot(n, force)
        if n is None or along <= 0.0:
            return force
        damping = time * self.stiffness * self.stiffness / self._coupling
        share = 1.0 - damping * dot(n, speed) / along
        return scale(force, max(0.0, min(2.0, share)))


class BoundedMaster(MasterControl):
    """The operator's end.

    The command leaves the contact, along its normal, by what is known and not displayed: so the robot presses with what
    is felt. Source of the idea: force-matched commands, Mitra, Niemeyer, "Model-mediated telemanipulation", Int. J.
    Robotics Research 27(2), 2008.
    """

    def __init__(self, settings: SchemeParameters) -> None:
        self._delay = settings.delay
        self._account = Account(settings.account)
        self._contact = FeltContact(settings)
        self._sent = SentCommands(settings.tick_period, settings.longest)
        self.reset()

    def reset(self) -> None:
        self._account.reset()
        self._contact.reset()
        self._credit = 0
        self._forget()

    def resume(self, peer_credit: int) -> None:
        self._account.resume()
        self._contact.forget()
        self._credit = max(self._credit, peer_credit)
        self._forget()

    def _forget(self) -> None:
        self._sent.reset()
        self._position: Vector | None = None
        self._way: Vector = ZERO  # of the hand since the tick before
        self._held: Vector = ZERO
        self._stated: Vector = ZERO
        self._back: Vector = ZERO
        self._elapsed = self._tick = 0.0
        self._rtt = self._delay

    @property
    def energy(self) -> float:
        return self._account.energy

    @property
    def stiffness(self) -> float:
        return self._contact.stiffness

    def refute(self) -> None:
        self._contact.normal = None

    def learn(self, surface: Surface, force: Vector, position: Vector) -> None:
        self._contact.learn(surface, force, position)

    # As wide as in the base class: compiled code takes no narrower argument.
    def observe(self, position: Any, elapsed: float, tick: float, peer_credit: int, rtt: float | None) -> None:
        here: Vector = position
        last, held = self._position or here, self._held
        x, y, z = here[0] - last[0], here[1] - last[1], here[2] - last[2]
        supplied = 0.0
        if peer_credit > self._credit:
            supplied = (peer_credit - self._credit) * CREDIT_STEP
            self._credit = peer_credit
        self._account.book(held[0] * x + held[1] * y + held[2] * z, x * x + y * y + z * z, elapsed, supplied)
        self._position, self._elapsed, self._tick, self._way = here, elapsed, tick, (x, y, z)
        if rtt is not None:
            self._rtt = rtt + self._delay

    def command(self, position: Vector) -> Vector:
        n, goal = self._contact.normal, ZERO
        if n is not None and self._stated != self._held:
            (a, b, c), (x, y, z), (u, v, w) = n, self._stated, self._held
            stated, lack = a * x + b * y + c * z, a * (x - u) + b * (y - v) + c * (z - w)
            if 0.0 < lack <= stated:  # a share of the depth: whatever the fit of the stiffness, not out of the contact
                goal = scale(n, min(lack / self.stiffness, lack / stated * self._contact.depth(position)))
        back = self._back
        if goal != back:
            most = (LEAVE if dot(goal, goal) > dot(back, back) else BACK) * self._elapsed
            way = distance(back, goal)
            self._back = back = goal if way <= most else interpolate(back, goal, most / way)
        if back != ZERO:
            position = add(position, back)
        self._sent.add(position)
        return position

    def render(self, force: Any) -> Vector:
        contact, rtt = self._contact, self._rtt
        stated: Vector = force
        if self._position is not None:
            stated = contact.at(self._position, stated, self._sent.ago(rtt), self._tick, rtt)
            if rtt > CALM:
                (x, y, z), elapsed = self._way, self._elapsed
                speed = (x / elapsed, y / elapsed, z / elapsed) if elapsed > 0.0 else ZERO
                stated = contact.damped(stated, speed, min(CALM, rtt - CALM))
        self._stated = stated
        x, y, z = stated
        share = self._account.share(hypot(x, y, z), contact.stiffness, self._elapsed, contact.softest)
        return stated if share == 1.0 else (share * x, share * y, share * z)

    def displayed(self, force: Any) -> None:
        self._held = force


class BoundedSlave(SlaveControl):
    """The robot's end."""

    def __init__(self, settings: SchemeParameters) -> None:
        self._delay = settings.delay
        self.reset()

    def reset(self) -> None:
        self._given = 0.0
        self.resume(0)

    def resume(self, peer_credit: int) -> None:  # noqa: ARG002
        self._before: tuple[Vector, Vector] | None = None
        self._stored = self._age = 0.0
        self._force: Vector = ZERO
        self._size = 0.0
        self._waits = False
        self._target: Vector | None = None

    @property
    def credit(self) -> int:
        """What the scene gave beyond what it took, summed over all contacts."""
        return int(self._given / CREDIT_STEP)

    def follow(self, target: Vector, here: Vector, elapsed: float, peer_credit: int, rtt: float | None) -> Vector:  # noqa: ARG002
        (x, y, z), size = self._force, self._size
        last, self._target = self._target or target, target
        # An open contact becomes a new one as slowly as it was answered: the operator knows the wall of the last tap.
        if size < LEAST_CONTACT:
            self._age, self._waits = max(0.0, self._age - elapsed), False
            return target
        answered = 1.5 * ((rtt or 0.0) + self._delay) + LATE
        self._age = min(self._age + elapsed, answered)
        is_new = size >= PRESS / sqrt(answered) and self._age < answered
        if not (is_new or self._waits):
            return target
        a, b, c = x / size, y / size, z / size
        inward = (here[0] - target[0]) * a + (here[1] - target[1]) * b + (here[2] - target[2]) * c
        own = (last[0] - target[0]) * a + (last[1] - target[1]) * b + (last[2] - target[2]) * c
        self._waits, most = True, 0.0 if is_new else max(0.0, own) + LEAVE * elapsed
        if inward <= most:
            self._waits = most == 0.0
            return target
        back = inward - most
        return (target[0] + back * a, target[1] + back * b, target[2] + back * c)

    def observe(self, position: Vector, force: Vector) -> None:
        before, self._before = self._before, (position, force)
        self._force, self._size = force, hypot(*force)
        if before is None or self._size < LEAST_CONTACT:
            self._stored = 0.0
            return
        p, f = before
        x, y, z = position[0] - p[0], position[1] - p[1], position[2] - p[2]
        self._stored -= 0.5 * ((force[0] + f[0]) * x + (force[1] + f[1]) * y + (force[2] + f[2]) * z)
        if self._stored < 0.0:
            self._given -= self._stored
            self._stored = 0.0
