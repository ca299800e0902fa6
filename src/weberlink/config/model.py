"""The schema of a configuration file: every key, its unit, its range and its default.

The options of a device or robot driver belong to the driver, and are validated once its name is known.
"""

from collections.abc import Iterator
from ipaddress import ip_address, ip_network
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any, Literal, TypeVar

from pydantic import AfterValidator, BaseModel, ConfigDict, Field

from weberlink.arms.mapping import LeaderMappingSettings
from weberlink.codec.deadband import ISOTROPIC
from weberlink.config.joints import FollowerLimits, GripperCodecSettings, JointCodecSettings, LeaderLimits
from weberlink.config.settings import (
    DeadbandSettings,
    Interval,
    PredictedSettings,
    PredictorFor,
    Settings,
    rising,
    settings_of,
)
from weberlink.control.contract import LEAST_CONTACT
from weberlink.control.table import SchemeName
from weberlink.protocol.keys import check_name
from weberlink.protocol.local_end import LONGEST_SILENCE, MOST_TICKS
from weberlink.protocol.negotiation import LONGEST as LONGEST_ROUND_TRIP
from weberlink.slave.scenes.settings import SceneSettings
from weberlink.text import is_loopback
from weberlink.update import MAX_SELECTOR

if TYPE_CHECKING:
    from weberlink.protocol.emulation import Emulation

_T = TypeVar("_T")
Bank = Annotated[tuple[_T, ...], Field(min_length=1, max_length=MAX_SELECTOR + 1)]

Axes = Literal["x", "y", "z", "xy", "xz", "yz", "xyz"]
Positive = Annotated[float, Field(gt=0, le=1e9)]
Range = Annotated[tuple[Positive, Positive], AfterValidator(rising)]
Name = Annotated[str, AfterValidator(check_name)]


def split_address(text: str) -> tuple[str, int]:
    """Host and port of "host:port" or "[v6]:port"; raises ValueError if it is neither."""
    host, colon, port = text.rpartition(":")
    if not (colon and host.strip("[]") and port.isdigit() and int(port) < 65_536):
        raise ValueError(f"must be host:port, not {text!r}")
    if ":" in host and not (host.startswith("[") and host.endswith("]")):
        raise ValueError(f"must be host:port, an IPv6 address in brackets as [::1]:47000, not {text!r}")
    return host.strip("[]"), int(port)


# Addresses for documentation (RFC 5737, RFC 3849), which nobody has: placeholders of shipped files.
EXAMPLES = [ip_network(text) for text in ("192.0.2.0/24", "198.51.100.0/24", "203.0.113.0/24", "2001:db8::/32")]


def is_placeholder(host: str) -> bool:
    """Whether a host is an address for documentation, in the place of which one's own is to be put."""
    try:
        address = ip_address(host.partition("%")[0])
    except ValueError:
        return False
    return any(address in network for network in EXAMPLES)


Address = Annotated[str, AfterValidator(lambda text: split_address(text) and text)]  # host:port
Probability = Annotated[float, Field(ge=0, le=1)]
Start = Annotated[float, Field(ge=0)]
Duration = Annotated[float, Field(gt=0)]

PERCEPTUAL_WEBER_LIMIT = 0.27  # above it published task performance falls (Chaudhari 2011); `check` warns
LONGEST_LOOKAHEAD_MS = 100.0
LookaheadMs = Annotated[float, Field(ge=0, le=LONGEST_LOOKAHEAD_MS)]
# Largest look-ahead as a share of the silence limit: a sample must be coded, and repeated once, before it is stale.
LOOKAHEAD_SHARE = 0.5
JOINT_SCHEMES = ("none", "bounded")  # control schemes for arms led joint by joint


