"""Plays a recording on the page as if it were a running session."""

import asyncio
from collections.abc import Callable, Sequence
from math import isfinite
from pathlib import Path
from time import monotonic
from typing import Any

import numpy as np
import yaml

from weberlink.apps.monitor.requests import Answer, refusal
from weberlink.apps.monitor.session import WatchedSession
from weberlink.apps.monitor.viewer import MessageKind, Viewer, to_json
from weberlink.apps.monitor.watch import SessionWatcher
from weberlink.system.configuration import MASTER, SLAVE, ConfigurationError
from weberlink.system.scoring.recorded import CONFIGURATION, PIECE_S, RecordedSession, put_together
from weberlink.system.scoring.session import Records
from weberlink.system.wording import INFO, Words
from weberlink.telemetry.reader import DTYPE
from weberlink.telemetry.recording.reader import Recording, RecordingError, read_recording

SPEEDS = (0.25, 8.0)
"""Slowest and fastest."""
TELL_S = 0.5


class ReplaySource:
    """A recorded session with what a page is told of it.

    Args:
        name: of the session on the page.
        session: its records, on one clock.
        descriptions: of the recorded sides, as a daemon writes them, as far as the recording knows.
        wall_offset_s: from the clock of the records to the wall clock [s].
    """

    def __init__(
        self, name: str, session: RecordedSession, descriptions: dict[str, dict[str, Any]], wall_offset_s: float
    ) -> None:
        self.name = name
        self.session = session
        self.descriptions = descriptions
        self.wall_offset_s = wall_offset_s
        self.began = min(float(records["at"][0]) for records in session.sides.values())
        """Time 0 of the replay, on the clock of the records [s]."""
        self.duration_s = max(float(records["at"][-1]) for records in session.sides.values()) - self.began


def read_source(paths: Sequence[Path], tell: Callable[[str], None]) -> ReplaySource:
    """Read the recording of one side or both, from one file or two.

    Args:
        paths: of the files.
        tell: called with a line for each file that is not whole; what there is of it is played.

    Raises:
        ConfigurationError: a file is not a recording, or the files are not of one session; one line.
    """
    try:
        recordings = [read_recording(path) for path in paths]
        session = put_together(recordings)
    except RecordingError as error:
        raise ConfigurationError(f"--replay: {error}") from None
    for recording in recordings:
        if not recording.complete:
            lost = sum(recording.lost.values())
            why = f"{lost} records were lost" if recording.outcome == "complete" else recording.outcome
            tell(f"{recording.path}: not whole ({why}); playing what is there")
    of_side = {side: recording for recording in recordings for side in recording.origins}
    reference = of_side.get(MASTER) or of_side[SLAVE]
    origin = reference.origins[MASTER if MASTER in of_side else SLAVE]
    return ReplaySource(
        paths[0].stem,
        session,
        {side: _description(side, of_side[side], session) for side in session.sides},
        origin.wall_s - origin.monotonic_s,
    )


def _description(side: str, recording: Recording, session: RecordedSession) -> dict[str, Any]:
    try:
        system = yaml.safe_load(recording.facts.get(CONFIGURATION, "{}"))
    except (yaml.YAMLError, RecursionError):
        system = {}
    return {
        "side": side,
        "file": str(recording.path),
        "rate_hz": session.rate_hz,
        "system": system if isinstance(system, dict) else {},
        "bank": list(session.bank),
        **({} if session.torque_bank is None else {"torque_bank": list(session.torque_bank)}),
        "changes": [],
    }


def of_this_release(records: Records) -> Records:
    """Records with the fields of this release in their order; other releases may have more of them."""
    if records.dtype == DTYPE:
        return records
    same = np.empty(len(records), DTYPE)
    for name in DTYPE.names or ():
        same[name] = records[name]
    return same


