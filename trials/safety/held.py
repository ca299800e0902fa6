"""Datagrams that are held for some time and then delivered: how many are executed, by age and direction."""

from dataclasses import dataclass
from itertools import product

from tests.safety.observed_link import Hold, ObservedLink, agreed_by, observed
from tests.session.systems import configuration
from trials.safety.run import TO_MASTER, TO_SLAVE
from weberlink.protocol.emulation import Emulation

WRAP_S = 2**23 * 1e-5  # time after which a time stamp (23 bits of 10 us) wraps [s]
SILENCE_S = 0.1
FROM_S, BATCH_S = 1.0, 0.23  # datagrams that leave in this time are held [s]
QUICK_S = 10.0  # longer ages are run at a tenth of the rate [s]
AGES_S = (
    *(0.001, 0.005, 0.02, 0.05, 0.08, 0.095, 0.105, 0.12, 0.15, 0.2, 0.3),
    *(factor * 4.0 * SILENCE_S + offset for factor in (1, 2, 3, 5, 8) for offset in (-0.002, 0.0, 0.002, 0.05)),
    *(1.0, 3.0, 3.1, 3.2, 4.0, 10.0, 30.0, 100.0, WRAP_S - 0.05, WRAP_S, WRAP_S + 0.05, 200.0, 2.0 * WRAP_S),
)
ALONE, ALL, ALWAYS = "others pass", "all held", "always"
DELAYS_S = ((0.152, 0.001), (0.001, 0.152), (0.09, 0.005), (0.005, 0.09), (0.06, 0.06))
"""Of links that are slow for good: to the slave, to the master [s]."""
EVERY = tuple(product((TO_SLAVE, TO_MASTER), (ALONE, ALL), sorted(AGES_S)))  # all (direction, mode, age)
TAPS = "[{motion: tap, at_m: [0, 0, 0], height_m: 0.002, frequency_hz: 5, count: 10000}]"
"""So that force and position need many updates."""


@dataclass(frozen=True)
class Held:
    direction: str  # `TO_SLAVE` or `TO_MASTER`
    mode: str  # only the batch is held, nothing passes that way until it is delivered, or the link is always as slow
    age_s: float  # of each datagram of the batch when it arrives
    held: int  # how many there were
    executed: int  # updates executed of any age in the run
    too_old: int  # of them, older when they arrived than the silence limit and the agreed round trip together
    oldest_ms: float  # the oldest of them


def hold(direction: str, mode: str, age: float) -> Held:
    """Hold a batch of datagrams of one direction for `age` [s]; the other direction is not held."""

    def held(_data: bytes, at: float) -> float | None:
        if FROM_S <= at < FROM_S + BATCH_S:
            return age
        return 1e9 if mode == ALL and FROM_S <= at < FROM_S + BATCH_S + age else None  # longer than any run

    return _run(direction, mode, age, held, (0.001, 0.001))


def delay(to_slave: float, to_master: float) -> Held:
    """A link that is always as slow as this [s]; the row is of the slower direction."""
    slower = TO_SLAVE if to_slave >= to_master else TO_MASTER
    return _run(slower, ALWAYS, max(to_slave, to_master), lambda _data, _now: None, (to_slave, to_master))


def _run(direction: str, mode: str, age: float, held: Hold, delays: tuple[float, float]) -> Held:
    rate = 100.0 if age > QUICK_S else 1000.0
    loaded = configuration(
        f"rate_hz={rate}",
        f"link.silence_ms={1e3 * SILENCE_S}",
        f"master.device.script={TAPS}",
        "codec.force={predictor: zoh, weber: 0.02}",
        "codec.position.predictor=zoh",
        "slave.scene=[{shape: plane, stiffness_n_m: 300}]",
    )
    ways = {
        way: ObservedLink(Emulation(delay_s=delay), hold=held if way == direction else lambda _data, _now: None)
        for way, delay in zip((TO_SLAVE, TO_MASTER), delays, strict=True)
    }
    simulated = observed(loaded, *ways.values())
    agreed = 0.0
    for _ in range(round((FROM_S + BATCH_S + age + 0.5) * rate)):
        simulated.step()
        agreed = max(agreed, agreed_by(simulated))
    link = ways[direction]
    link.settle()
    count = sum(FROM_S <= at < FROM_S + BATCH_S for at in link.departures)
    too_old = sum(each > SILENCE_S + agreed + 1e-6 for each in link.executions)
    return Held(direction, mode, age, count, len(link.executions), too_old, 1e3 * max(link.executions, default=0.0))
