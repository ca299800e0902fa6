"""The contract that every haptic device keeps, those of hardware before emulated hardware; see `weberlink.testing`."""

import json
import signal
import subprocess
from collections.abc import Callable, Iterator, Mapping, Sequence
from contextlib import AbstractContextManager
from dataclasses import dataclass, field
from itertools import pairwise
from math import inf
from pathlib import Path
from re import fullmatch, search
from statistics import median
from time import monotonic, sleep
from typing import Any, ClassVar

import pytest
from pydantic import ValidationError

from weberlink.child_process import python
from weberlink.geometry.vector import ZERO, Vector, distance, is_finite, norm
from weberlink.master.devices import DEVICES
from weberlink.master.devices.contract import Device, DeviceFault, TorqueDevice
from weberlink.master.devices.hardware_device import RAMP_S
from weberlink.session.composition.master import check_force_ends
from weberlink.testing import pushing_host
from weberlink.testing.contract import FaultContract, assert_is_read_while_open
from weberlink.testing.time import TICK, ahead_of_other_work, real_time, running_time, until

PUSH: Vector = (0.0, 1.0, 0.0)
HOST_N = 0.8  # with which the process of `StoppedHostContract` pushes along y [N]
SLACK_S = 0.02  # for which a machine that stalls may hold up what a board hears [s]
FORCES: Sequence[Vector] = ((0.5, 0.0, 0.0), (0.0, -0.5, 0.0), (0.3, 0.3, 0.3))


@dataclass
class DeviceBench:
    """A device, and the world that it is in."""

    device: Device  # not open
    tick: Callable[[], float]  # the time of the next tick [s]; waits for it where time is real
    felt: Callable[[], Vector] | None = None  # force of its motors on the hand now [N]; None where there are none
    faults: Mapping[str, Callable[..., object]] = field(default_factory=dict)
    hand: Callable[[], Vector] | None = None  # where it is [m], if the bench knows it
    options: Mapping[str, Any] = field(default_factory=dict)  # with which another process can open the device

    @property
    def displayed(self) -> float:
        """Size of the force of its motors on the hand now [N]."""
        assert self.felt is not None
        return norm(self.felt())

    def hold(self, force: Vector, ticks: int) -> Iterator[float]:
        """Command a force, tick by tick; gives each time after the command."""
        for _ in range(ticks):
            now = self.tick()
            self.device.command(force, now)
            yield now

    def push(self, force: Vector, condition: Callable[[], object]) -> None:
        """Command a force and read, tick by tick, until a condition holds; fails after a long time."""
        if not condition():
            drive(self.device, condition, force, self.tick)

    def open(self) -> None:
        self.device.open(self.tick())


def drive(
    device: Any, is_so: Callable[[], object], force: Vector = ZERO, tick: Callable[[], float] | None = None
) -> None:
    """Command a force and read, tick by tick, until something is so; in real time unless a clock of ticks is given."""
    clock = real_time() if tick is None else tick

    def goes_on() -> bool:
        now = clock()
        device.command(force, now)
        device.latest(now)
        return bool(is_so())

    until(goes_on, "what the force leads to", pause=0.0)


def fault_of(device: Any, force: Vector = (0.2, -0.4, 0.8), meanwhile: Callable[[], object] = lambda: None) -> str:
    """The fault that ends the session, in one line; something may be done in each tick until then."""
    with pytest.raises(DeviceFault) as caught:
        drive(device, lambda: meanwhile() is device, force)
    assert "\n" not in str(caught.value)
    return str(caught.value)


def refusal(device: Any) -> str:
    """Why it cannot be opened, in one line."""
    with pytest.raises(DeviceFault) as caught:
        device.open(monotonic())
    assert "\n" not in str(caught.value)
    return str(caught.value)


def armed(name: str, /, *parts: Any, checked: bool = True, **options: Any) -> Device:
    """The device of a driver, which is given the parts too; its signs count as checked, unless told otherwise."""
    driver: Any = DEVICES.load(name)
    if checked and hasattr(driver, "fingerprint"):
        options["signs_checked"] = driver.fingerprint(driver.Options(**options))
    device: Device = driver(driver.Options(**options), TICK, *parts)
    return device


