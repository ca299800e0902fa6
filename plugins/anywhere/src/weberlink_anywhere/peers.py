"""The known peers of a user: one file each, with names and key, readable by its owner alone.

A file `NAME.json` holds the fields of `Peer` and the key. NAME is what this user calls the peer, and may change.
"""

import json
import os
from collections.abc import Iterator
from contextlib import contextmanager, suppress
from dataclasses import asdict, dataclass, replace
from hmac import digest
from pathlib import Path
from tempfile import mkstemp
from typing import Literal

from weberlink.bounded_json import parse
from weberlink.protocol.keys import KEY_BYTES, HeldKey, KeyFileError, Right, read_private

_SUFFIX = ".json"
_LONGEST_FILE = 4096
_LATEST_S = 1e11
_LONGEST_NAME = 255
"""Bytes of a file name."""


class PeerError(ValueError):
    """There is no such peer, or its file cannot be used; the message says what to do."""


@dataclass(frozen=True)
class Peer:
    """A known peer: what this user calls it, what it calls itself, and what this host calls itself towards it.

    Args:
        role: of the peer.
        key: of the pair, `KEY_BYTES`.
        mailbox: address of the mailbox server by which the pair was made; "" for none.
        paired_at: seconds since 1970.
        right: what the key is good for; what the robot's host holds counts.
    """

    label: str
    name: str
    own: str
    role: Literal["master", "slave"]
    key: bytes
    mailbox: str = ""
    paired_at: float = 0.0
    right: Right = Right.DRIVE

    @property
    def held_key(self) -> HeldKey:
        return HeldKey(self.key, self.right, self.name)

    def for_stream(self, stream: str) -> "Peer":
        """The same peer as who finds paths for a stream beside the session knows it: by a key made of that of the pair,
        so that the calls for one are not those for the other."""
        return replace(self, key=digest(self.key, f"stream {stream}".encode(), "sha256")) if stream else self


def default_folder() -> Path:
    """`$XDG_DATA_HOME/weberlink/peers`, by default in `~/.local/share`."""
    return Path(os.environ.get("XDG_DATA_HOME") or Path.home() / ".local" / "share") / "weberlink" / "peers"


