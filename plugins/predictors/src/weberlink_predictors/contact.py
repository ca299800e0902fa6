"""Estimates the surface in contact, tick by tick, with exponentially weighted sums.

Let p be the position of the probe, f the force, n the normal, s the stiffness and c = 1/s. The contact point on the
surface is q = p + c f. Each of four hypotheses estimates c:

- The surface is at rest and has no friction: the force is along the normal, and n.dp = -c n.df over a few ticks.
- It is at rest and has friction: the force without its part along dq, the direction of sliding, gives the normal, which
  is averaged. The slow part of n.dp and n.df (sliding over a surface that is not flat) is removed before they are
  compared.
- It is at rest and damps, with the time T = damping / stiffness: n.dp = -c n.df - T n.dv, where v is the change of p
  in a tick. The normal is that with friction.
- It moves: third differences of n.p and n.f are compared, to which a slow motion contributes little.

Curvature is the turn of the normal per displacement of q. The frequency w of a motion follows from second differences
of n.q over a time T: they are -4 sin^2(w T / 2) times the deviation of n.q from its mean.

`weberlink_predictors.adaptive` compares the hypotheses by the updates that they save.
"""

from math import asin, exp, sqrt

from weberlink.geometry.vector import ZERO, Vector, add, dot, norm, scale, subtract, unit
from weberlink_predictors.estimation import History, Signal

STEP_S = 0.010  # Time over which displacements and changes of force are taken [s]
TURN_S = 0.030  # Time over which a turn of the normal is taken [s]
THIRD_S = 0.016  # Time between the samples of a third difference [s]
SECOND_S = 0.060  # Time between the samples of a second difference [s]: two of them must fit into the history
EVERY_S = 0.004  # Time from one update of the slower estimates (curvature, motion) to the next [s]
MEMORY_STIFFNESS_S = 2.0  # `MEMORY_...`: time constant with which samples are forgotten [s]
MEMORY_CURVATURE_S = 0.3
MEMORY_THIRD_S = 2.0
MEMORY_FREQUENCY_S = 10.0 / 3.0
SLOW_S = 0.050  # Time constant of the average of the slow part [s]
NORMAL_S = 0.010  # Time constant of the average of the normal while the probe slides by 1 mm or more in `STEP_S` [s]
FRICTION_S = 0.020  # Time constant of the average of the coefficient of friction [s]
LEAST_WAYS = 2.5e-7  # With so small a sum of squared displacements, a curvature is estimated at half its value [m^2]
LEAST_WAY = 3e-5  # Displacement over `STEP_S` that counts as sliding [m]
LEAST_CHANGE = 1e-7  # Smallest integral of squared changes of force that gives an estimate [N^2 s]; `LEAST_THIRD` too
LEAST_THIRD = 1e-5
LEAST_INDEPENDENCE = 1e-6  # Least share of the squared change of speed that the change of force leaves unexplained
MOST_COMPLIANT, STIFFEST = 1e-1, 1e-6
"""Range of accepted compliance [m/N]."""
LARGEST_FRICTION = 1.5
LEAST_NORMAL_SHARE = 0.5  # Of the force, across the sliding direction; with less, the probe is pressed, not slid
SAME_SURFACE = 0.9  # Cosine between the old normal and the force of a new contact from which on the old one is kept


class ComplianceEstimator:
    """Compliance -y/x by weighted least squares over pairs of changes of force x [N] and of position y [m]."""

    __slots__ = ("_forget", "_least", "_xx", "_xy", "compliance")

    def __init__(self, forget: float, least: float) -> None:
        self._forget = forget
        self._least = least
        self._xx = self._xy = 0.0
        self.compliance = 0.0  # [m/N]; 0 while unknown

    def add(self, x: float, y: float) -> None:
        self._xx = self._xx * self._forget + x * x
        self._xy = self._xy * self._forget + x * y
        if self._xx > self._least:
            compliance = -self._xy / self._xx
            self.compliance = compliance if STIFFEST < compliance < MOST_COMPLIANT else 0.0