class BenchedDevice:
    """A driver under test; a test class overrides `make_bench`."""

    NAME: ClassVar[str]  # of the driver, as its entry point

    def make_bench(self, folder: Path, /, **options: Any) -> AbstractContextManager[DeviceBench]:
        """A bench with a device that is not open; closes the device at the end.

        Args:
            folder: for files, empty.
            options: of the driver, besides those that the bench needs.
        """
        raise NotImplementedError


class DeviceContract(BenchedDevice):
    """What every device driver keeps."""

    REFUSED: ClassVar[Sequence[tuple[Mapping[str, Any], str]]] = ()
    """Options that no type alone refuses, and a pattern of the complaint or its place."""
    TAKEN: ClassVar[Sequence[Mapping[str, Any]]] = ()  # options at the limit

    @pytest.fixture
    def bench(self, tmp_path: Path) -> Iterator[DeviceBench]:
        with self.make_bench(tmp_path) as bench:
            yield bench

    def test_the_spec_is_there_before_opening(self, bench: DeviceBench) -> None:
        spec = bench.device.spec
        assert spec.name == self.NAME
        assert spec.axes
        assert set(spec.axes) <= set("xyz")
        assert (spec.force_n > 0.0) == spec.force_feedback
        assert spec.torque_n_m >= 0.0
        assert spec.torque_n_m == 0.0 or (spec.orientation and isinstance(bench.device, TorqueDevice))
        assert spec.rate_hz > 0.0
        lower, upper = spec.workspace_m
        assert all(a < b for a, b in zip(lower, upper, strict=True))
        assert "\n" not in spec.note
        check_force_ends(bench.device, spec.name, None)

    def test_options_are_refused_by_name_or_taken(self, bench: DeviceBench) -> None:
        driver: Any = DEVICES.load(self.NAME)
        for options in self.TAKEN:
            assert driver(driver.Options.model_validate({**bench.options, **options}), TICK).spec.name == self.NAME
        for options, named in self.REFUSED:
            with pytest.raises(ValueError, match=r"\S") as caught:
                driver(driver.Options.model_validate({**bench.options, **options}), TICK)
            error = caught.value
            errors = error.errors() if isinstance(error, ValidationError) else []
            told = "\n".join([*(".".join(map(str, each["loc"])) for each in errors), str(error)])
            assert search(named, told), told

    def test_only_open_device_is_read_close_is_idempotent(self, bench: DeviceBench) -> None:
        assert_is_read_while_open(bench.device, ZERO, bench.tick, DeviceFault)

    def test_readings_advance_without_jumps(self, bench: DeviceBench) -> None:
        device, is_virtual = bench.device, bench.felt is None
        bench.open()
        lower, upper = device.spec.workspace_m
        readings, away, stood_s, before = [], [0.0], 0.0, inf
        for now in bench.hold(ZERO, 200):
            stood_s, before = max(stood_s, now - before), now
            reading = device.latest(now)
            assert device.latest(now) == reading
            assert reading.at <= (now if is_virtual else monotonic()), "not of the future"
            assert is_finite(reading.position)
            assert all(a <= p <= b for a, p, b in zip(lower, reading.position, upper, strict=True))
            assert (reading.orientation is not None) == device.spec.orientation
            assert 0 <= reading.buttons < 1 << device.spec.buttons
            if bench.hand is not None:
                away.append(distance(bench.hand(), reading.position))
            readings.append(reading)
        # In real time an answer may have waited while this machine stood still, and the hand has gone on.
        slack = 1e-6 if is_virtual else 0.03 + 0.6 * stood_s
        for a, b in pairwise(readings):
            assert a.at <= b.at
            step = max(abs(p - q) for p, q in zip(a.position, b.position, strict=True))
            assert step <= 0.6 * (b.at - a.at) + slack, "a hand's speed"
        assert readings[0].position != readings[-1].position
        assert median(away) < 0.005, "the hand goes on while this machine stalls"

    def test_force_that_is_not_finite_raises(self, bench: DeviceBench) -> None:
        bench.open()
        with pytest.raises(ValueError, match="not finite"):
            bench.device.command((0.0, float("inf"), 0.0), bench.tick())
        assert is_finite(bench.device.latest(bench.tick()).position)