class DirectionFaults(Settings):
    """Faults of one direction of the link."""

    delay_ms: float = Field(default=0.0, ge=0, le=10_000)
    """Constant one-way delay."""
    jitter_ms: float = Field(default=0.0, ge=0, le=10_000)
    """Largest additional delay, uniform."""
    loss: Probability = 0.0
    """Share of datagrams lost."""
    burst: float = Field(default=1.0, ge=1, le=1000)
    """Mean length of a run of losses; 1 for independent losses, more for a Gilbert-Elliott channel."""
    reorder: Probability = 0.0
    """Share of datagrams held back behind the next one."""
    duplicate: Probability = 0.0
    """Share of datagrams delivered twice."""
    corrupt: Probability = 0.0
    """Share of datagrams with bits flipped."""
    rate_kbit_s: float | None = Field(default=None, gt=0)
    """Capacity of the link; none for no limit."""
    blackouts_s: tuple[tuple[Start, Duration] | tuple[Start, Duration, Duration], ...] = ()
    """Times in which nothing arrives: pairs of start and duration, or triples of start, duration and period for a link
    that flaps: [2, 0.1, 0.2] drops everything for the first 100 ms of every 200 ms, from 2 s on."""

    def emulation(self) -> "Emulation":
        """In SI units."""
        from weberlink.protocol.emulation import Emulation  # noqa: PLC0415 - only where a file asks for it

        return Emulation(
            delay_s=self.delay_ms * 1e-3,
            jitter_s=self.jitter_ms * 1e-3,
            loss=self.loss,
            burst=self.burst,
            reorder=self.reorder,
            duplicate=self.duplicate,
            corrupt=self.corrupt,
            rate_bit_s=None if self.rate_kbit_s is None else self.rate_kbit_s * 1e3,
            blackouts=self.blackouts_s,
        )

    def contradictions(self) -> Iterator[str]:
        if self.burst > 1.0 and self.burst / (1.0 + self.burst) < self.loss < 1.0:
            yield f"loss: at most burst / (1 + burst) for bursts of {self.burst:g}, not {self.loss:g}"


class EmulationSettings(DirectionFaults):
    """Faults put on each side's outgoing datagrams, seeded; the same in both directions unless one is set apart."""

    to_slave: DirectionFaults | None = None
    """What differs on the way from the master to the slave; the keys given here replace those above."""
    to_master: DirectionFaults | None = None
    """What differs on the way from the slave to the master."""
    seed: int = Field(default=0, ge=0)
    """Same seed, same faults."""

    @property
    def directions(self) -> tuple[DirectionFaults, DirectionFaults]:
        """Faults of the way to the slave, and of the way to the master."""
        both = {name: getattr(self, name) for name in DirectionFaults.model_fields}
        to_slave, to_master = (
            DirectionFaults(**both | ({} if own is None else own.model_dump(exclude_unset=True)))
            for own in (self.to_slave, self.to_master)
        )
        return to_slave, to_master

    def contradictions(self) -> Iterator[str]:
        for direction in self.directions:
            yield from direction.contradictions()


class NameSettings(Settings):
    """What the two sides call themselves, and so whom each of them is to meet."""

    master: Name | None = None
    """The slave serves the master of this name alone. Without it, a master calls itself user@host."""
    slave: Name | None = None
    """The master takes the slave of this name alone, and else the first that answers, until it ends. Without it, a
    slave calls itself host:port."""


class DriverSettings(BaseModel):
    """A driver by name, with the options that are its own."""

    model_config = ConfigDict(extra="allow", frozen=True)

    driver: str

    @property
    def options(self) -> dict[str, Any]:
        return dict(self.model_extra or {})


class LinkSettings(Settings):
    """Where the two sides meet, and how they trust each other."""

    listen: Address = "0.0.0.0:47000"
    """Address that the slave binds."""
    slave: Address = "127.0.0.1:47000"
    """Address at which the master finds the slave."""
    security: Literal["psk", "session", "none"] = "psk"
    """`psk`: a pre-shared key encrypts every datagram. `session`: the same, with a key that `weberlink loopback` makes
    for each run. `none`: a checksum only, and no hardware drivers. The last two on loopback addresses only."""
    finder: DriverSettings | None = None
    """A path finder of another distribution, by its `driver` and with its options: it knows the key, and how to reach
    the other host where it has no address. Leave `security` out then."""
    dscp: int = Field(default=46, ge=0, le=63)
    """Class of service asked for by every datagram (RFC 2474); 46 is EF, 0 is that of all other traffic."""
    playout_ms: float = Field(default=0.0, ge=0, le=100)
    """How much later than on its fastest way every update is used, so that jitter up to this is not felt; 0 to use each
    as it comes. At most half of `silence_ms`."""
    names: NameSettings = NameSettings()
    key_file: Path | None = None
    """The key, as written by `weberlink keygen`; needed with `psk`."""
    silence_ms: float = Field(default=100.0, ge=10, le=1e3 * LONGEST_SILENCE)
    """Longest time without a datagram of the other side; beyond it the force is zero and the robot holds or retracts.
    The same at both ends. It does not depend on the round trip."""
    longest_round_trip_ms: float = Field(default=400.0, ge=0, le=1e3 * LONGEST_ROUND_TRIP)
    """Longest round trip with which a session begins, and the most by which its loop age may exceed `silence_ms`. The
    smaller value of the two ends holds; what the link needs of it is measured."""
    emulate: EmulationSettings | None = None
    """Faults to put on the link; leave out for a real one."""

    def contradictions(self) -> Iterator[str]:
        if self.finder is not None:
            if "security" in self.model_fields_set:
                yield "finder has the key; leave security out, or finder"
        elif self.security == "psk":
            if self.key_file is None:
                yield "security psk needs key_file; make one with: weberlink keygen KEYFILE"
        elif not all(is_loopback(split_address(each)[0]) for each in (self.listen, self.slave)):
            yield f"security {self.security} is for loopback addresses only; between hosts use psk"