class DampedEstimator:
    """Compliance and damping by weighted least squares over changes of force [N], position [m] and speed [m/tick]."""

    __slots__ = ("_forget", "_least", "_xx", "_xy", "_xz", "_yz", "_zz", "compliance", "damping")

    def __init__(self, forget: float, least: float) -> None:
        self._forget = forget
        self._least = least
        self._xx = self._xy = self._xz = self._yz = self._zz = 0.0
        self.compliance = self.damping = 0.0  # [m/N] and [N per m/tick]; 0 while unknown

    def add(self, x: float, y: float, z: float) -> None:
        forget = self._forget
        self._xx = xx = self._xx * forget + x * x
        self._xy = xy = self._xy * forget + x * y
        self._xz = xz = self._xz * forget + x * z
        self._yz = yz = self._yz * forget + y * z
        self._zz = zz = self._zz * forget + z * z
        determinant = xx * zz - xz * xz
        self.compliance = self.damping = 0.0
        if xx > self._least and determinant > LEAST_INDEPENDENCE * xx * zz:
            compliance, time = (xz * yz - xy * zz) / determinant, (xz * xy - yz * xx) / determinant
            if STIFFEST < compliance < MOST_COMPLIANT and time > 0.0:
                self.compliance, self.damping = compliance, time / compliance


class CurvatureEstimator:
    """Curvature by weighted least squares over pairs of turn of the normal and displacement."""

    __slots__ = ("_forget", "_turns", "_ways", "value")

    def __init__(self, forget: float) -> None:
        self._forget = forget
        self._ways = self._turns = 0.0
        self.value = 0.0  # [1/m]

    def add(self, turn: Vector, way: Vector) -> None:
        self._ways = self._ways * self._forget + dot(way, way)
        self._turns = self._turns * self._forget + dot(turn, way)
        self.value = self._turns / (self._ways + LEAST_WAYS)


class FrequencyEstimator:
    """Angular frequency of a motion, by regression of second differences on the position at their middle."""

    __slots__ = ("_apart", "_count", "_forget", "_x", "_xx", "_xy", "_y", "value")

    def __init__(self, forget: float, apart: int) -> None:
        self._forget = forget
        self._apart = apart  # Ticks between the samples of a second difference
        self._count = self._x = self._y = self._xx = self._xy = 0.0
        self.value = 0.0  # [rad/tick]; 0 if the motion does not oscillate

    def add(self, place: float, second: float) -> None:
        forget = self._forget
        self._count = self._count * forget + 1.0
        self._x = self._x * forget + place
        self._y = self._y * forget + second
        self._xx = self._xx * forget + place * place
        self._xy = self._xy * forget + place * second
        spread = self._xx - self._x * self._x / self._count
        if spread > 1e-8 * self._count:
            square = -(self._xy - self._x * self._y / self._count) / spread
            self.value = 2.0 / self._apart * asin(0.5 * sqrt(square)) if 0.0 < square < 2.0 else 0.0


