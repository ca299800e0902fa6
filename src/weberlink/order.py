"""Words and numbers that commands and daemons share: exit statuses, sides, signals that stop a run."""

from signal import SIGHUP, SIGINT, SIGTERM

COMPLETED, FAILED, MISCONFIGURED = 0, 1, 2
INTERRUPTED = 130
"""Exit statuses of every command; the last one where Ctrl-C ends work that has an end of its own."""

EMERGENCY = "emergency stop"  # outcome of a run that somebody ended in this way

NOTE = "note: "  # how a line of advice on standard error begins

MASTER, SLAVE = "master", "slave"
SIDES = (MASTER, SLAVE)
STOP_SIGNALS = (SIGINT, SIGTERM, SIGHUP)
