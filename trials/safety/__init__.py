"""What the whole system does when the link fails, in one direction or both, measured from outside in virtual time.

`make safety` runs every case and writes build/safety.md. Nothing here looks into the protocol: a link records when each
datagram left and arrived, and telemetry records what robot and hand did.
"""
