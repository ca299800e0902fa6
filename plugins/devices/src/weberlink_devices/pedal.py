"""The command `pedal`: an emergency stop by a pedal, a button box or a key of the kernel's input layer (evdev)."""

from collections.abc import Callable, Collection
from select import POLLERR, POLLHUP, POLLIN, poll
from time import monotonic
from typing import TYPE_CHECKING, Annotated, Any

import typer

from weberlink.cli.output import CommandError, tell

if TYPE_CHECKING:
    from weberlink.session.emergency import EmergencyStop

LOOK_S, TELL_S = 0.002, 0.5
"""Of a stop: time between two looks for an answer, and until it is said that there is none."""


class Pedal:
    """Stops sessions when a key goes down, or when the device is lost.

    Args:
        device: an `evdev.InputDevice`.
        keys: codes that count; None for all.
        stop: begins a stop.
        say: receives lines for the user.
    """

    def __init__(
        self, device: Any, keys: Collection[int] | None, stop: "Callable[[], EmergencyStop]", say: Callable[[str], None]
    ) -> None:
        self._device, self._keys, self._stop, self._say = device, keys, stop, say
        self._poll = poll()
        self._poll.register(device.fd, POLLIN)
        self._armed: EmergencyStop | None = None
        self._tell_at = 0.0

    def run(self) -> None:
        """Until the device is lost, and what that stops has been acknowledged."""
        is_lost = False
        while not is_lost or self._armed is not None:
            is_lost = is_lost or self._watch()
            self._advance(monotonic())

    def _watch(self) -> bool:
        """Wait for a key; whether the device is lost."""
        from evdev import ecodes  # noqa: PLC0415 - not for the help

        ready = self._poll.poll(None if self._armed is None else 1e3 * LOOK_S)
        is_lost, is_pressed = any(state & (POLLERR | POLLHUP) for _, state in ready), False
        try:
            for event in self._device.read() if ready and not is_lost else ():
                is_dropped = event.type == ecodes.EV_SYN and event.code == ecodes.SYN_DROPPED  # presses may be lost
                is_down = event.type == ecodes.EV_KEY and event.value == 1
                is_pressed |= is_dropped or (is_down and (self._keys is None or event.code in self._keys))
        except OSError:
            is_lost = True
        if is_lost or is_pressed:
            if self._armed is not None:  # the new stop concerns what the old one does
                self._armed.close()
            self._armed, self._tell_at = self._stop(), monotonic() + TELL_S
        return is_lost

    def _advance(self, now: float) -> None:
        if self._armed is None:
            return
        if self._armed.advance(now):
            answer, self._armed = self._armed.answer(), None
            self._say(f"stopped: {', '.join(answer['sessions'])}" if answer["accepted"] else answer["why"])
        elif now > self._tell_at:
            self._tell_at = now + TELL_S
            self._say(f"not stopped yet: {self._armed.answer()['why']}; asked again")


def pedal(
    device: Annotated[str, typer.Argument(metavar="DEVICE", help="Its event device, for example of /dev/input/by-id.")],
    key: Annotated[
        list[str] | None, typer.Option("--key", metavar="NAME", help="Key that counts, as KEY_B; default: every one.")
    ] = None,
    session: Annotated[
        str | None,
        typer.Option("--session", metavar="ID", help="Stop this session only, by its launcher's process id."),
    ] = None,
) -> None:
    """Stop sessions of this host when a pedal or key is pressed.

    As `weberlink stop`, until Ctrl-C. The device writes to no other program meanwhile. Unplugging it is a press.
    """
    from evdev import InputDevice, ecodes  # noqa: PLC0415 - not for the help

    from weberlink.session.emergency import EmergencyStop, Scope  # noqa: PLC0415

    if unknown := [name for name in key or () if name not in ecodes.ecodes]:
        raise CommandError(f"--key {unknown[0]}: no such key; names are those of evtest, as KEY_B or BTN_0")
    codes = None if key is None else [ecodes.ecodes[name] for name in key]
    try:
        opened = InputDevice(device)
        opened.grab()
    except OSError as error:
        advice = "; add this user to the group input" if isinstance(error, PermissionError) else ""
        raise CommandError(f"{device}: {error.strerror}{advice}") from None
    if codes is not None and not set(codes) <= set(opened.capabilities().get(ecodes.EV_KEY, [])):
        raise CommandError(f"{device}: {opened.name} has no such key")
    tell(f"{opened.name} stops {'all sessions' if session is None else session}; Ctrl-C ends this")
    scope = Scope(session=session)
    Pedal(opened, codes, lambda: EmergencyStop(scope, None, monotonic()), tell).run()
    raise CommandError(f"{device}: lost; what was running is stopped")
