"""The key file: there, closed to others, and a key; nothing of what it holds is shown."""

import pwd
import shlex
from collections.abc import Iterator

from protocol import keys
from weberlink.doctor.finding import Check, Finding, ok, problem
from weberlink.doctor.host import Host
from weberlink.doctor.needs import Needs


def key_file(host: Host, needs: Needs) -> Iterator[Finding]:
    """Whether a daemon of this user can use it."""
    path = needs.key_file
    if path is None:
        text = "the file uses no key: datagrams are not encrypted" if needs.file else "no file, so no key to look at"
        yield ok("key file", text)
        return
    quoted = shlex.quote(str(path))
    try:
        status = path.stat()
        owner = status.st_uid
    except FileNotFoundError:
        yield problem(
            "key file", f"key file {path} is not there", f"weberlink keygen {quoted}    (or copy the other host's)"
        )
        return
    except OSError as error:
        yield problem("key file", f"key file {path} cannot be reached: {error.strerror}", f"ls -ld {quoted}")
        return
    if owner != host.user:
        yield problem(
            "key file",
            f"key file {path} belongs to {_name(owner)}, this is {_name(host.user)}",
            f"run as {_name(owner)}, or: sudo chown {_name(host.user)} {quoted}",
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


def _name(user: int) -> str:
    try:
        return pwd.getpwuid(user).pw_name
    except KeyError:
        return f"user {user}"


CHECKS: tuple[Check, ...] = (key_file,)
