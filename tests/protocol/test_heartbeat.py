from protocol.heartbeat import INTRODUCTION_INTERVAL, INTRODUCTIONS, REPORT_INTERVAL, HeartbeatSchedule
from protocol.loss import CLEAN_INTERVAL, SHORTEST_INTERVAL

WINDOW, TICK = 0.06, 0.001


def introduced(now: float = 0.0) -> HeartbeatSchedule:
    schedule = HeartbeatSchedule(now, WINDOW, TICK)
    for _ in range(INTRODUCTIONS):
        schedule.sent(now)
        schedule.reported(now, is_confirmed=True)
    return schedule


def test_the_first_one_is_due_at_once() -> None:
    schedule = HeartbeatSchedule(5.0, WINDOW, TICK)
    assert schedule.due(is_engaged=True) <= 5.0
    assert schedule.due(is_engaged=False) <= 5.0


def test_introductions_go_on_until_the_peer_was_heard() -> None:
    schedule = HeartbeatSchedule(0.0, WINDOW, TICK)
    for _ in range(50):
        schedule.sent(0.0)
        schedule.reported(0.0, is_confirmed=False)
    assert schedule.due(is_engaged=True) == INTRODUCTION_INTERVAL
    assert introduced().due(is_engaged=True) == CLEAN_INTERVAL


def test_any_datagram_puts_a_heartbeat_off_but_for_the_report() -> None:
    schedule = introduced()
    for step in range(1, 100):
        schedule.sent(0.01 * step)
    assert schedule.due(is_engaged=True) == REPORT_INTERVAL
    assert schedule.due(is_engaged=False) == REPORT_INTERVAL


def test_loss_makes_them_denser_only_while_engaged() -> None:
    schedule = introduced()
    schedule.adapt(1.0)
    assert schedule.due(is_engaged=True) == SHORTEST_INTERVAL
    assert schedule.due(is_engaged=False) == CLEAN_INTERVAL


def test_an_acknowledgement_brings_one_forward_once() -> None:
    schedule = introduced()
    schedule.acknowledge_by(0.02)
    schedule.acknowledge_by(0.03)
    assert schedule.due(is_engaged=True) == 0.02
    schedule.sent(0.02)
    assert schedule.due(is_engaged=True) == 0.02 + CLEAN_INTERVAL
