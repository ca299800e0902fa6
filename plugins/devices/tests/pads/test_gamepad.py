"""Gamepad: axes, triggers, buttons, lost events and rumble, on a queue of events like the kernel's."""

import errno
import os
from collections import namedtuple
from collections.abc import Iterator
from typing import Any

import evdev
import pytest
from hypothesis import example, given, strategies as st

from weberlink.geometry.vector import ZERO, Vector
from weberlink.hardware.discovery import PluggedDevice
from weberlink.hardware.fault import HardwareFault
from weberlink_devices.gamepad.device import KEYS, RENEW_S, RUMBLE_S, GamepadExchange, GamepadOptions, Rumble, codes

ABS_X, ABS_Y, ABS_Z, ABS_RX, ABS_RY, ABS_RZ = range(6)
EV_ABS, EV_KEY, EV_SYN, EV_FF = codes.EV_ABS, codes.EV_KEY, codes.EV_SYN, codes.EV_FF


Range = namedtuple("Range", "value min max")
STICK, TRIGGER = Range(0, -32768, 32767), Range(0, 0, 255)
AXES = {**dict.fromkeys((ABS_X, ABS_Y, ABS_RX, ABS_RY), STICK), ABS_Z: TRIGGER, ABS_RZ: TRIGGER}


class Pad:
    """What the driver uses of `evdev.InputDevice`, on the kernel's queue of a client (drivers/input/evdev.c).

    It overflows, and whoever asks for the keys empties it of their events.
    """

    SIZE = 6

    def __init__(self, axes: dict[int, Range] | None = None) -> None:
        self.fd, self.kernel = os.pipe()
        self.axes = dict(axes or AXES)
        self.queue: list[tuple[int, int, int]] = []
        self.readable = 0
        self.pressed: set[int] = set()
        self.rumbles = True
        self.uploaded: list[tuple[int, int, int]] = []
        self.written: list[tuple[int, int, int]] = []
        self.refuses = False

    def change(self, kind: int, code: int, value: int) -> None:
        """An event of the hardware; a report ends with one of EV_SYN, and only then it can be read."""
        if kind == EV_KEY:
            (self.pressed.add if value else self.pressed.discard)(code)
        if kind == EV_ABS:
            self.axes[code] = self.axes[code]._replace(value=value)
        self.queue.append((kind, code, value))
        if len(self.queue) == self.SIZE:
            self.queue = [(EV_SYN, codes.SYN_DROPPED, 0), self.queue[-1]]
            self.readable = 0
        if kind == EV_SYN:
            self.readable = len(self.queue)
            os.write(self.kernel, b"x")

    def report(self, *changes: tuple[int, int, int]) -> None:
        for change in (*changes, (EV_SYN, 0, 0)):
            self.change(*change)

    def read(self) -> Iterator[evdev.InputEvent]:
        os.read(self.fd, 1000)
        taken, self.queue = self.queue[: self.readable], self.queue[self.readable :]
        self.readable = 0
        return iter([evdev.InputEvent(1, 0, kind, code, value) for kind, code, value in taken])

    def active_keys(self) -> list[int]:
        self.readable -= sum(kind == EV_KEY for kind, _, _ in self.queue[: self.readable])
        self.queue = [change for change in self.queue if change[0] != EV_KEY]
        return list(self.pressed)

    def capabilities(self) -> dict[int, Any]:
        found: dict[int, Any] = {EV_KEY: list(KEYS), EV_ABS: list(self.axes.items())}
        return {**found, EV_FF: [codes.FF_RUMBLE]} if self.rumbles else found

    def absinfo(self, code: int) -> Range:
        return self.axes[code]

    def upload_effect(self, effect: Any) -> int:
        if self.refuses:
            raise OSError(errno.ENOSPC, "No space left on device")
        rumble = effect.u.ff_rumble_effect
        assert rumble.strong_magnitude == rumble.weak_magnitude
        self.uploaded.append((effect.id, rumble.strong_magnitude, effect.ff_replay.length))
        return 7

    def write(self, kind: int, code: int, value: int) -> None:
        self.written.append((kind, code, value))

    def unplug(self) -> None:
        os.close(self.kernel)
        self.kernel = -1

    def close(self) -> None:
        for descriptor in {self.fd, self.kernel} - {-1}:
            os.close(descriptor)
        self.fd = self.kernel = -1


@pytest.fixture
def pad() -> Iterator[Pad]:
    pad = Pad()
    yield pad
    pad.close()


def opened(pad: Pad, **options: Any) -> GamepadExchange:
    exchange = GamepadExchange(GamepadOptions(**options), lambda: [PluggedDevice("pad")], lambda path: pad)
    exchange.open()
    return exchange


PULLED = ("ABS_Y", "ABS_X", "triggers")