class ForceDeviceContract(FaultContract, DeviceContract):
    """What a driver of hardware with force feedback keeps besides, before an emulated device.

    The bench knows the force that is `felt`. Its faults are those of `FAULTS`, and `flicker`: some bad answers that
    pass; for a driver with the option `reconnect_s` also `unplug` and `plug`. A driver with the class method
    `fingerprint` has no force before its check of signs: then `make_bench` takes `checked` as well.
    """

    UNHEARD: ClassVar[Sequence[str]] = ()
    """Those of them behind which nothing reaches a board without a watchdog, which holds its last force."""
    MISPLACED: ClassVar[Sequence[str]] = ("restart",)  # those after which the device takes another place for its home
    OPTIONS: ClassVar[Mapping[str, Any]] = {}  # options without which there is no force at all
    SIGNS: ClassVar[Sequence[Mapping[str, Any]]] = ()
    """Options that turn an axis, each of which needs a check of signs of its own."""

    def test_motors_follow_commands_within_limit_until_close(self, bench: DeviceBench) -> None:
        felt, spec = bench.felt, bench.device.spec
        assert felt is not None
        bench.open()
        for force in FORCES:
            x, y, z = (part if axis in spec.axes else 0.0 for axis, part in zip("xyz", force, strict=True))
            bench.push(force, lambda along=(x, y, z): distance(felt(), along) < 0.05)  # type: ignore[misc]
        forces: list[float] = []

        def is_at_the_limit() -> bool:
            forces.append(bench.displayed)
            return forces[-1] > 0.5 * spec.force_n

        for _ in range(20):  # 20 ms there at the least
            bench.push((100.0, -100.0, 100.0), is_at_the_limit)
        assert max(forces) <= spec.force_n * 1.1 + 0.02
        bench.device.close()
        assert bench.displayed == 0.0

    def test_without_checked_signs_the_motors_stay_off(self, tmp_path: Path) -> None:
        driver: Any = DEVICES.load(self.NAME)
        if not hasattr(driver, "fingerprint"):
            pytest.skip("the driver has no check of signs")
        settings = [{**self.OPTIONS, **each} for each in ({}, *self.SIGNS)]
        prints = [driver.fingerprint(driver.Options(**each)) for each in settings]
        assert len(set(prints)) == len(prints)
        assert all(fullmatch("[a-f][0-9a-f]{7}", each) for each in prints), "a text in YAML, not a number"
        own = {**self.OPTIONS, "force_n": 1.0, "signs_checked": prints[0]}
        checked = driver(driver.Options(**own), TICK).spec
        assert (checked.force_feedback, checked.force_n) == (True, 1.0), "a limit of the force turns no axis"
        for print_, others in ((None, {}), ("a0000000", {}), *((prints[0], each) for each in self.SIGNS)):
            spec = driver(driver.Options(**{**own, "signs_checked": print_, **others}), TICK).spec
            assert (spec.force_n, spec.force_feedback, spec.watchdog_s) == (0.0, False, checked.watchdog_s)
            assert f"weberlink device test {self.NAME}" in spec.note or "set master.device.model" in spec.note
        with self.make_bench(tmp_path, checked=False) as bench:
            bench.open()
            for now in bench.hold((1.0, -1.0, 1.0), 100):
                bench.device.latest(now)
                assert bench.displayed == 0.0

    def test_silent_loop_ends_the_force(self, bench: DeviceBench) -> None:
        bench.open()
        bench.push(PUSH, lambda: bench.displayed > 0.5)
        until(lambda: bench.displayed == 0.0, "the end of the force", pause=0.0)

    def test_fault_ends_session_with_reason_without_force(self, fault: str, bench: DeviceBench) -> None:
        device = bench.device
        bench.open()
        start = device.latest(bench.tick()).position
        bench.push(PUSH, lambda: bench.displayed > 0.5)

        def lose_place() -> None:
            """Far from where it was switched on; again if the hand was back before the device took notice."""
            if distance(device.latest(bench.tick()).position, start) >= 0.02:
                bench.faults[fault]()

        if fault in self.MISPLACED:
            said = fault_of(device, PUSH, lose_place)
        else:
            bench.faults[fault]()
            said = fault_of(device, PUSH)
        assert self.NAME in said
        assert len(said) > len(self.NAME) + 10, "says why"

        def is_off() -> bool:
            device.command(PUSH, bench.tick())
            return bench.displayed == 0.0 or fault in self.UNHEARD

        until(is_off, "the end of the force", pause=0.0)
        with pytest.raises(DeviceFault):
            device.latest(bench.tick())

    def test_passing_bad_answers_interrupt_the_force(self, bench: DeviceBench) -> None:
        bench.open()

        def is_interrupted() -> bool:
            """Bad answers come again if the force was off and on while nobody looked."""
            if bench.displayed > 0.9:
                bench.faults["flicker"]()
            return bench.displayed < 0.05

        bench.push(PUSH, lambda: bench.displayed > 0.9)
        bench.push(PUSH, is_interrupted)
        bench.push(PUSH, lambda: bench.displayed > 0.9)

    def test_replugged_device_goes_on_and_its_force_ramps_from_zero(self, tmp_path: Path) -> None:
        driver: Any = DEVICES.load(self.NAME)
        if "reconnect_s" not in driver.Options.model_fields:
            pytest.skip("the driver does not reconnect")
        with self.make_bench(tmp_path, reconnect_s=60.0) as bench:
            device, forces = bench.device, [0.0]
            bench.open()
            bench.push(PUSH, lambda: bench.displayed > 0.9)
            bench.faults["unplug"]()
            # Behind a cut wire nothing hears of it; the reading stays as it was.
            bench.push(ZERO, lambda: getattr(device, "trouble", None) is not None)
            bench.faults["plug"]()
            bench.push(PUSH, lambda: bench.displayed == 0.0)

            def is_back() -> bool:
                forces.append(bench.displayed)
                return forces[-1] > 0.9

            bench.push(PUSH, is_back)
            assert any(0.05 < force < 0.7 for force in forces), "on the way up"


