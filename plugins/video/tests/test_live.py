"""Pictures of live sessions: over a link of their own by a watching key, on one host, and what of it fails alone.

Only live processes have cameras that vanish, readers that never read, and a launcher that says what has ended.
"""

import os
import signal
import socket
from contextlib import AbstractContextManager, ExitStack, closing, suppress
from io import BytesIO
from pathlib import Path
from statistics import median

import numpy as np
import psutil
import pytest
from PIL import Image

from plugins.video.tests.test_jpeg import claims, jpeg
from tests.program import Program, child, document, faults_of, free_port
from tests.wait import until
from weberlink.config.cameras import path_beside
from weberlink.protocol.keys import Right, generate
from weberlink.session.control_socket import control_sockets, session_of
from weberlink.telemetry.ring import default_path
from weberlink_figures.pictures import LARGEST, Picture, split
from weberlink_figures.watching.rings import RingSource
from weberlink_figures.watching.session import WatchedSession
from weberlink_video.pattern import time_in

pytestmark = pytest.mark.realtime

PATTERN = "{name: test, kind: pattern, size: [320, 240], rate_hz: 30}"


def write(path: Path, key: Path | None, *, port: int = 0, pictures: int = 47_001, sources: str = PATTERN) -> Path:
    security = "security: none" if key is None else f"key_file: {key}"
    address = f"127.0.0.1:{port}"
    path.write_text(
        f"link: {{listen: '{address}', slave: '{address}', silence_ms: 2000, {security}}}\n"
        f"slave: {{robot: {{driver: point}}, cameras: {{driver: video, port: {pictures}, sources: [{sources}]}}}}\n"
    )
    return path


class Reader(AbstractContextManager["Reader"]):
    def __init__(self, pid: int, side: str) -> None:
        path = path_beside(default_path(f"{pid}-{side}"))
        self._socket = socket.socket(socket.AF_UNIX)

        def connects() -> bool:
            with suppress(FileNotFoundError, ConnectionRefusedError):  # the path is there before its socket listens
                self._socket.connect(str(path))
                return True
            return False

        until(connects, "who serves the pictures")
        self._socket.setblocking(False)
        self._rest = b""

    def __exit__(self, *_: object) -> None:
        self._socket.close()

    def read(self) -> list[Picture]:
        data = b""
        try:
            while part := self._socket.recv(1 << 20):
                data += part
        except BlockingIOError:
            pass
        pictures, self._rest = split(self._rest + data)
        return pictures

    def first(self, *, note: bool = False) -> Picture:
        def look() -> Picture | None:
            return next((each for each in self.read() if bool(each.note) is note), None)

        return until(look, "a note" if note else "a picture")


def shown(picture: Picture) -> float | None:
    return time_in(np.asarray(Image.open(BytesIO(picture.jpeg)).convert("L")))


def pictures_process(program: Program) -> psutil.Process:
    return psutil.Process(until(lambda: child(program.pid, "weberlink_video.process"), "the process of the pictures"))


def test_pictures_cross_by_the_key_of_the_session_on_the_clock_of_each_host(tmp_path: Path) -> None:
    generate(tmp_path / "key")
    file = write(tmp_path / "two.yaml", tmp_path / "key", port=free_port(), pictures=free_port())
    with Program("slave", file) as slave, Program("master", file) as master, Reader(master.pid, "master") as reader:
        pictures = [reader.first()]
        until(lambda: pictures.extend(reader.read()) or len(pictures) >= 20, "20 pictures")
        assert {picture.camera for picture in pictures} == {"test"}
        off_s = [abs(picture.at - time) for picture in pictures if (time := shown(picture)) is not None]
        assert len(off_s) == len(pictures) and median(off_s) < 5e-3, "stamped at its capture, on this clock"
        assert os.sched_getscheduler(pictures_process(slave).pid) == os.SCHED_OTHER, "with no right of a daemon"


