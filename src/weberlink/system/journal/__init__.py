"""The log of a live session: one JSON object a line, made of the telemetry of its sides, outside every loop.

However often something changes, a side makes at most one line a second of a kind; what came in between is counted in
`suppressed`, and the newest of it is told when the second is over.

Every line has `time` (UTC), `side` and `event`; every line that stands for a tick has `tick` and `at_s`, its deadline
on the monotonic clock, as in recordings.

| event | says |
|---|---|
| `started` | `state`, `scheme`, `rate_hz` |
| `idle`, `connecting`, `listening`, `engaged`, `silent`, `closed` | the state is so now; `before` |
| `fault`, `recovered` | `fault` by name; on recovery `lasted_s` |
| `scheme` | control scheme at work: `scheme`, `before` |
| `settings` | live changes in force: `generation` |
| `missed` | deadlines without a tick since the last such line: `ticks` |
| `clipped` | ticks whose output a limiter changed since the last such line: `ticks` |
| `slewed` | ticks in which the slew limit held force back since the last such line: `ticks` |
| `summary` | figures of the last interval |
| `ended` | `outcome`, and the figures of the session |
"""

from weberlink.system.journal.lines import Journal
from weberlink.system.journal.log_file import LogFile

__all__ = ["Journal", "LogFile"]
