"""Programs beside a session that carry its telemetry to other systems; no daemon imports them."""
