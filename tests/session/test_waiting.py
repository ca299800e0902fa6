"""Daemons that wait for their order."""

from socket import AF_UNIX, SOCK_SEQPACKET, socketpair

from weberlink.session.waiting import WaitingDaemon, received


def test_the_death_of_the_launcher_is_no_order() -> None:
    ours, its = socketpair(AF_UNIX, SOCK_SEQPACKET)
    ours.close()
    assert received(its.detach()) is None


def test_a_daemon_without_an_order_is_not_left_behind() -> None:
    with WaitingDaemon("slave") as waiting:
        child = waiting.child
        assert child.running
    assert not child.running