@pytest.mark.parametrize(
    ("axes", "happens", "move", "buttons"),
    [
        (None, [], ZERO, 0),
        (None, [(EV_ABS, ABS_X, 32767), (EV_ABS, ABS_Y, -32768), (EV_ABS, ABS_RY, -32768)], (-1.0, 1.0, 1.0), 0),
        (None, [(EV_ABS, ABS_RZ, 200), (EV_KEY, KEYS[0], 1)], ZERO, 0b1000_0001),
        (None, [(EV_KEY, 0x138, 1), (EV_KEY, KEYS[5], 1)], ZERO, 0b110_0000),
        (PULLED, [(EV_ABS, ABS_RZ, 255)], (0.0, 0.0, -1.0), 0),
        (PULLED, [(EV_ABS, ABS_Z, 255)], (0.0, 0.0, 1.0), 0),
    ],
)
def test_sticks_triggers_and_keys_are_read(pad: Pad, axes: Any, happens: Any, move: Vector, buttons: int) -> None:
    exchange = opened(pad, **({} if axes is None else {"axes": axes}))
    pad.report(*happens)
    assert exchange.exchange(ZERO) == (pytest.approx(move, abs=1e-4), ZERO, buttons)


HAPPENS = st.one_of(
    st.tuples(st.just(EV_KEY), st.sampled_from(KEYS[:3]), st.integers(0, 1)),
    st.tuples(st.just(EV_ABS), st.just(ABS_X), st.sampled_from([-32768, 0, 32767])),
    st.just((EV_SYN, 0, 0)),
    st.just(None),
)


@given(st.lists(HAPPENS, max_size=60), st.integers(0, 60), st.booleans())
@example([(EV_KEY, KEYS[0], 0), *[(EV_ABS, ABS_X, 0)] * 6, (EV_KEY, KEYS[0], 1), (EV_SYN, 0, 0), None], 1, False)
def test_state_is_right_whenever_events_are_lost_and_read(happens: list[Any], late: int, pressed: bool) -> None:
    """None: the driver looks. More happens between its reading of events and its asking for the state."""
    pad = Pad()
    pad.pressed = {KEYS[1]} if pressed else set()
    exchange = opened(pad)
    meanwhile = happens[:late]

    def read() -> Iterator[evdev.InputEvent]:
        events = list(Pad.read(pad))
        while meanwhile and (change := meanwhile.pop(0)) is not None:
            pad.change(*change)
        return iter(events)

    pad.read = read  # type: ignore[method-assign]
    for change in happens[late:]:
        if change is None:
            exchange.exchange(ZERO)
        else:
            pad.change(*change)
    pad.change(EV_SYN, 0, 0)
    while pad.queue or meanwhile:
        exchange.exchange(ZERO)
        pad.change(EV_SYN, 0, 0)
        exchange.exchange(ZERO)
    seen = exchange.exchange(ZERO)
    assert seen.buttons == sum((code in pad.pressed) << bit for bit, code in enumerate(KEYS))
    assert seen.move[1] == pytest.approx(pad.axes[ABS_X].value / 32768, abs=1e-4)
    pad.close()


def test_missing_axis_and_unplugging_are_faults(pad: Pad) -> None:
    few = Pad({ABS_X: Range(0, -1, 1), ABS_Y: Range(0, -1, 1), ABS_Z: Range(0, 0, 1)})
    with pytest.raises(HardwareFault, match=r"has no axis ABS_RY, it has ABS_X, ABS_Y, ABS_Z; set master.device.axes"):
        opened(few)
    assert few.fd == -1
    exchange = opened(pad)
    pad.unplug()
    with pytest.raises(HardwareFault, match="pad: unplugged"):
        exchange.exchange(ZERO)


def test_rumble_follows_the_force_and_stops(pad: Pad) -> None:
    rumble = Rumble(pad, 4.0)
    length = round(RUMBLE_S * 1e3)
    rumble.feel(ZERO, 0.0)
    assert (pad.uploaded, pad.written) == ([], [])
    rumble.feel((0.0, 0.0, 2.0), 0.01)
    rumble.feel((0.0, 0.0, 2.01), 0.02)
    assert pad.uploaded == [(-1, 0x8000, length)]
    rumble.feel((0.0, 0.0, 2.01), 0.02 + RENEW_S)
    rumble.feel((0.0, 0.0, -40.0), 0.13)
    assert [each[:2] for each in pad.uploaded[1:]] == [(7, round(0xFFFF * 2.01 / 4.0)), (7, 0xFFFF)]
    assert pad.written == [(EV_FF, 7, 1)] * 3
    rumble.feel(ZERO, 0.14)
    assert pad.written[-1] == (EV_FF, 7, 0)
    assert RENEW_S < RUMBLE_S


@pytest.mark.parametrize(("rumbles", "refuses"), [(True, False), (True, True), (False, False)])
def test_a_pad_may_rumble_and_stops_when_closed(pad: Pad, rumbles: bool, refuses: bool) -> None:
    pad.rumbles, pad.refuses = rumbles, refuses
    exchange = opened(pad)
    exchange.exchange((0.0, 0.0, 3.0))
    pad.refuses = False
    exchange.exchange((0.0, 0.0, 5.0))
    exchange.close()
    exchange.close()
    assert pad.written[-1:] == ([(EV_FF, 7, 0)] if rumbles and not refuses else [])
    assert pad.fd == -1