class ReplayFeed:
    """Feed of one side of a recording, up to a moment that its owner moves."""

    ring: Path | None = None
    in_order: bool | None = None

    def __init__(self, side: str, source: ReplaySource) -> None:
        self.side = side
        self.rate_hz = source.session.rate_hz
        self.began = source.began
        self.description: dict[str, Any] | None = source.descriptions[side]
        self.wall_offset_s: float | None = source.wall_offset_s
        self.until = -np.inf
        """Records up to this moment can be read [s]; infinity for all, and then the end."""
        self.drained = False
        self.written = 0
        self.lost = 0
        self._records = of_this_release(source.session.sides[side])

    def read(self) -> Records:
        end = int(np.searchsorted(self._records["at"], self.until, side="right"))
        first, self.written = self.written, max(self.written, end)
        self.drained = self.until == np.inf
        return self._records[first : self.written]

    def close(self) -> None:
        """Nothing to do: the recording stays in memory for the next seek."""


class Playback:
    """A recording from its beginning, as a session of the page.

    Args:
        source: what to play.
    """

    def __init__(self, source: ReplaySource) -> None:
        self._source = source
        self._feeds = [ReplayFeed(side, source) for side in source.session.sides]
        self._marks = list(source.session.marks)
        self.session = WatchedSession(source.name, self._feeds[0])
        for feed in self._feeds[1:]:
            self.session.admit(feed)

    def advance(self, position: float) -> None:
        """Let the session read up to a position [s]; at the duration, it ends."""
        at = self._source.began + position
        for feed in self._feeds:
            feed.until = np.inf if position >= self._source.duration_s else at
        while self._marks and self._marks[0].at <= at:
            mark = self._marks.pop(0)
            self.session.log.note(mark.at, None, Words(INFO, f"mark: {mark.text}"))

    def catch_up(self, position: float) -> None:
        """Read, score and log everything up to a position [s]."""
        begin = 0.0
        while begin < position:
            begin = min(begin + PIECE_S, position)
            self.advance(begin)
            self.session.look()


class PlayClock:
    """Position in a recording of a length [s]; it stops at the end."""

    def __init__(self, duration_s: float) -> None:
        self._duration_s = duration_s
        self._position = 0.0
        self._since: float | None = None
        self.speed = 1.0

    def position(self, now: float) -> float:
        """Position [s]; pauses at the end."""
        if self._since is not None:
            self._position = min(self._position + (now - self._since) * self.speed, self._duration_s)
            self._since = now if self._position < self._duration_s else None
        return self._position

    @property
    def playing(self) -> bool:
        return self._since is not None

    def play(self, now: float) -> None:
        self.position(now)
        self._since = now if self._position < self._duration_s else None

    def pause(self, now: float) -> None:
        self.position(now)
        self._since = None

    def seek(self, position: float, now: float) -> None:
        """Go to a position within the recording [s]; it plays on if it played."""
        self.position(now)
        self._position = position

    def set_speed(self, speed: float, now: float) -> None:
        self.position(now)
        self.speed = speed