class PeerStore:
    """The known peers in one folder, of mode 0700; None for `default_folder()`."""

    def __init__(self, folder: Path | None = None) -> None:
        self.folder = default_folder() if folder is None else folder

    def __iter__(self) -> Iterator[Peer]:
        """All peers, by label.

        Raises:
            PeerError: a file cannot be used.
        """
        for label in self.labels():
            yield _read(self._path(label))

    def usable(self) -> Iterator[Peer]:
        """All peers whose file can be used; raises PeerError as `labels`."""
        for label in self.labels():
            with suppress(PeerError):
                yield _read(self._path(label))

    def labels(self) -> list[str]:
        """What the peers are called, also those whose file cannot be used.

        Raises:
            PeerError: the folder cannot be read, or others may write to it.
        """
        try:
            status = self.folder.stat()
            names = os.listdir(self.folder)  # noqa: PTH208 - glob keeps silent about a folder that it may not read
        except FileNotFoundError:
            return []
        except OSError as problem:
            raise PeerError(f"{self.folder} cannot be read: {problem.strerror}") from None
        if status.st_uid not in (0, os.geteuid()):
            raise PeerError(f"{self.folder} belongs to another user")
        if status.st_mode & 0o022:
            raise PeerError(f"{self.folder} is writable for other users; run: chmod 700 {self.folder}")
        return sorted(name.removesuffix(_SUFFIX) for name in names if name.endswith(_SUFFIX) and name[0] != ".")

    def find(self, label: str) -> Peer:
        """The peer of this label.

        Raises:
            PeerError: there is none; the message names those that there are.
        """
        path = self._path(label)
        if (labels := self.labels()).count(label) == 0:
            known = ", ".join(labels) or "none yet; pair with --invite and --join"
            raise PeerError(f"there is no peer {label!r}; known: {known}")
        return _read(path)

    def add(self, peer: Peer) -> None:
        """Keep a new peer.

        Raises:
            PeerError: one of this label is known, or the folder cannot be written.
        """
        path = self._path(peer.label)
        try:
            self.folder.mkdir(parents=True, exist_ok=True, mode=0o700)
            with self._draft(peer) as draft:
                path.hardlink_to(draft)  # fails where there is one, so that no key is overwritten
        except FileExistsError:
            raise PeerError(
                f"{peer.label} is known already; remove it first: weberlink peer {peer.label} --remove"
            ) from None
        except OSError as problem:
            raise PeerError(f"{path} cannot be written: {problem.strerror}") from None

    @contextmanager
    def _draft(self, peer: Peer) -> Iterator[Path]:
        """The file of a peer under a name of its own, which is gone afterwards."""
        descriptor, name = mkstemp(prefix=".", dir=self.folder)  # mode 0600
        try:
            with os.fdopen(descriptor, "w", encoding="ascii") as file:
                file.write(json.dumps({**asdict(peer), "label": None, "key": peer.key.hex()}))
            yield Path(name)
        finally:
            Path(name).unlink(missing_ok=True)

    def allow(self, label: str, right: Right) -> None:
        """Let the key of a peer be good for something else.

        Raises:
            PeerError: there is no such peer, or it is a robot, whose own host keeps that.
        """
        peer = self.find(label)
        if peer.role == "slave":
            raise PeerError(f"{label} is a robot: what this host may do there is for its own host to say")
        path = self._path(label)
        try:
            with self._draft(replace(peer, right=right)) as draft:
                draft.replace(path)
        except OSError as problem:
            raise PeerError(f"{path} cannot be written: {problem.strerror}") from None

    def rename(self, label: str, new: str) -> None:
        """Call a peer by another label.

        Raises:
            PeerError: there is no such peer, or one of the new label.
        """
        self.find(label)
        path = self._path(new)
        try:
            path.hardlink_to(self._path(label))
        except FileExistsError:
            raise PeerError(f"there is a peer {new!r} already") from None
        except OSError as problem:
            raise PeerError(f"{path} cannot be written: {problem.strerror}") from None
        self._path(label).unlink(missing_ok=True)  # somebody else renamed it at the same time

    def remove(self, label: str) -> None:
        """Forget a peer and its key; also one whose file cannot be used.

        Raises:
            PeerError: there is no such peer, or it cannot be removed.
        """
        path = self._path(label)
        if label not in self.labels():
            self.find(label)
        try:
            path.unlink(missing_ok=True)
        except OSError as problem:
            raise PeerError(f"{path} cannot be removed: {problem.strerror}") from None

    def _path(self, label: str) -> Path:
        is_name = label and label[0] != "." and label.isprintable() and "/" not in label
        if not is_name or len(f"{label}{_SUFFIX}".encode()) > _LONGEST_NAME:
            raise PeerError(f"a peer cannot be called {label!r}: printable characters without /, and no . in front")
        return self.folder / f"{label}{_SUFFIX}"


def _read(path: Path) -> Peer:
    try:
        content = read_private(path, "pair again", _LONGEST_FILE)
    except KeyFileError as error:
        raise PeerError(str(error)) from None
    try:
        fields = parse(content, _LONGEST_FILE)
        read = {"key": bytes.fromhex(fields["key"]), "right": Right(fields.get("right", Right.DRIVE))}
        peer = Peer(**{**fields, **read, "label": path.name.removesuffix(_SUFFIX)})
        texts = (peer.name, peer.own, peer.mailbox)
        fits = all(isinstance(each, str) for each in texts) and isinstance(peer.paired_at, int | float)
        fits = fits and 0.0 <= peer.paired_at < _LATEST_S
    except (ValueError, TypeError, KeyError):
        fits = False
    if not fits or len(peer.key) != KEY_BYTES or peer.role not in ("master", "slave"):
        raise PeerError(f"{path} is not the file of a peer; remove it, and pair again")
    return peer