class StoppedHostContract(BenchedDevice):
    """The force ends while the process that pushes is stopped, stalled and killed in turn, and begins again from zero.

    Only processes can show it: what ends the force of a stopped one is the board, a guardian, or a process of the
    driver. It measures time; the bench knows the force that is felt, and the options for another process.
    """

    LIMIT_S: ClassVar[float] = 0.5
    PATIENT: ClassVar[Mapping[str, Any]] = {}  # options with which a driver waits longest

    def test_force_ends_while_the_host_does_nothing(self, tmp_path: Path) -> None:
        with ahead_of_other_work(), self.make_bench(tmp_path, **self.PATIENT) as bench:
            felt = bench.felt
            assert felt is not None
            command = python("-m", pushing_host.__name__, self.NAME, json.dumps(bench.options), str(HOST_N))
            with subprocess.Popen(command, stdin=subprocess.PIPE, text=True) as host:  # noqa: S603 - our own

                def ends_after(deed: Callable[[], object]) -> None:
                    began = monotonic()

                    def pushes() -> bool:
                        nonlocal began
                        before, force = monotonic(), felt()[1]
                        began = before if force == 0.0 else began
                        most = 2.0 * HOST_N * (monotonic() - began + SLACK_S) / RAMP_S
                        assert force <= most, "it comes up from zero, slowly"
                        return force > 0.5 * HOST_N

                    until(pushes, "the push", pause=1e-3)
                    deed()
                    with running_time() as ran:
                        until(lambda: felt() == ZERO, "the end of the force", pause=1e-3)
                    assert ran() <= self.LIMIT_S

                def stall() -> None:
                    assert host.stdin is not None
                    host.stdin.write("0.3\n")
                    host.stdin.flush()

                def opens() -> bool:
                    try:
                        bench.open()
                    except DeviceFault:
                        return False
                    return True

                try:
                    for stopped_s in (0.05, 0.3):
                        ends_after(lambda: host.send_signal(signal.SIGSTOP))
                        sleep(stopped_s)
                        assert felt() == ZERO
                        host.send_signal(signal.SIGCONT)
                    ends_after(stall)
                    ends_after(host.kill)
                    host.wait()
                    until(opens, "the device to be free")
                finally:
                    host.kill()
