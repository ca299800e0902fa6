"""The key file: there, closed to others, and a key; nothing of what it holds is shown."""

import shlex
import stat
from collections.abc import Iterator

from weberlink.apps.doctor.finding import Check, Finding, ok, problem
from weberlink.apps.doctor.host import Host
from weberlink.apps.doctor.needs import Needs
from weberlink.protocol import keys
from weberlink.telemetry.runtime_directory import user_name


def key_file(host: Host, needs: Needs) -> Iterator[Finding]:
    """Whether a daemon of this user can use it."""
    path = needs.key_file
    if path is None:
        yield ok("key file", _without(needs))
        return
    quoted = shlex.quote(str(path))
    try:
        status = path.lstat()
        owner = status.st_uid
    except FileNotFoundError:
        yield problem(
            "key file", f"key file {path} is not there", f"weberlink keygen {quoted}    (or copy the other host's)"
        )
        return
    except OSError as error:
        yield problem("key file", f"key file {path} cannot be reached: {error.strerror}", f"ls -ld {quoted}")
        return
    if stat.S_ISLNK(status.st_mode):
        yield problem(
            "key file",
            f"key file {path} is a symbolic link, which daemons do not follow",
            f"in the file, the key file itself: link.key_file: {shlex.quote(str(path.resolve()))}",
        )
        return
    if owner != host.user:
        yield problem(
            "key file",
            f"key file {path} belongs to {user_name(owner)}, this is {user_name(host.user)}",
            f"run as {user_name(owner)}, or: sudo chown {user_name(host.user)} {quoted}",
        )
        return
    try:
        keys.load(path)
    except keys.KeyFileError as error:
        what, _, fix = str(error).partition("; ")
        open_to_others = status.st_mode & 0o077
        yield problem(
            "key file", what, f"chmod 600 {quoted}" if open_to_others else fix or f"weberlink keygen {quoted}.new"
        )
        return
    yield ok("key file", f"key file {path}: mode 0600, a key of {8 * keys.KEY_BYTES} bits")


def _without(needs: Needs) -> str:
    if needs.file is None:
        return "no file, so no key to look at"
    if needs.encrypted:
        return "weberlink loopback makes a key for each session"
    return "the file uses no key: datagrams are not encrypted"


CHECKS: tuple[Check, ...] = (key_file,)
