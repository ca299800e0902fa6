"""The wording of the page. Knows no row; the constants it names are those of the code."""

from weberlink.codec.adaptive import MEMORY, PRESENT
from weberlink.codec.predictors import ADAPTIVE, ADAPTIVE_BANK, HYBRID, PREDICTORS
from weberlink.studies.adaptive.variants import ALL_SINGLES, FLOOR_N, SINGLES

FIGURES = {
    "packets": "Packets of adaptive over those of the hybrid, by signal",
    "ablation": "Packets with a part off over those with all parts",
    "felt": "Error and steps at equal packets",
}
"""Figures beside the page, and what they show."""

HALVES = {"reported": "nothing", "chosen": "the parameters"}
"""What a half chose."""

HEAD = f"""# `{ADAPTIVE}` against the paper's hybrid

What the predictor `{ADAPTIVE}` is worth, measured by `weberlink adaptive`, which also wrote this page; all rows are
in [adaptive.json](adaptive.json). k = 0.10 and a floor of {FLOOR_N:g} N unless something else is said. The
reference of the deadband is the measured force, the wire steps are the default ones (1 mN, 10 um). Nothing is lost
or late, and nobody was asked: what is felt is judged by its error.

## Method

The paper's `{HYBRID}` chooses, when it must send, the predictor (of {", ".join(SINGLES)}) that is least wrong at
that one instant, and fits each to the two samples sent last. `{ADAPTIVE}` runs a *shadow encoder* for every way to
make a model: a deadband loop of its own, which sends when its own prediction leaves the deadband. Chosen is the way
whose shadow sent least often lately. The receiver knows nothing of it, since choice and parameters travel in the
update. The bank:

- `trend`: a line through where the signal will be on the whole, by fixed linear filters of the latest samples.
- `affine`: stiffness matrix and drift by ridge least squares over the latest samples.
- `surface`: a patch with stiffness, curvature, Coulomb friction and motion along its normal, from what the samples
  of a contact say of it tick by tick. Three suppositions compete: smooth and still, rough and still, moving.
- {", ".join(f"`{name}`" for name in ADAPTIVE_BANK if name in SINGLES)}: as in the paper.

A ratio is packets over packets on the same signal. A mean of ratios is geometric over groups, with the 95 %
interval of a bootstrap over groups (10,000 resamples): all seeds of a scene are one group, every recording is one.
With so few groups the interval is known to be somewhat narrow.
"""

RECORDED = """`tue_*`: a person teleoperating a robot of one degree of freedom that taps aluminium (rigid), foam, a
spring or nothing (free); position and contact force at the robot, 2 kHz averaged to 1 kHz. `omega3_*`: a person
moving a 3-DoF omega.3 in a guidance field, which is no contact and has no surface; 500 Hz interpolated to 1 kHz.
Both are converted from public recordings under the MIT licence
(github.com/Ohara124c41/Haptics-Bilateral_Teleoperation-1DOF_Experiments and
github.com/xhtsansiro/A_Dynamical-System-Approach-to-Shared-Control), nothing filtered.
"""

EXPLORED = """a modelled hand (`evaluation/coding/scenes/`), with 2 mN rms of sensor noise on each axis unless
something else is said; a seed is another motion."""

CHOSEN = f"""Chosen were the time constant of the record ({MEMORY:g} ticks), the weight of the present
error ({PRESENT:g} sends), the doubt in `trend` and `affine` ({PREDICTORS["trend"].doubt:g}), and the filters of
`codec/adaptive/trend.py`: least squares of the mean of the next 20
samples, and of the line through the next 40, on differences of the latest ones, over the recordings of that half
alone (`evaluation/adaptive/filters.py` makes them again). The form of the candidates was worked out while signals
of both halves were looked at; only these numbers are of one half alone, and the packets of the other were seen
beside. Neighbours of the constants, on the half that chose them:"""

TARGETS = "On the half of the signals that chose nothing; intervals are 95 %."

PACKETS = f"""Ratios of `{ADAPTIVE}`, below 1 where it sends less. The best of four is that of {", ".join(SINGLES)}
on each signal by itself, which is known only afterwards; the best of seven is that of {", ".join(ALL_SINGLES)}."""

PUBLISHED = """Recordings beside the counts of an independent implementation of the paper's hybrid (without wire
steps), then the scenes."""

UNSEEN = "Scenes with two more seeds, on which nothing was tried while the codec was made."

QUIET = "No sensor is like that: geometry is exact then, and so are fits of two samples."

EQUAL = f"""For each signal the Weber factor at which `{ADAPTIVE}` sends as often as the hybrid does at 0.10, found
by bisection to 2 % where the counts allow (they do not fall with it everywhere), in doubt with fewer packets; the
floor shrinks with it, so that the whole deadband does. One JND is 10 % of the force, at least 0.02 N, for everyone.
A step is the change of the displayed force from one tick to the next: what the contact itself changes is in it. In
each cell first the hybrid, then `{ADAPTIVE}`."""

SMOOTH = """Smooth updates give back what a new model changes over a ramp. The lag is the length of the ramp (a tick
is 1 ms); the share is what the ramp may use of the deadband, and what of a change exceeds it does not lag. Ratios
at the same packets, on the recordings and one seed of each scene:"""

PARTS = """Packets with the part off over those with all parts, on the half that chose nothing: above 1 where the
part saves, with the signals on which it is worth most and least."""

RUBBED = f"Packets of `{ADAPTIVE}` over those of the hybrid, for each seed that chose nothing."

LIMITS = f"""No encoder of these families could send less than this, in packets per second, though it knew the
future (`evaluation/coding/clairvoyant/`); the limit is loose in three dimensions. Of `trend`, `affine` and
`surface` nothing is known, so `{ADAPTIVE}` may be below the limit of the hybrid's bank."""

COST = """Encode plus decode of a tick in CPython on the machine of the last line, on parts of the signals that
chose nothing, after all other work. The worst tick has in it whatever else the machine did."""
