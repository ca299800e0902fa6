"""Two hosts and a wire between them: network namespaces."""

import os
import shutil
import subprocess
from collections.abc import Iterator
from contextlib import ExitStack

import pytest

ROBOT, OPERATOR = "10.213.47.1", "10.213.47.2"


def ip(*arguments: str) -> None:
    """Run `ip`; skip, with its own words, where it is not permitted."""
    ended = subprocess.run(["ip", *arguments], capture_output=True, text=True, check=False)
    if ended.returncode != 0:
        refusal = ended.stderr.strip()
        if "not permitted" in refusal or "denied" in refusal:
            pytest.skip(f"ip {' '.join(arguments)}: {refusal}")
        pytest.fail(f"ip {' '.join(arguments)}: {refusal}")


@pytest.fixture
def hosts() -> Iterator[tuple[str, str]]:
    """Names of two namespaces, the robot's and the operator's, joined by a pair of interfaces."""
    if shutil.which("ip") is None:
        pytest.skip("there is no `ip` to make network namespaces with")
    names = f"wl{os.getpid()}r", f"wl{os.getpid()}o"
    with ExitStack() as made:
        for name in names:
            ip("netns", "add", name)
            made.callback(ip, "netns", "del", name)  # and with it what it holds
        robot, operator = names
        ip("-n", robot, "link", "add", "wire", "type", "veth", "peer", "name", "wire", "netns", operator)
        for name, address in ((robot, ROBOT), (operator, OPERATOR)):
            ip("-n", name, "address", "add", f"{address}/30", "dev", "wire")
            ip("-n", name, "link", "set", "wire", "up")
        yield names
