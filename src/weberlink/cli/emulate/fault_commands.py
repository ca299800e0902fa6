"""Commands to an emulated device while it runs: faults, status, help."""

import json
from collections.abc import Callable, Mapping, Sequence
from contextlib import suppress
from difflib import get_close_matches
from time import monotonic
from typing import Any, TextIO

from weberlink.hardware.emulator import ServedDevice
from weberlink.hardware.fault import HardwareFault

WIRE_FAULTS = {
    "garble": "as many of the next answers arrive with a byte changed; on a WebSocket: cut in half",
    "late": "every answer is delayed by as many seconds; 0: no delay",
    "silent": "answers are lost",
    "ok": "end these three faults",
    "unplug": "disconnect the device; one with its own power goes on",
    "plug": "connect it again",
}
WORDS = {"status": "print the state of the device as JSON", "help": "list the commands"}


class FaultCommands:
    """Interprets lines of commands.

    Args:
        name: of the device.
        emulator: of the device.
        device: its connection.
        out: stream for answers.
    """

    def __init__(self, name: str, emulator: Any, device: ServedDevice, out: TextIO) -> None:
        self._name = name
        self._emulator = emulator
        self._device = device
        self._out = out
        self._own: Mapping[str, str] = emulator.OWN_FAULTS

    def execute(self, line: str) -> None:
        """Execute a command; a wrong one is answered with the reason."""
        word, *values = line.split() or [""]
        try:
            self._do(word, _number(values))
        except (ValueError, OSError, HardwareFault) as error:
            said = str(error)
            self.say(said if said.startswith(f"{word}:") else f"{word}: {said}")

    def say(self, text: str) -> None:
        with suppress(BrokenPipeError):  # nobody reads the answers
            self._out.write(text + "\n")
            self._out.flush()

    def _do(self, word: str, value: float | None) -> None:
        wire: Mapping[str, Callable[[], None]] = {
            "": lambda: None,
            "garble": lambda: self._set("garble", int(_at_least_0(value, 1.0))),
            "late": lambda: self._set("late_s", _at_least_0(value, None)),
            "silent": lambda: self._set("silent", value != 0.0),
            "ok": self._forgive,
            "unplug": self._device.unplug,
            "plug": lambda: None if self._device.plugged else self._device.plug(),
            "status": lambda: self.say(json.dumps(self.status(), allow_nan=False)),
            "help": self._help,
        }
        if word in wire:
            wire[word]()
        elif word in self._own:
            self._emulator.inject(word, 1.0 if value is None else value)
        else:
            known = [*WIRE_FAULTS, *self._own, *WORDS]
            close = get_close_matches(word, known, n=1, cutoff=0.5)
            raise ValueError(
                f"unknown; did you mean {close[0]}?" if close else f"unknown; there are {', '.join(known)}"
            )

    def _set(self, name: str, value: float | bool) -> None:
        setattr(self._emulator.faults, name, value)

    def _forgive(self) -> None:
        faults = self._emulator.faults
        faults.garble, faults.late_s, faults.silent = 0, 0.0, False

    def _help(self) -> None:
        words = {**WIRE_FAULTS, **self._own, **WORDS}
        width = max(map(len, words))
        self.say("\n".join(f"{word:{width}}  {what}" for word, what in words.items()))
        self.say("a number may follow a fault; the default is 1")

    def status(self) -> dict[str, Any]:
        """State of the device."""
        if not self._device.plugged:  # its port does not advance it
            self._emulator.advance(monotonic())
        faults = self._emulator.faults
        return {
            "name": self._name,
            "plugged": self._device.plugged,
            "now": monotonic(),
            "faults": {"garble": faults.garble, "late_s": faults.late_s, "silent": faults.silent},
            **observed(self._emulator),
        }


def _number(values: Sequence[str]) -> float | None:
    if len(values) > 1:
        raise ValueError(f"expected one number, got {' '.join(values)}")
    return float(values[0]) if values else None


def observed(emulator: Any) -> dict[str, Any]:
    """The public attributes and properties of an emulator that are plain values or tuples of them."""
    properties = [
        name for each in type(emulator).__mro__ for name, it in vars(each).items() if isinstance(it, property)
    ]
    public = [name for name in (*vars(emulator), *properties) if not name.startswith("_")]
    values = {name: getattr(emulator, name) for name in sorted(set(public))}
    return {name: value for name, value in values.items() if _is_plain(value)}


def _is_plain(value: Any) -> bool:
    if isinstance(value, tuple | list):
        return type(value) in (tuple, list) and all(map(_is_plain, value))
    if isinstance(value, float):
        return value - value == 0.0
    return value is None or isinstance(value, bool | int | str)


def _at_least_0(value: float | None, default: float | None) -> float:
    given = default if value is None else value
    if given is None or not 0.0 <= given < 1e9:
        raise ValueError("expected a number >= 0" if given is None else f"expected a number >= 0, got {given}")
    return given
