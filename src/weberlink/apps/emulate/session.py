"""From the name of a device to one that runs: its emulator, its port, and what goes on beside it."""

import os
import signal
import sys
from collections.abc import Mapping, Sequence
from contextlib import ExitStack
from difflib import get_close_matches
from pathlib import Path
from typing import Any, TextIO

import yaml
from pydantic import ValidationError

from weberlink.apps.emulate.fault_lines import FaultLines
from weberlink.apps.emulate.watch import Watch, child_process, fifo, stop_signals
from weberlink.hardware.emulator import PtyDevice
from weberlink.hardware.fault import HardwareFault
from weberlink.hardware.umockdev import HidNode, Testbed
from weberlink.master import emulators as devices
from weberlink.realtime.process import prepare
from weberlink.slave import emulators as robots
from weberlink.system.configuration import ConfigurationError
from weberlink.system.configuration.document import override
from weberlink.system.configuration.errors import describe

PORT = "{port}"
"""Stands for the port in the arguments of the command."""
PRIORITY = 60
"""Above the daemons: a real device has a processor of its own."""


def names() -> list[str]:
    """Of the devices that can be emulated, which are those of the drivers that talk to them."""
    return sorted({**devices.EMULATORS, **robots.EMULATORS})


def run(
    name: str,
    link: Path | None,
    overrides: Sequence[str],
    command: Sequence[str],
    *,
    out: TextIO,
    source: TextIO | None,
    faults: Path | None = None,
) -> int:
    """Emulate a device until a signal, or until the command ends. To be called in the main thread.

    Args:
        name: of the driver that is to talk to it.
        link: path of the port of a serial device; weberlink-NAME in the working directory if None.
        overrides: "key=value" for the emulator's options.
        command: to run beside it, `{port}` in it standing for the port; what a HID device is for, since no other
            process sees it. Empty for none.
        out: for the line that says where the device is, and for answers; another than the command's.
        source: of lines that say what is to go wrong; not read beside a command, which has standard input then.
        faults: a FIFO for such lines; made if it is not there, and removed then.

    Returns:
        The exit status of the command; without one 0, or 1 after a mistake in the emulator.

    Raises:
        ConfigurationError: something about this is wrong, or umockdev is missing where it is needed.
    """
    section, emulator = _build(name, overrides)
    if emulator.transport == "hid" and not command:
        raise ConfigurationError(f"{name}: a HID device is seen by one command only; say which: -- COMMAND...")
    with ExitStack() as stack:
        signals = stack.enter_context(stop_signals())
        device, port, environment = _put_on(stack, name, emulator, link)
        sources = []
        if faults is not None:
            sources.append(stack.enter_context(fifo(faults)))
        if source is not None and not command:
            # In the background of a terminal there is nothing to read, which is no reason to be stopped.
            before = signal.signal(signal.SIGTTIN, signal.SIG_IGN)
            stack.callback(signal.signal, signal.SIGTTIN, before)
            sources.append(source.fileno())
        lines = FaultLines(name, emulator, device, out)
        settings = yaml.safe_dump({"driver": name, "port": port}, default_flow_style=True, width=sys.maxsize).strip()
        lines.say(f"{name} is at {port}; configure it as {section}: {settings}")
        arguments = [argument.replace(PORT, port) for argument in command]
        child = stack.enter_context(child_process(arguments, environment)) if command else None
        return Watch(device, lines, signals, sources, child).run()


def _hurry() -> None:
    """The thread that answers for the device goes first, where this user may ask for it."""
    prepare(PRIORITY, lock_memory=False, cpu=None)


def _build(name: str, overrides: Sequence[str]) -> tuple[str, Any]:
    """Where a file names such a device, and the emulator."""
    tables: Mapping[str, Any] = {"master.device": devices, "slave.robot": robots}
    section = next((section for section, table in tables.items() if name in table.EMULATORS), None)
    if section is None:
        nearest = get_close_matches(name, names(), n=1, cutoff=0.0)
        raise ConfigurationError(
            f"no emulated device is called {name!r}; nearest is {nearest[0]!r}, there are {', '.join(names())}"
        )
    emulator_class = tables[section].load(name)
    content: dict[str, Any] = {}
    for text in overrides:
        override(content, text)
    try:
        options = emulator_class.Options.model_validate(content)
    except ValidationError as error:
        raise ConfigurationError(f"--set {describe(error, emulator_class.Options, ())}") from None
    return section, emulator_class(options)


def _put_on(stack: ExitStack, name: str, emulator: Any, link: Path | None) -> tuple[PtyDevice, str, dict[str, str]]:
    """The device, its port, and the environment for those that are to see it."""
    try:
        if emulator.transport == "hid":
            if link is not None:
                raise ConfigurationError(f"--link: a HID device has no path of its own choice; leave it out for {name}")
            testbed = stack.enter_context(Testbed(PRIORITY))
            node = stack.enter_context(HidNode(testbed, emulator, emulator.identity, begin=_hurry))
            return node, node.node, testbed.environment
        path = Path.cwd() / (link or f"weberlink-{name}")
        if path.is_symlink() and path.readlink().is_relative_to("/dev/pts") and not path.exists():
            path.unlink()  # left by a process that was killed
        return stack.enter_context(PtyDevice(emulator, path, begin=_hurry)), str(path), dict(os.environ)
    except FileExistsError as error:
        raise ConfigurationError(f"{error.filename2 or path}: is there already; take another with --link") from None
    except OSError as error:
        raise ConfigurationError(f"{error.filename2 or path}: cannot be made: {error.strerror}") from None
    except HardwareFault as fault:
        raise ConfigurationError(f"{name}: {fault}") from None