class TrustSettings(Settings):
    """The range in which a fitted contact is believed; outside it a geometry predictor holds the newest sample."""

    stiffness_n_m: Range = (10.0, 3000.0)
    """The master renders a fitted contact on its own: nothing stiffer than its device displays stably."""
    radius_m: Range = (0.001, 10.0)


class ForceCodecSettings(PredictedSettings):
    """The backward channel."""

    signal = "force"

    predictor: Annotated[str, PredictorFor("force", chosen=True)] = "hybrid"
    """What both ends predict with."""
    bank: Bank[Annotated[str, PredictorFor("force")]] = ("zoh", "linear", "plane", "sphere")
    """What `hybrid` or another choice chooses among, the first of equals first. The default is that of `hybrid`."""
    weber: float = Field(default=0.10, ge=0, lt=1)
    """Weber factor k: the relative error that stays unsent. At 1, all of a force would."""
    floor_n: float = Field(default=0.02, ge=0, le=10)
    """Absolute threshold [N] below which Weber's law fails; 0 reproduces the paper."""
    reference: Literal["actual", "displayed", "sent"] = "actual"
    """Which force k scales."""
    deadband: DeadbandSettings = settings_of(ISOTROPIC)(shape=ISOTROPIC)
    """The shape of what stays unsent."""
    step_n: float = Field(default=0.001, gt=0, le=1)
    """Wire step [N]; 16 bits span +-32767 steps."""
    trust: TrustSettings = TrustSettings()
    smooth_ms: float = Field(default=0.0, ge=0, le=100)
    """Length of the ramp in which an update changes the force [ms], within the deadband; 0 for at once."""
    lookahead_ms: LookaheadMs = 0.0
    """How long the encoder waits before it decides on a sample, so that it knows what follows: fewer updates, and the
    operator feels what no model of the position predicts this much later. 0 for none."""

    def contradictions(self) -> Iterator[str]:
        yield from super().contradictions()
        shape, deadband = self.deadband.shape, self.deadband.deadband
        if self.smooth_ms > 0.0 and not deadband.is_ball:
            yield f"smooth_ms needs a deadband that is a ball, not {shape}"
        if deadband.needs_actual and self.reference != "actual":
            yield f"deadband {shape} needs reference: actual, since it is drawn around the measured force"
        if deadband.needs_floor and self.floor_n == 0.0:
            yield f"deadband {shape} needs floor_n above 0: it is the lowest level"


class MotionCodecSettings(PredictedSettings):
    """What position and orientation have in common."""

    signal = "position"

    predictor: Annotated[str, PredictorFor("position", chosen=True)] = "linear"
    """What both ends predict with."""
    bank: Bank[Annotated[str, PredictorFor("position")]] = ("zoh", "linear")
    """What `hybrid` or another choice chooses among; the default is that of `hybrid`."""
    weber: float = Field(default=0.10, ge=0, le=1)
    """Weber factor of velocity, linear or angular."""


class PositionCodecSettings(MotionCodecSettings):
    """The forward channel."""

    bound_m: float = Field(default=0.0002, ge=0, le=0.1)
    """Position error at rest that stays unsent [m]."""
    lookahead_ms: LookaheadMs = 0.0
    """How long the encoder waits before it decides on a sample. Fewer updates; the robot follows that much later."""
    step_m: float = Field(default=0.00001, gt=0, le=0.01)
    """Wire step [m], of both channels; 16 bits span +-32767 steps."""


