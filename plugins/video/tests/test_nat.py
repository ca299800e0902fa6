"""Pictures between two hosts behind NATs, by the pairing of the session, with the real relay and mailbox."""

from typing import Any

import pytest

pytest.importorskip("weberlink_anywhere")
from plugins.anywhere.tests.namespaces import needs_testbed
from plugins.anywhere.tests.test_finder import arguments, path_of
from plugins.anywhere.tests.testbed import CONE, Internet
from plugins.video.tests.test_live import PATTERN, Reader
from tests.program import Program
from tests.wait import until

pytestmark = [needs_testbed, pytest.mark.realtime]
__all__ = ["arguments"]


def test_pictures_find_a_path_of_their_own_and_another_one(internet: Internet, arguments: dict[str, list[Any]]) -> None:
    cameras = ("--set", f"slave.cameras={{driver: video, sources: [{PATTERN}]}}")
    lab, home = internet.home(CONE), internet.home(CONE)
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
