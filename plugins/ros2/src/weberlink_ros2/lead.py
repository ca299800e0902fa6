"""Lets a ROS 2 topic lead the hand of a running session, until it ends: the act that the topic cannot give."""

import sys
from signal import SIGHUP, SIGINT, SIGTERM, signal
from threading import Event

from weberlink.config import MASTER
from weberlink.geometry.vector import ZERO
from weberlink.telemetry.reader import RingReader
from weberlink_figures.watching.rings import living_ring
from weberlink_pointer.target_link import PointerSender

PERIOD_S = 0.03
ANEW_S = 0.3  # how long it lets go at first, so that a new publisher may lead


def lead(session: str | None) -> None:
    """Hold until a signal, or until the session ends; raises NoSessionError if there is none, or more than one and none
    is named.
    """
    over = Event()
    for number in (SIGINT, SIGTERM, SIGHUP):
        signal(number, lambda _number, _frame: over.set())
    ring = living_ring(MASTER, session)
    end = RingReader(ring.path)
    sender = PointerSender(end.pid)
    try:
        sender.send(ZERO, held=False)
        over.wait(ANEW_S)
        sys.stderr.write(f"weberlink lead: the topic leads session {ring.session}; Ctrl-C lets go\n")
        while end.alive and not over.wait(PERIOD_S):
            sender.send(ZERO, held=True)
        sender.send(ZERO, held=False)
    finally:
        sender.close()
        end.close()
