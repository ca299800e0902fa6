"""The live monitor: a process of its own that reads the daemons' telemetry and serves it to browsers and Prometheus.

Owns what is shown and to whom. It only ever reads the rings, so a daemon neither waits for it nor notices its death;
the one way back is a live change of settings, which a daemon takes or refuses by itself. Nothing here is imported by a
daemon.

- `feed`, `finding`: the rings of this host, and which of them belong together.
- `session`: one session as it is watched: figures, and the rows that a page draws (`samples`, `felt`, `pace`).
- `hello`, `scene`: what a page has to know before the first row.
- `viewer`, `watch`: one page's bounded queue, and the one reader that fills all of them.
- `web`, `guard`, `metrics`: HTTP, who may ask, and the figures for Prometheus.
- `remote`: the same telemetry from another host, over an authenticated link.
"""
