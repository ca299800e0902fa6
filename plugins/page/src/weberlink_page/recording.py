"""Recordings that pages start: one recorder process for a session, its state, and its marks."""

import os
import re
from collections.abc import Callable
from dataclasses import dataclass
from datetime import datetime
from itertools import count
from pathlib import Path
from time import monotonic
from typing import Any

from weberlink.session.recorder import FINISH_LIMIT_S
from weberlink.telemetry.recorders import COMPLETE, RECORDERS, Recorder, format_of
from weberlink_figures.watching.control import Answer, refusal
from weberlink_figures.watching.session import WatchedSession
from weberlink_figures.wording import INFO, WARN, Words
from weberlink_page.viewer import Viewer, put_all
from weberlink_page.watch import SessionWatcher

FOLDER = Path("recordings")  # where recordings go if nothing else is said
LONGEST_NAME = 80
TELL_S = 1.0
OFF = {"state": "off", "path": None, "bytes": 0, "seconds": 0.0, "marks": 0, "why": None}


@dataclass
class _Recording:
    """A recording of a session, running or over."""

    recorder: Recorder
    path: Path
    began: float
    marks: int = 0
    state: str = "on"
    size: int = 0
    seconds: float = 0.0
    why: str | None = None
    kill_at: float | None = None  # when to give up a recorder that was told to finish

    def look(self, now: float) -> bool:
        """Bring the state up to date; returns whether the recording has ended."""
        self.seconds = now - self.began
        if self.recorder.running:
            self.size = self.path.stat().st_size if self.path.exists() else 0
            if self.kill_at is not None and now > self.kill_at:
                self.recorder.kill()
            return False
        summary = self.recorder.finish()
        self.size = int(summary["bytes"])
        lost = sum(summary.get("lost", {}).values())
        if summary["outcome"] != COMPLETE:
            kept = f"; {self.size / 1e6:.1f} MB are kept and can be read" if self.size else ""
            self.state, self.why = "failed", f"{summary['outcome']}{kept}"
        else:
            self.state, self.why = "done", f"{lost} records were lost" if lost else None
        return True

    def facts(self) -> dict[str, Any]:
        return {
            "state": self.state,
            "path": str(self.path),
            "bytes": self.size,
            "seconds": round(self.seconds, 1),
            "marks": self.marks,
            "why": self.why,
        }


