"""Pictures between two hosts behind NATs, by the pairing of the session, with the real relay and mailbox."""

from pathlib import Path
from typing import Any

import pytest

pytest.importorskip("weberlink_anywhere")
from plugins.anywhere.tests.namespaces import needs_testbed
from plugins.anywhere.tests.test_finder import arguments, path_of
from plugins.anywhere.tests.testbed import CONE, Internet
from plugins.video.tests.test_live import PATTERN, Reader
from tests.program import Program
from tests.wait import until
from weberlink.protocol.keys import Right
from weberlink_anywhere.peers import PeerStore

pytestmark = [needs_testbed, pytest.mark.realtime]
__all__ = ["arguments"]


def test_pictures_find_a_path_of_their_own_and_another_one_and_so_does_a_watcher(
    internet: Internet, arguments: dict[str, list[Any]], tmp_path: Path
) -> None:
    cameras = ("--set", f"slave.cameras={{driver: video, sources: [{PATTERN}]}}")
    lab, home, hall = (internet.home(CONE) for _ in range(3))
    PeerStore(tmp_path / "slave").allow("pedal", Right.WATCH)  # which is the host of `remote`
    with (
        Program(*arguments["slave"], *cameras, prefix=lab.prefix) as slave,
        Program(*arguments["master"], *cameras, prefix=home.prefix) as master,
    ):
        master.engaged("master")
        slave.engaged("slave")
        with Reader(master.pid, "master") as reader:
            reader.first()
            home.first.space.forget_connections()
            until(lambda: path_of(master, "master")["changes"] > 0, "another path of the session")
            reader.read()
            until(lambda: len(reader.read()) > 0 and reader.first(), "pictures on another path")
            with Program("watch", *arguments["remote"][1:], *cameras, prefix=hall.prefix) as watching:
                with Reader(watching.pid, "master") as watcher:
                    watcher.first()
                reader.read()
                until(reader.first, "pictures of the operator, beside those of a watcher")
