"""Of what `weberlink devices` says, what matters to a file."""

from weberlink.apps.devices import NO_EXTRA, NO_RULES, NOTHING, READY, Row
from weberlink.apps.doctor import Finding, Grade, Needs
from weberlink.apps.doctor.drivers import judged
from weberlink.hardware.discovery import PluggedDevice

PADDLE = PluggedDevice("/dev/ttyACM0", "Paddle")
NEEDS = Needs(drivers=(("master", "paddle"), ("slave", "point")))


def row(side: str, driver: str, state: str, *plugged: PluggedDevice, advice: tuple[str, ...] = ()) -> Row:
    return Row(
        side, driver, None, "hardware" if plugged or state == NOTHING else "virtual", None, state, plugged, advice
    )


def findings(*rows: Row, needs: Needs = NEEDS) -> list[Finding]:
    return list(judged(rows, needs))


def test_what_the_file_names_and_is_ready_is_fine() -> None:
    found = findings(row("master", "paddle", READY, PADDLE), row("slave", "point", READY))
    assert [each.grade for each in found] == [Grade.OK] * 3
    assert "/dev/ttyACM0" in found[0].found


def test_what_the_file_names_and_is_not_there_is_a_problem() -> None:
    assert findings(row("master", "paddle", NOTHING))[0].grade is Grade.PROBLEM
    barred = findings(row("master", "paddle", NO_RULES, PADDLE, advice=("sudo weberlink devices --install-rules",)))[0]
    assert (barred.grade, barred.fix) == (Grade.PROBLEM, "sudo weberlink devices --install-rules")
    extra = findings(row("slave", "point", NO_EXTRA, advice=('pip install "weberlink[x]"',)))[0]
    assert (extra.grade, extra.fix) == (Grade.PROBLEM, 'pip install "weberlink[x]"')


def test_a_slow_latency_timer_of_a_ready_device_is_advice() -> None:
    line = "/dev/ttyUSB0 holds replies back for 16 ms (latency timer): echo 1 | sudo tee x"
    found = findings(row("master", "paddle", READY, PADDLE, advice=(line,)))[0]
    assert (found.grade, found.fix) == (Grade.ADVICE, line)


def test_what_the_file_does_not_name_is_at_most_advice() -> None:
    others = (row("master", "lever", NO_RULES, PADDLE, advice=("do this",)), row("slave", "arm", NOTHING))
    found = findings(*others, needs=Needs())
    assert [(each.grade, each.fix) for each in found] == [(Grade.ADVICE, "do this")]
    assert findings(row("slave", "arm", NOTHING), needs=Needs())[0].grade is Grade.OK


def test_a_driver_of_the_same_name_on_the_other_side_is_another() -> None:
    found = findings(row("slave", "paddle", NOTHING))
    assert [each.grade for each in found] == [Grade.OK]
