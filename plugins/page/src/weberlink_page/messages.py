"""Every message between the server and a page, in both directions.

`page/js/messages.d.ts` has the same types for the scripts; `python -m plugins.page.tests.declarations` writes it. Times
are in s since the session began, lengths in m, forces in N, torques in N m, angles in rad.
"""

from typing import Annotated, Any, Literal, NotRequired

from pydantic import ConfigDict, Field, TypeAdapter
from typing_extensions import TypedDict  # pydantic needs it before Python 3.12

Numbers = list[float | None]  # one for each row; None for what is unknown
Side = Literal["master", "slave"]


# From the server


class SceneTitle(TypedDict):
    """A session that the page may start."""

    name: str
    title: str


class Rooms(TypedDict):
    """What the page may start."""

    start: bool
    scenes: list[SceneTitle]
    scene: str | None


class Hello(TypedDict):
    """The greeting; only the first four members without a session."""

    type: Literal["hello"]
    session: str | None
    token: str | None  # goes with every request that changes something; None for a page that only looks
    rooms: Rooms
    readonly: NotRequired[bool]
    sides: NotRequired[dict[Side, dict[str, Any] | None]]  # their descriptions, see `weberlink.session.description`
    present: NotRequired[list[Side]]
    names: NotRequired[dict[str, str | None]]
    scene: NotRequired[list[dict[str, Any]]]
    changes: NotRequired[list[str]]
    predictors: NotRequired[list[str]]
    settings: NotRequired[dict[str, Any]]
    scheme: NotRequired[str | None]
    generation: NotRequired[int | None]
    link: NotRequired[dict[str, float | None] | None]
    drivable: NotRequired[bool]
    workspace_m: NotRequired[float | None]
    rate_hz: NotRequired[float]
    states: NotRequired[dict[str, str]]
    faults: NotRequired[dict[str, str]]
    seen_from_start: NotRequired[bool]
    axes: NotRequired[list[str] | None]
    records: NotRequired[bool]
    records_why: NotRequired[str | None]
    view: NotRequired[str | None]


class Samples(TypedDict):
    """Rows of one side; a vector is a list of its axes."""

    type: Literal["samples"]
    side: Side
    t: list[float]
    columns: dict[str, Numbers | list[Numbers]]


class Felt(TypedDict):
    """The felt error of rows."""

    type: Literal["felt"]
    t: list[float]
    deadbands: Numbers
    error_n: Numbers
    bound_n: Numbers


class Alarm(TypedDict):
    """A fault that is active, or what the report would hold against the session so far."""

    level: str
    name: str
    text: str


class Figures(TypedDict):
    """The figures of the report so far, and those of the last second."""

    type: Literal["figures"]
    session: str
    figures: dict[str, Any]
    alarms: list[Alarm]
    faults: dict[Side, dict[str, int]]
    faults_now: dict[Side, str | None]
    ended: bool
    seen_from_start: bool
    packets_per_s_now: dict[str, float | None]
    reduction_now: dict[str, float | None]
    engaged: dict[Side, bool]
    button: Literal["held", "released"] | None
    ways_now: dict[str, Any]
    paths: list[dict[str, Any]]
    finding: str | None
    settings: NotRequired[dict[str, Any]]
    generation: NotRequired[int | None]


class LogEvent(TypedDict):
    """A line of the log; `wall` is in s since 1970."""

    at: float
    wall: float
    level: str
    side: Side | None
    text: str


class Events(TypedDict):
    """New events, oldest first."""

    type: Literal["events"]
    session: str
    events: list[LogEvent]


class Handle(TypedDict):
    """Who has the handle; `why` if this page cannot drive."""

    type: Literal["handle"]
    state: Literal["none", "free", "yours", "taken"]
    why: str | None


class Launcher(TypedDict):
    """The session that pages start."""

    type: Literal["launcher"]
    state: Literal["idle", "starting", "running", "failed"]
    scene: str | None
    why: str | None
    stops: int


class RecordingState(TypedDict):
    """The newest recording of the session."""

    type: Literal["recording"]
    session: str
    state: Literal["off", "on", "done", "failed"]
    path: str | None
    bytes: int
    seconds: float
    marks: int
    why: str | None


class AnswerMessage(TypedDict):
    """What came of a request of type `to`."""

    type: Literal["answer"]
    to: NotRequired[str]
    accepted: bool
    why: NotRequired[str | None]
    tick: NotRequired[int]
    settings: NotRequired[dict[str, Any]]
    pending: NotRequired[dict[str, Any] | None]
    generation: NotRequired[int]
    link: NotRequired[dict[str, float | None] | None]
    path: NotRequired[str]
    sessions: NotRequired[list[str]]


Message = Hello | Samples | Felt | Figures | Events | Handle | Launcher | RecordingState | AnswerMessage

# From a page


class _Request(TypedDict):
    """A request, with the token of the greeting."""

    token: NotRequired[str]


class ChangeRequest(_Request):
    """Change settings of the session that the page shows; the daemon checks their ranges."""

    type: Literal["change"]
    weber: NotRequired[float]
    predictor: NotRequired[str]
    delay_ms: NotRequired[float]
    jitter_ms: NotRequired[float]
    loss: NotRequired[float]


class DriveRequest(_Request):
    """Hold the handle at a target [m], or let go of it."""

    type: Literal["drive"]
    target: tuple[float, float, float]
    held: bool


class SessionRequest(_Request):
    """Start or stop a session; a start says how many emergency stops the page knows of."""

    type: Literal["session"]
    do: Literal["start", "stop"]
    scene: NotRequired[str | None]
    stops: NotRequired[int]


class EmergencyRequest(_Request):
    """Force to zero at once; also a request by POST, which does not wait for the event loop.

    `age_ms` is the time since the button was pressed: no session that was started after that is stopped.
    """

    type: Literal["emergency"]
    age_ms: NotRequired[float]


class RecordRequest(_Request):
    """Begin, mark or end a recording."""

    type: Literal["record"]
    do: Literal["start", "stop", "mark"]
    name: NotRequired[str | None]
    text: NotRequired[str | None]


Request = ChangeRequest | DriveRequest | SessionRequest | EmergencyRequest | RecordRequest

REQUEST: TypeAdapter[Any] = TypeAdapter(
    Annotated[Request, Field(discriminator="type")], config=ConfigDict(strict=True, extra="forbid", allow_inf_nan=False)
)
"""Reads a request of a page."""