class TorqueCodecSettings(PredictedSettings):
    """The backward channel of the rotation."""

    signal = "torque"

    predictor: Annotated[str, PredictorFor("torque", chosen=True)] = "hybrid"
    """What both ends predict with."""
    bank: Bank[Annotated[str, PredictorFor("torque")]] = ("zoh", "linear")
    """What `hybrid` or another choice chooses among; the default is that of `hybrid`."""
    weber: float = Field(default=0.13, ge=0, lt=1)
    """Weber factor of torque: 12.7 % of 60 mN m was found with two fingers (Jandura and Srinivasan, 1994)."""
    floor_nm: float = Field(default=0.005, ge=0, le=10)
    """Absolute threshold [N m] below which Weber's law fails."""
    reference: Literal["actual", "displayed", "sent"] = "actual"
    """Which torque the Weber factor scales."""
    step_nm: float = Field(default=0.0001, gt=0, le=1)
    """Wire step [N m]; 16 bits span +-32767 steps."""


class OrientationCodecSettings(MotionCodecSettings):
    """The forward channel of the rotation."""

    bound_rad: float = Field(default=0.01, ge=0, le=1)
    """Error of orientation at rest that stays unsent [rad]."""
    step_rad: float = Field(default=0.0001, ge=0.0001, le=0.01)
    """Wire step [rad], of both channels; 16 bits span +-32767 steps, which must be more than half a turn."""


class RotationCodecSettings(Settings):
    """Six degrees of freedom: orientation beside position, torque beside force, each with updates of its own."""

    torque: TorqueCodecSettings = TorqueCodecSettings()
    orientation: OrientationCodecSettings = OrientationCodecSettings()


class CodecSettings(Settings):
    """Perceptual coding; both sides must agree on all of it."""

    force: ForceCodecSettings = ForceCodecSettings()
    position: PositionCodecSettings = PositionCodecSettings()
    rotation: RotationCodecSettings | None = None
    """Torque and orientation, `{}` for their defaults; leave out for three degrees of freedom."""
    joints: JointCodecSettings | None = None
    """The joints of a leader and a follower arm, instead of force, position and rotation; leave out for none."""
    gripper: GripperCodecSettings | None = None
    """The gripper of the arms, `{}` for its defaults; leave out for none."""

    @property
    def arm(self) -> list[tuple[str, JointCodecSettings | GripperCodecSettings, int]]:
        """The parts of an arm: key, settings and number of axes; nothing for a hand."""
        if self.joints is None:
            return []
        joints = ("joints", self.joints, len(self.joints.names))
        return [joints] if self.gripper is None else [joints, ("gripper", self.gripper, 1)]

    def contradictions(self) -> Iterator[str]:
        if self.gripper is not None and self.joints is None:
            yield "gripper: belongs to an arm; give its joints too, with joints: {names: [...]}"
        if self.joints is not None and self.rotation is not None:
            yield "joints: an arm has no rotation of its own; leave out codec.rotation"


class ControlSettings(Settings):
    """What keeps a delayed loop stable.

    With `bounded`, the hand gets at most `allowance_j` + `refill_w` x time + `damping_n_s_m` x the integral of its
    squared speed + what the scene gave + the work of one tick more energy than it gave, whatever link and scene do.
    """

    scheme: SchemeName = "bounded"
    """`bounded`: what is known of the contact is felt, within an account of energy. `none`: what is decoded is felt;
    nothing bounds the energy."""
    allowance_j: float = Field(default=0.02, gt=0, le=10)
    """Energy that the hand may get beyond what it gave [J]."""
    refill_w: float = Field(default=0.01, ge=0, le=10)
    """Power with which the allowance returns [W]."""
    damping_n_s_m: float = Field(default=1.0, ge=0, le=100)
    """Damping that every hand has at least [N s/m]: what it takes from the motion may be given back."""
    rise_n_s: float = Field(default=160.0, gt=0, le=1e6)
    """Rise of a force that the hand has not pressed in itself [N/s]: a wall that is felt late rises, and does not
    kick."""
    live_changes: bool = True
    """Whether Weber factor, predictor (of a hybrid's bank), and delay, jitter and loss (with `link.emulate`) may be
    changed in a session."""


class RealtimeSettings(Settings):
    """What to ask of the operating system; what it refuses is said in the report."""

    priority: int = Field(default=50, ge=0, le=98)
    """SCHED_FIFO priority; 0 for the normal scheduler."""
    lock_memory: bool = True
    """Keep all pages in memory."""
    wakeful: bool = True
    """Keep processors out of deep idle states while the daemon runs: they wake up sooner, and cost more power."""
    busy_poll: bool = False
    """Poll sockets and clock instead of sleeping: datagrams and ticks wait less, and each daemon takes a processor."""
    cpus: tuple[int, int] | None = None
    """Processors to pin the master and the slave to."""


