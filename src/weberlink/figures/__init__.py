"""The figures of a session, from the telemetry records of its two sides."""
