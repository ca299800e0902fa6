"""What the whole system does when the link fails on one side only, measured from outside in virtual time.

`python -m tests.safety` (`make safety`) runs every case and writes the tables of docs/safety.md; the tests beside it
run a short selection. Nothing here looks into the protocol: a link notes when each datagram left and arrived, and
telemetry says what robot and hand did.
"""