class MasterLimits(Settings):
    """What protects the operator."""

    force_n: float = Field(default=10.0, ge=LEAST_CONTACT, le=1e4)
    """Largest force [N], on top of the device's own limit."""
    torque_nm: float = Field(default=0.5, ge=1e-3, le=1e4)
    """Largest torque [N m], on top of the device's own limit; with `codec.rotation`."""
    slew_n_s: float | None = Field(default=None, ge=1e-3, le=1e9)
    """Fastest change of force [N/s], but for a fade to zero; by default that of the device's stiffest wall, touched at
    1 m/s."""
    slew_nm_s: float | None = Field(default=None, ge=1e-3, le=1e9)
    """Fastest change of torque [N m/s]; by default torque may rise to its largest in the time in which force may."""
    ramp_ms: float = Field(default=50.0, gt=0, le=5000)
    """Time in which force and torque fade in and out."""
    device_ms: float = Field(default=20.0, gt=0, le=5000)
    """Longest time without a usable sample of the device."""
    joints: LeaderLimits | None = None
    """Of a leader arm, `{}` or nothing for its own limits; with `codec.joints`."""


class ButtonSettings(Settings):
    """A button of the device."""

    button: int = Field(default=0, ge=0, le=31)
    """Which one, from 0."""


class WallSettings(Settings):
    """What keeps the hand within the robot's workspace."""

    stiffness_n_m: float = Field(default=500.0, ge=1e-3, le=1e9)
    """Felt by the hand."""
    box_m: tuple[Interval, Interval, Interval] | None = None
    """Lowest and highest position of the robot on x, y, z; slave.limits.workspace_m if not given."""


class MappingSettings(Settings):
    """From the device's frame to the robot's; all that is sent, recorded and reported is in the robot's."""

    rotation_deg: tuple[float, float, float] = (0.0, 0.0, 0.0)
    """Turns about the robot's fixed x, y and z axes, in this order."""
    scale: float = Field(default=1.0, ge=1e-3, le=1000)
    """Metres of the robot for a metre of the hand."""
    force_scale: float = Field(default=1.0, ge=1e-3, le=1000)
    """Newtons on the hand for a newton on the robot."""
    offset_m: tuple[float, float, float] = (0.0, 0.0, 0.0)
    """Where the device's origin is in the robot's frame."""
    clutch: ButtonSettings | None = None
    """Indexing by a button: while it is held, the hand moves and the robot stays; leave out for none. Needs walls."""
    walls: WallSettings | None = None
    """Virtual walls; `{}` for those of slave.limits.workspace_m, leave out for none."""

    def contradictions(self) -> Iterator[str]:
        if self.clutch is not None and self.walls is None:
            yield "clutch needs walls, since indexing may lead anywhere; add walls: {}"


class MasterSettings(Settings):
    """The operator's side."""

    device: DriverSettings = DriverSettings(driver="operator")
    mapping: MappingSettings | None = None
    """Leave out where the two frames are one."""
    joint_mapping: LeaderMappingSettings | None = None
    """From the axes of a leader arm to those of the follower; leave out where they are the same."""
    engage: ButtonSettings | None = None
    """Dead-man button: only while it is held, the robot follows and force is displayed. Leave out where the robot is to
    follow without a button held."""
    limits: MasterLimits = MasterLimits()
    accept_no_watchdog: str | None = None
    """Driver whose force stays on when this host stops, and may do so; its name, or leave out."""

    @property
    def frame_map(self) -> MappingSettings:
        """The mapping, or the one that changes nothing."""
        return self.mapping or MappingSettings()