def test_watcher_sees_a_running_robot_on_the_page_and_can_change_nothing(tmp_path: Path) -> None:
    for name in ("wall", "hall"):
        generate(tmp_path / name, Right.WATCH, name)
    (keys := tmp_path / "keys").touch(0o600)
    keys.write_text("".join((tmp_path / name).read_text() for name in ("wall", "hall")))
    ports = {"port": free_port(), "pictures": free_port()}
    files = [write(tmp_path / f"{name}.yaml", tmp_path / name, **ports) for name in ("keys", "wall", "hall")]
    with Program("slave", files[0]) as slave, Program("watch", files[1]) as wall:
        ring = default_path(f"{wall.pid}-master")
        with Reader(wall.pid, "master") as reader:
            assert shown(picture := reader.first()) == pytest.approx(picture.at, abs=5e-3)
        with closing(WatchedSession(str(wall.pid), RingSource(ring))) as session:
            assert not any(map(len, session.look().records.values()))
            assert not session.description.get("changes"), "so that the page is read only"
            assert not any(session.faults.values())
            assert session.description["system"]["slave"]["cameras"]["driver"] == "video"
        assert {session_of(path) for path in control_sockets()} & {str(wall.pid), str(slave.pid)} == {str(slave.pid)}
        with Program("watch", files[2]) as hall:
            status, _, errors = hall.finish()
        assert (status, "'wall'; slave.cameras.watchers: 1 of both files allows no more" in errors) == (1, True)
        wall.send(signal.SIGINT)
        assert wall.finish()[0] == 0
        assert not ring.exists()


def test_camera_that_fails_ends_no_session_and_is_named(tmp_path: Path) -> None:
    pipe = tmp_path / "pipe"
    os.mkfifo(pipe)
    sources = f"{PATTERN}, {{name: gone, device: {tmp_path / 'nothing'}}}, {{name: pipe, device: {pipe}}}"
    file = write(tmp_path / "one.yaml", None, sources=sources)
    report = tmp_path / "report.json"
    with Program("loopback", file, "--json", report) as session, Reader(session.pid, "slave") as reader:
        assert "nothing" in reader.first(note=True).note
        for data, why in ((jpeg(64, 48) + claims(60_000, 60_000), "60000"), (b"\xff\xd8" + b"rubbish" * 99, "damaged")):
            with pipe.open("wb", buffering=0) as camera:
                camera.write(data)
                assert why in reader.first(note=True).note
        assert reader.first().camera == "test"
        session.send(signal.SIGINT)
        assert session.finish()[0] == 0
    assert faults_of(document(report.read_text())) == {"master": {}, "slave": {}}


def test_reader_that_never_reads_and_endless_picture_grow_nothing(tmp_path: Path) -> None:
    pipe = tmp_path / "pipe"
    os.mkfifo(pipe)
    file = write(tmp_path / "one.yaml", None, sources=f"{PATTERN}, {{name: pipe, device: {pipe}}}")
    with Program("loopback", file) as session, ExitStack() as readers:
        reader = readers.enter_context(Reader(session.pid, "slave"))
        for _ in range(8):
            readers.enter_context(Reader(session.pid, "slave"))
        reader.first()
        process = pictures_process(session)
        before = process.memory_info().rss
        with pipe.open("wb", buffering=0) as camera, suppress(BrokenPipeError):
            camera.write(jpeg(64, 48)[:-2])
            for _ in range(2 * LARGEST // (1 << 16)):
                camera.write(bytes(1 << 16))
        reader.read()
        until(lambda: any(each.camera == "test" for each in reader.read()), "further pictures")
        assert process.memory_info().rss - before < 8 * 2 * LARGEST + 2**25


def test_session_goes_on_without_the_process_of_the_pictures(tmp_path: Path) -> None:
    file = write(tmp_path / "one.yaml", None)
    with Program("loopback", file) as session:
        with Reader(session.pid, "slave") as reader:
            reader.first()
        robot = session.engaged("slave")
        pictures_process(session).kill()
        while "no more pictures: their process was killed by SIGKILL" not in (line := session.next_error()):
            assert line
        count = len(robot.records)
        until(lambda: len(robot.records) > count + 100, "further ticks")
        session.send(signal.SIGINT)
        status, _, said = session.finish()
        assert (status, "no more pictures" in said) == (0, False)