class RecordingService:
    """Starts, marks and ends the recordings of the running sessions of this host, in a folder made on first use."""

    def __init__(self, watch: SessionWatcher, folder: Path, tell: Callable[[str], None]) -> None:
        self._watch = watch
        self._folder = folder.absolute()
        self._tell = tell
        self._recordings: dict[str, _Recording] = {}  # the newest recording of each session
        self._failures: dict[str, str] = {}  # why the last start of a session failed
        self._tell_at = 0.0
        watch.requests.handlers["record"] = self._record
        watch.recording = self

    def look(self, now: float) -> None:
        """Watch the recorders; pages are told once a second, and at once of an end."""
        is_time = now >= self._tell_at
        if is_time:
            self._tell_at = now + TELL_S
        for name, recording in self._recordings.items():
            if recording.state == "on":
                has_ended = recording.look(monotonic())
                if has_ended:
                    line = _line(recording)
                    self._tell(line)
                    if (session := self._watch.sessions.get(name)) is not None:
                        level = WARN if recording.state == "failed" else INFO
                        session.log.note(monotonic(), None, Words(level, line))
                if has_ended or is_time:
                    self._publish(name)
        for name in [name for name in self._recordings if name not in self._watch.sessions]:
            if self._recordings[name].state != "on":
                del self._recordings[name]

    def hello(self, session: WatchedSession, viewer: Viewer) -> dict[str, Any]:
        """Whether the page can record the session; if not, why, for one that may change it."""
        why = self._refusal(session) if viewer.may_change else None
        return {"records": viewer.may_change and why is None, "records_why": why}

    def introduced(self, session: WatchedSession, viewer: Viewer) -> None:
        viewer.put("recording", self._message(session.name))

    def close(self) -> None:
        """Finish all recordings."""
        running = [recording for recording in self._recordings.values() if recording.state == "on"]
        for recording in running:
            recording.recorder.stop()
        for recording in running:
            recording.recorder.finish()
            recording.look(monotonic())
            self._tell(_line(recording))

    async def _record(self, viewer: Viewer, request: dict[str, Any]) -> Answer:
        session = self._watch.sessions.get(viewer.watching or "")
        why = "there is no session" if session is None else self._refusal(session)
        if session is None or why is not None:
            return refusal(why or "")
        if request["do"] == "start":
            return self._start(session, request.get("name"))
        recording = self._recordings.get(session.name)
        if recording is None or recording.state != "on":
            return refusal("the session is not being recorded")
        if request["do"] == "stop":
            recording.recorder.stop()
            recording.kill_at = monotonic() + FINISH_LIMIT_S
        else:
            text = recording.recorder.mark(request.get("text") or "")
            recording.marks += 1
            session.log.note(monotonic(), None, Words(INFO, f"mark: {text}"))
            self._publish(session.name)
        return {"accepted": True}

    def _refusal(self, session: WatchedSession) -> str | None:
        """Why a session cannot be recorded; None if it can."""
        if session.ended or "system" not in session.description:
            return "only a running session of this host can be recorded"
        try:
            format_of(self._folder, "recording")
        except ValueError as error:
            return str(error)
        return None

    def _start(self, session: WatchedSession, name: str | None) -> Answer:
        earlier = self._recordings.get(session.name)
        if earlier is not None and earlier.state == "on":
            return refusal(f"the session is being recorded already, to {earlier.path}")
        try:
            path = self._free_path(file_name(name, session.name), next(iter(RECORDERS)))
        except OSError as error:
            why = f"{self._folder}: cannot be written: {error.strerror}"
            self._failures[session.name] = why
            self._recordings.pop(session.name, None)
            self._publish(session.name)
            return refusal(why)
        self._failures.pop(session.name, None)
        rings = {side: str(source.ring) for side, source in session.sources.items()}
        began = monotonic()
        recorder = format_of(path, "recording").start(session.description, rings, path, since=began)
        self._recordings[session.name] = _Recording(recorder, path, began)
        session.log.note(began, None, Words(INFO, f"recording begins: {path.name}"))
        self._publish(session.name)
        return {"accepted": True, "path": str(path)}

    def _free_path(self, name: str, suffix: str) -> Path:
        """A path that does not exist yet, in the folder; raises OSError if that cannot be made or written."""
        self._folder.mkdir(parents=True, exist_ok=True)
        if not os.access(self._folder, os.W_OK | os.X_OK):
            raise PermissionError(13, "Permission denied")
        taken = {recording.path for recording in self._recordings.values()}
        names = (f"{name}{f'-{number}' if number > 1 else ''}.{suffix}" for number in count(1))
        paths = (self._folder / each for each in names)
        return next(path for path in paths if path not in taken and not os.path.lexists(path))

    def _publish(self, name: str) -> None:
        put_all(self._watch.viewers_of(name), "recording", self._message(name))

    def _message(self, name: str) -> dict[str, Any]:
        recording, failure = self._recordings.get(name), self._failures.get(name)
        facts = OFF if recording is None else recording.facts()
        told = {"type": "recording", "session": name} | facts
        return told if failure is None else told | {"state": "failed", "why": failure}


def file_name(name: str | None, session: str) -> str:
    """The name of a file for a recording, without path, leading dots and suffix; the session and the time if empty."""
    stem = re.sub(r"[^\w.-]+", "-", (name or "").removesuffix(".mcap"))[:LONGEST_NAME].strip(".-")
    return stem or f"session-{session}-{datetime.now():%Y%m%d-%H%M%S}"


def _line(recording: _Recording) -> str:
    if recording.state == "failed":
        return f"the recording failed: {recording.path}: {recording.why}"
    return f"recorded {recording.seconds:.1f} s: {recording.path}" + (f" ({recording.why})" if recording.why else "")
