"""Keeps the /sys of a testbed; runs in the system's Python under `umockdev-wrapper`, without this package.

Reads and writes one line of JSON each. First it reports the testbed's root; then it takes `{"add": ..., "ioctls": ...}`
and `{"remove": [...]}`. It ends with its input and removes everything.
"""

import json
import os
import sys
import tempfile
from contextlib import suppress
from importlib import import_module
from typing import Any


def main() -> None:
    try:
        import_module("gi").require_version("UMockdev", "1.0")
        umockdev: Any = import_module("gi.repository.UMockdev")
    except (ImportError, ValueError) as error:
        say({"missing": str(error)})
        return
    if (priority := int(sys.argv[1])) > 0:  # before there are threads, which inherit it
        with suppress(PermissionError):
            os.sched_setscheduler(0, os.SCHED_FIFO, os.sched_param(priority))
    testbed = umockdev.Testbed.new()
    say({"root": testbed.get_root_dir()})
    for line in sys.stdin:
        try:
            obey(testbed, json.loads(line))
        except Exception as error:  # told to whoever asked
            say({"error": str(error)})
        else:
            say({})


def obey(testbed: Any, order: dict[str, Any]) -> None:
    if "add" in order:
        if order["ioctls"]:
            with tempfile.NamedTemporaryFile("w", suffix=".ioctl") as file:
                file.write(order["ioctls"])
                file.flush()
                testbed.load_ioctl(None, file.name)
        testbed.add_from_string(order["add"])
    for path in order.get("remove", ()):
        testbed.uevent(path, "remove")
        testbed.remove_device(path)


def say(answer: dict[str, Any]) -> None:
    sys.stdout.write(json.dumps(answer) + "\n")
    sys.stdout.flush()


if __name__ == "__main__":
    main()