class Replay:
    """Plays a recording to all pages; it begins when the first page comes.

    Every position shows the figures, the events and the history of all that was before it, so that they do not depend
    on how the position was reached, and those at the end are the figures of the report.

    Args:
        watch: sessions and pages.
        source: what to play.
    """

    def __init__(self, watch: SessionWatcher, source: ReplaySource) -> None:
        self._watch = watch
        self._source = source
        self._clock = PlayClock(source.duration_s)
        self._playback = Playback(source)
        self._target: float | None = None
        """Position that is being reached; None while it plays or pauses."""
        self._plays_after = False
        """Whether it plays on from there."""
        self._seeking: asyncio.Task[None] | None = None
        self._has_begun = False
        self._tell_at = 0.0
        self._was_playing = False
        watch.requests.add("replay", self._request)
        watch.attach(self)
        watch.put(self._playback.session)

    def look(self, now: float) -> None:
        """Move on; `now` is that of `time.monotonic`."""
        if self._target is None:
            self._playback.advance(self._clock.position(now))
        has_changed = self._clock.playing != self._was_playing
        if has_changed or (self._clock.playing and now >= self._tell_at):
            self._publish()

    def hello(self, session: WatchedSession, viewer: Viewer) -> dict[str, Any]:
        del viewer
        is_ours = session.name == self._source.name
        return {"replay": {"duration_s": round(self._source.duration_s, 6)} if is_ours else None}

    def introduced(self, session: WatchedSession, viewer: Viewer) -> None:
        if session.name != self._source.name:
            return
        if not self._has_begun:
            self._has_begun = True
            self._clock.play(monotonic())
        viewer.put(MessageKind.REPLAY, to_json(self._message()))

    async def close(self) -> None:
        """End a seek."""
        if self._seeking is not None:
            await self._seeking

    async def _request(self, viewer: Viewer, request: dict[str, Any]) -> Answer | None:
        del viewer
        why = self._complaint(request)
        if why is not None:
            return {"to": "replay"} | refusal(why)
        now = monotonic()
        if "speed" in request:
            self._clock.set_speed(float(request["speed"]), now)
        do = request.get("do")
        if do == "seek":
            self._seek(min(max(float(request["at"]), 0.0), self._source.duration_s), plays=self._plays)
        elif do == "pause":
            self._clock.pause(now)
            self._plays_after = False
        elif do == "play" and self._target is None and self._clock.position(now) >= self._source.duration_s:
            self._seek(0.0, plays=True)
        elif do == "play":
            self._plays_after = True
            if self._target is None:
                self._clock.play(now)
        self._publish()
        return {"to": "replay", "accepted": True}

    @property
    def _plays(self) -> bool:
        return self._plays_after if self._target is not None else self._clock.playing

    @staticmethod
    def _complaint(request: dict[str, Any]) -> str | None:
        """Why a request cannot be fulfilled; None if it can."""
        do, low, high = request.get("do"), *SPEEDS
        if do not in ("play", "pause", "seek", None) or (do is None and "speed" not in request):
            return 'expected "do": "play", "pause" or "seek", or "speed"'
        if "speed" in request and not (_is_number(request["speed"]) and low <= request["speed"] <= high):
            return f'expected "speed" from {low:g} to {high:g}'
        if do == "seek" and not _is_number(request.get("at")):
            return 'expected "at", a time in seconds'
        return None

    def _seek(self, position: float, *, plays: bool) -> None:
        """Reach a position in the background: from the beginning, so that figures and history are those up to there."""
        self._clock.pause(monotonic())
        self._target, self._plays_after = position, plays
        if self._seeking is None or self._seeking.done():
            self._seeking = asyncio.get_running_loop().create_task(self._reach())

    async def _reach(self) -> None:
        while True:
            position, playback = self._target or 0.0, Playback(self._source)
            await asyncio.to_thread(playback.catch_up, position)
            if position == (self._target or 0.0):  # else it was moved meanwhile
                break
        self._playback, self._target = playback, None
        now = monotonic()
        self._clock.seek(position, now)
        if self._plays_after:
            self._clock.play(now)
        self._watch.put(playback.session)
        self._publish()

    def _publish(self) -> None:
        self._was_playing = self._clock.playing
        self._tell_at = monotonic() + TELL_S
        text = to_json(self._message())
        for viewer in self._watch.viewers_of(self._source.name):
            viewer.put(MessageKind.REPLAY, text)

    def _message(self) -> dict[str, Any]:
        at = self._clock.position(monotonic()) if self._target is None else self._target
        return {
            "type": "replay",
            "session": self._source.name,
            "playing": self._plays,
            "at": round(at, 3),
            "speed": self._clock.speed,
        }


def _is_number(value: object) -> bool:
    return isinstance(value, int | float) and not isinstance(value, bool) and isfinite(value)