class SlaveLimits(Settings):
    """What protects the robot and what it touches."""

    workspace_m: tuple[Interval, Interval, Interval] = ((-0.3, 0.3), (-0.3, 0.3), (-0.3, 0.3))
    """Lowest and highest commanded position on x, y, z."""
    speed_m_s: float = Field(default=2.0, ge=1e-4, le=100)
    """Largest speed while following."""
    approach_speed_m_s: float = Field(default=0.25, ge=1e-4, le=100)
    """Speed at which the robot approaches the operator's position after an engagement."""
    turn_rad_s: float = Field(default=10.0, ge=1e-4, le=1000)
    """Largest angular speed while following; with `codec.rotation`."""
    approach_turn_rad_s: float = Field(default=1.5, ge=1e-4, le=1000)
    """Angular speed at which the tool turns to the operator's orientation after an engagement."""
    on_silence: Literal["hold", "retract"] = "hold"
    """What the robot does when the master is not heard: stay, or back off along the contact force."""
    retract_m: float = Field(default=0.01, ge=1e-6, le=1)
    """How far it backs off."""
    contact_n: float | None = Field(default=None, ge=LEAST_CONTACT, le=1e4)
    """Largest force with which the robot presses; by default the largest that the operator can feel of it."""
    trip_n: float | None = Field(default=None, ge=LEAST_CONTACT, le=1e4)
    """Contact force above which the robot stops following and backs off by retract_m; by default the largest that the
    robot stands or measures."""
    ramp_ms: float = Field(default=50.0, gt=0, le=5000)
    """Time in which its force fades in once it has reached the operator's position."""
    robot_ms: float = Field(default=20.0, gt=0, le=5000)
    """Longest time without a usable sample of the robot."""
    joints: FollowerLimits | None = None
    """Of a follower arm, `{}` or nothing for its own limits and the speeds by default; with `codec.joints`."""

    def contradictions(self) -> Iterator[str]:
        if self.contact_n is not None and self.trip_n is not None and self.contact_n > self.trip_n:
            yield f"contact_n {self.contact_n:g} is above trip_n {self.trip_n:g}, at which the robot backs off"


class SlaveSettings(Settings):
    """The teleoperator's side."""

    robot: DriverSettings = DriverSettings(driver="point")
    scene: SceneSettings = ()
    """What there is to touch; nothing for free space or a real robot."""
    limits: SlaveLimits = SlaveLimits()
    cameras: DriverSettings | None = None
    """Pictures of the robot for the operator, by a `driver` of another distribution and with its options."""


class System(Settings):
    """A WeberLink system: one file, read by both daemons, each of which builds its own side."""

    rate_hz: float = Field(default=1000.0, ge=10, le=10_000)
    """Tick rate of both sides."""
    axes: Axes = "xyz"
    """Axes that are sent."""
    link: LinkSettings
    codec: CodecSettings = CodecSettings()
    control: ControlSettings = ControlSettings()
    realtime: RealtimeSettings = RealtimeSettings()
    master: MasterSettings = MasterSettings()
    slave: SlaveSettings = SlaveSettings()

    @property
    def tick_period(self) -> float:
        """[s]."""
        return 1.0 / self.rate_hz

    @property
    def delays_ms(self) -> dict[str, float]:
        """What the file adds to the delay of the signals, by its field [ms]; arms have no look-ahead."""
        delays = {"link.playout_ms": self.link.playout_ms}
        if self.codec.joints is None:
            delays["codec.force.lookahead_ms"] = self.codec.force.lookahead_ms
            delays["codec.position.lookahead_ms"] = self.codec.position.lookahead_ms
        return delays

    def contradictions(self) -> Iterator[str]:
        link, force = self.link, self.codec.force
        longest = 1e3 * MOST_TICKS / self.rate_hz
        if link.silence_ms > longest:
            yield f"link.silence_ms: at most {longest:.0f} at rate_hz {self.rate_hz:g}"
        most = LOOKAHEAD_SHARE * link.silence_ms
        for name, delay in self.delays_ms.items():
            if delay > most:
                yield f"{name}: at most {most:g}, half of link.silence_ms; a later sample is stale"
        pressed, floor = self.slave.limits.contact_n, force.floor_n
        if pressed is not None and pressed < floor:
            yield f"slave.limits.contact_n: {pressed:g} is not felt; use at least codec.force.floor_n, {floor:g}"
        yield from self._misplaced()

    def _misplaced(self) -> Iterator[str]:
        """What arms have in a file without them, and the other way round."""
        master, scheme = self.master, self.control.scheme
        if self.codec.joints is None:
            if any(each is not None for each in (master.limits.joints, self.slave.limits.joints, master.joint_mapping)):
                yield "limits.joints and master.joint_mapping: need codec.joints, the joints of the arms"
            return
        lost = {
            "axes": self.axes != "xyz",
            "master.mapping": master.mapping is not None,
            "slave.scene": bool(self.slave.scene),
        }
        for name in (name for name, is_given in lost.items() if is_given):
            yield f"{name}: has no meaning for an arm led joint by joint (codec.joints); leave it out"
        if scheme not in JOINT_SCHEMES:
            yield f"control.scheme: with codec.joints {' or '.join(JOINT_SCHEMES)}, not {scheme}"