class ContactEstimator:
    """Estimates the surface in contact by four hypotheses, tick by tick, and remembers it for the next contact.

    `age` counts the ticks since the contact or a gap in the samples, 0 without contact. While the probe sticks,
    `friction` is a lower bound of the coefficient. `curvature` and `frictional_curvature` go with `frictionless` and
    `frictional`, `frequency` with `moving`; `damped` has its own damping.
    """

    def __init__(self, signal: Signal) -> None:
        self.threshold = signal.least_contact
        self.age = 0
        self.normal = ZERO
        self.friction = 0.0
        period = signal.grid.period
        self._step, self._turn, self._third, self._second, self._every = (
            max(1, round(time / period)) for time in (STEP_S, TURN_S, THIRD_S, SECOND_S, EVERY_S)
        )
        every = self._every * period
        self._slow, self._friction, self._normal = (min(1.0, period / time) for time in (SLOW_S, FRICTION_S, NORMAL_S))
        forget = exp(-period / MEMORY_STIFFNESS_S)
        self.frictionless = ComplianceEstimator(forget, LEAST_CHANGE / period)
        self.frictional = ComplianceEstimator(forget, LEAST_CHANGE / period)
        self.damped = DampedEstimator(forget, LEAST_CHANGE / period)
        self.moving = ComplianceEstimator(exp(-every / MEMORY_THIRD_S), LEAST_THIRD / every)
        forget = exp(-every / MEMORY_CURVATURE_S)
        self.curvature, self.frictional_curvature = CurvatureEstimator(forget), CurvatureEstimator(forget)
        self.frequency = FrequencyEstimator(exp(-every / MEMORY_FREQUENCY_S), self._second)

    def follow(self, history: History) -> None:
        """Take in the newest sample."""
        value = history.values[-1]
        size = norm(value)
        if not size > self.threshold:
            self.age = 0
            return
        direction = (value[0] / size, value[1] / size, value[2] / size)
        if self.age == 0 or not history.follows:
            self.age = 0
            if dot(direction, self.normal) < SAME_SURFACE:
                self.normal = direction
            self._slow_way = self._slow_force = 0.0
            self._directions: list[Vector] = []
            self._normals: list[Vector] = []
        self.age += 1
        self._directions.append(direction)
        if self.age > self._step:
            self._compare(history, value, size)
        self._normals.append(self.normal)
        if self.age % self._every == 0 and self.age > self._step + self._turn:
            self._look_back(history)

    def _compare(self, history: History, value: Vector, size: float) -> None:
        """Compare the newest sample with the one `STEP_S` earlier."""
        before, there, here = history.values[-1 - self._step], history.places[-1 - self._step], history.places[-1]
        x, y, z = here[0] - there[0], here[1] - there[1], here[2] - there[2]
        u, v, w = value[0] - before[0], value[1] - before[1], value[2] - before[2]
        a, b, c = self._directions[-1 - self._step // 2]
        self.frictionless.add(u * a + v * b + w * c, x * a + y * b + z * c)
        a, b, c = self.normal
        force, way = u * a + v * b + w * c, x * a + y * b + z * c
        damped, speed = self.damped, 0.0
        if self.age > self._step + 2:  # the first tick of a contact has no speed in it
            last, first = history.places[-2], history.places[-2 - self._step]
            speed = way - (a * (last[0] - first[0]) + b * (last[1] - first[1]) + c * (last[2] - first[2]))
            damped.add(force, way, speed)
        self._slow_force += self._slow * (force - self._slow_force)
        self._slow_way += self._slow * (way - self._slow_way)
        frictional = self.frictional
        frictional.add(force - self._slow_force, way - self._slow_way)
        compliance = frictional.compliance
        if damped.compliance > 0.0:  # the contact point of a surface that damps
            compliance, push = damped.compliance, damped.damping * speed
            u, v, w = u + push * a, v + push * b, w + push * c
        x, y, z = x + compliance * u, y + compliance * v, z + compliance * w
        slid = sqrt(x * x + y * y + z * z)
        if slid > LEAST_WAY:
            self._slide(value, size, (x / slid, y / slid, z / slid), slid)
        else:
            # While the probe sticks, the ratio is a lower bound of the coefficient.
            self.friction = max(self.friction, self._ratio(value))

    def _slide(self, value: Vector, size: float, way: Vector, slid: float) -> None:
        x, y, z = way
        along = value[0] * x + value[1] * y + value[2] * z
        u, v, w = value[0] - along * x, value[1] - along * y, value[2] - along * z
        across = sqrt(u * u + v * v + w * w)
        if not across > LEAST_NORMAL_SHARE * size:
            return
        share = self._normal * min(1.0, slid / 1e-3)
        a, b, c = self.normal
        self.normal = unit((a + share * (u / across - a), b + share * (v / across - b), c + share * (w / across - c)))
        ratio = self._ratio(value)
        if ratio >= 0.0:
            self.friction += self._friction * (ratio - self.friction)

    def _ratio(self, value: Vector) -> float:
        """Tangential over normal force, at most `LARGEST_FRICTION`; -1 if the surface would pull."""
        a, b, c = self.normal
        push = value[0] * a + value[1] * b + value[2] * c
        if not push > 0.0:
            return -1.0
        u, v, w = value[0] - push * a, value[1] - push * b, value[2] - push * c
        return min(sqrt(u * u + v * v + w * w) / push, LARGEST_FRICTION)

    def _look_back(self, history: History) -> None:
        """Update the estimates of curvature and motion, which compare samples farther apart."""
        values, places = history.values, history.places
        way, change = subtract(places[-1], places[-1 - self._turn]), subtract(values[-1], values[-1 - self._turn])
        directions, normals = self._directions, self._normals
        turn = subtract(directions[-1], directions[-1 - self._turn])
        self.curvature.add(turn, add(way, scale(change, self.frictionless.compliance)))
        turn = subtract(normals[-1], normals[-1 - self._turn])
        self.frictional_curvature.add(turn, add(way, scale(change, self.frictional.compliance)))
        if self.age > 3 * self._third:
            middle = directions[-1 - 3 * self._third // 2]
            apart = self._third
            self.moving.add(_third(values, middle, apart), _third(places, middle, apart))
        compliance = self.moving.compliance
        if self.age > 2 * self._second and compliance > 0.0:
            middle = directions[-1 - self._second]
            q = [
                dot(middle, places[-1 - back]) + compliance * dot(middle, values[-1 - back])
                for back in (0, self._second, 2 * self._second)
            ]
            self.frequency.add(q[1], q[0] - 2.0 * q[1] + q[2])
        if len(directions) > 4 * self._second:
            del directions[: 2 * self._second], normals[: 2 * self._second]


def _third(vectors: list[Vector], along: Vector, apart: int) -> float:
    """Third difference of a component, of samples so many ticks apart."""
    a, b, c, d = (dot(along, vectors[-1 - back * apart]) for back in range(4))
    return a - 3.0 * b + 3.0 * c - d
