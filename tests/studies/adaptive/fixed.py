"""Rows made by hand, from which the page can be worked out by hand."""

from weberlink.studies.adaptive.rows import Cost, Match, Rate, Results
from weberlink.studies.adaptive.signals import Half, Kind
from weberlink.studies.adaptive.variants import ABLATIONS, COMPARED, TUNINGS
from weberlink.studies.adaptive.work import ABLATION, LIMITS, RATES, TUNING, UNSEEN

SIGNALS: tuple[tuple[str, str, Half, Kind], ...] = (
    ("omega3_1", "omega3_1", "chosen", "recording"),
    ("omega3_7", "omega3_7", "reported", "recording"),
    ("plane_friction, seed 1", "plane_friction", "chosen", "scene"),
    ("plane_friction, seed 2", "plane_friction", "reported", "scene"),
    ("plane_friction, seed 3", "plane_friction", "reported", "scene"),
    ("plane_moving, seed 2", "plane_moving", "reported", "scene"),
)
PACKETS = {"hybrid": 200, "adaptive": 100, "zoh": 400, "linear": 300, "plane": 250, "sphere": 500}
DURATION_S = 10.0


def rate(part: str, signal: tuple[str, str, Half, Kind], variant: str, packets: int, floor: float = 0.02) -> Rate:
    return Rate(part, *signal, 0.0, variant, floor, packets, packets / DURATION_S)


def match(signal: tuple[str, str, Half, Kind], variant: str, weber: float, error: float, step: float) -> Match:
    return Match(*signal, variant, weber, 200, 20.0, error, 10.0 * error, step, 10.0 * step)


def results() -> Results:
    """`adaptive` sends half of what the hybrid sends, and at equal packets errs half as much."""
    made = Results()
    for signal in SIGNALS:
        made.rates.extend(rate(RATES, signal, name, PACKETS.get(name, 150)) for name in COMPARED)
        if signal[2] == "reported":
            made.rates.extend(rate(ABLATION, signal, name, 110) for name in ABLATIONS)
            made.rates.append(rate(LIMITS, signal, "hybrid", 40))
            made.matches.append(match(signal, "hybrid", 0.10, 0.04, 0.2))
            made.matches.append(match(signal, "adaptive", 0.05, 0.02, 0.1))
        else:
            made.rates.extend(rate(TUNING, signal, name, 101) for name in TUNINGS)
    further: tuple[str, str, Half, Kind] = ("plane_friction, seed 4", "plane_friction", "reported", "scene")
    made.rates.extend(rate(UNSEEN, further, name, packets) for name, packets in (("hybrid", 200), ("adaptive", 200)))
    for name in ("hybrid", "adaptive"):
        made.rates.append(rate(RATES, SIGNALS[1], name, PACKETS[name] - 10, 0.05))
    made.costs.extend([Cost("hybrid", 1000, 6.0, 7.0, 12.0, 90.0), Cost("adaptive", 1000, 30.0, 35.0, 70.0, 400.0)])
    return made
