"""The live monitor: a separate process that reads the daemons' telemetry and serves it to browsers and Prometheus.

It only reads the rings, so no daemon waits for it or notices its death. Live changes of settings are requests, which a
daemon accepts or refuses.
"""
