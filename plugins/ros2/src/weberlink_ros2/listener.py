"""The listener: a program that takes poses from a topic and hands on those that lead the hand.

`process` starts it. Arguments: the descriptor of its socket, and the `Subscription` as JSON. It writes a line on
standard error whenever what keeps the hand from being led changes, and ends when the other end of the socket is closed.
"""

import json
import os
import signal
import socket
import sys
from contextlib import suppress
from select import POLLIN, POLLRDHUP, poll
from threading import Lock
from time import monotonic

from weberlink_pointer.target_link import pack
from weberlink_ros2.admission import SECOND_NS, Admission, Pose, Subscription
from weberlink_ros2.messages import decode, type_hash
from weberlink_ros2.names import Attachment
from weberlink_ros2.node import Node, NodeError
from weberlink_ros2.process import END_S, FAILED, LEAD, LONGEST_TEXT, ORDER_BYTES, READY, TROUBLE

TYPE = "geometry_msgs/msg/PoseStamped"
NODE = "weberlink_listener"
LOOK_MS = 200  # period of looking for what is wrong
QUIET_S = 1.0  # least time between two lines [s]


class Listener:
    """Hands on the poses of a topic as targets, by a wire to the daemon."""

    def __init__(self, subscription: Subscription, wire: socket.socket) -> None:
        self._wanted, self._wire = subscription, wire
        self._admission = Admission(subscription)
        self._lock = Lock()
        self._bad = ""
        self._told: str | None = None
        self._written: str | None = None
        self._write_at = 0.0

    def received(self, cdr: bytes, attachment: Attachment) -> None:
        """Take a message; called by threads of Zenoh."""
        now = monotonic()
        try:
            message = decode(cdr, TYPE)
        except ValueError as error:
            self._bad = f"what comes is no {TYPE}: {error}"
            return
        stamp, place, turn = message.header.stamp, message.pose.position, message.pose.orientation
        pose = Pose(
            stamp.sec * SECOND_NS + stamp.nanosec,
            message.header.frame_id,
            (place.x, place.y, place.z),
            (turn.w, turn.x, turn.y, turn.z),
            attachment.source,
            attachment.stamp_ns,
            attachment.sequence,
        )
        with self._lock:
            self._bad = ""
            target = self._admission.take(pose, now)
            if target is not None:
                # A daemon that does not read loses this one; a newer one follows.
                self._send(pack(target[0], True, int(now * 1e9), target[1]))

    def on_order(self, order: bytes) -> None:
        """Let a publisher lead, or none."""
        with self._lock:
            if order == LEAD:
                self._admission.engage()
            else:
                self._admission.release()

    def look(self, node: Node, now: float) -> None:
        """Tell the daemon and the user what is wrong, if that has changed."""
        with self._lock:
            silent, refusal = self._admission.is_silent(now), self._bad or self._admission.refusal(now)
        trouble = refusal or (self._silence(node) if silent else "")
        text = f"{self._wanted.topic}: {trouble}" if trouble else ""
        if text != self._told and self._send(TROUBLE + text.encode()[:LONGEST_TEXT]):
            self._told = text
        if text != self._written and now >= self._write_at:
            self._written, self._write_at = text, now + QUIET_S
            sys.stderr.write(f"weberlink ros2: {text or f'{self._wanted.topic}: poses lead the hand'}\n")
            sys.stderr.flush()

    def _silence(self, node: Node) -> str:
        """Why no poses come."""
        if not node.is_router and not node.connections:
            return f"not connected to a Zenoh router at {self._wanted.connect or 'this host'}"
        try:
            others = node.published(self._wanted.topic)
        except NodeError as error:
            return str(error)
        kinds = sorted({topic.type_name for topic in others})
        if kinds and TYPE not in kinds:
            return f"it is published as {', '.join(kinds)}, not as {TYPE}"
        hashes = {topic.type_hash for topic in others if topic.type_name == TYPE}
        if hashes and type_hash(TYPE) not in hashes:
            return f"its publisher has another definition of {TYPE}: {', '.join(sorted(hashes))}"
        return "no pose comes" if others else "nobody publishes it"

    def _send(self, data: bytes) -> bool:
        with suppress(OSError):  # full, or the daemon is gone, which `run` notices
            self._wire.send(data, socket.MSG_DONTWAIT)
            return True
        return False


def run(wire: socket.socket, subscription: Subscription) -> int:
    """Listen until the other end is closed; returns the exit status."""
    listener = Listener(subscription, wire)
    try:
        node = Node(NODE, subscription.domain, subscription.connect)
        node.subscribe(subscription.topic, TYPE, listener.received)
    except (NodeError, ValueError) as error:
        with suppress(OSError):
            wire.send(FAILED + str(error).encode()[:LONGEST_TEXT])
        return 1
    with suppress(OSError):  # the daemon may have ended meanwhile
        wire.send(READY)
    waiting = poll()
    waiting.register(wire.fileno(), POLLIN | POLLRDHUP)
    while True:
        events = dict(waiting.poll(LOOK_MS)).get(wire.fileno(), 0)
        if events & ~POLLIN:
            break
        if events:
            listener.on_order(wire.recv(ORDER_BYTES))
        listener.look(node, monotonic())
    signal.alarm(int(END_S) - 1)  # ends this process if Zenoh does not close
    node.close()
    return 0


def main(arguments: list[str]) -> int:
    # Whoever stops the daemon may send the same to its children; this one ends with the daemon, not before.
    for number in (signal.SIGINT, signal.SIGTERM, signal.SIGHUP, signal.SIGQUIT):
        signal.signal(number, signal.SIG_IGN)
    with suppress(OSError):  # not with the daemon's rights to real time, nor on its processor
        os.sched_setscheduler(0, os.SCHED_OTHER, os.sched_param(0))
        os.sched_setaffinity(0, range(os.cpu_count() or 1))
    values = json.loads(arguments[1])
    with socket.socket(fileno=int(arguments[0])) as wire:
        return run(wire, Subscription(*values)._replace(origin=tuple(values[4])))


if __name__ == "__main__":
    sys.exit(main(sys.argv[1:]))
