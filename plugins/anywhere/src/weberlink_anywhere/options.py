"""The options of the path finder: the section `link.finder` of a file."""

import re
from pathlib import Path
from typing import Annotated, Literal

from pydantic import AfterValidator, Field, model_validator

from weberlink.config.model import Address, Name
from weberlink.config.settings import Settings


def _mailbox_url(text: str) -> str:
    if re.fullmatch(r"wss?://[^/\s]+/\S*", text) is None:
        raise ValueError(f"must be the address of a mailbox server, as wss://relay.example:4000/v1, not {text!r}")
    return text


MailboxUrl = Annotated[str, AfterValidator(_mailbox_url)]


class TurnSettings(Settings):
    """A relay of one's own, for hosts that cannot reach each other directly (TURN, RFC 8656)."""

    server: Address = Field(description="where it listens, by UDP")
    name: str = Field(default="", description="what the page and the report call it; by default its host")
    secret_file: Path | None = Field(
        default=None,
        description="the secret that it shares with its users, from which credentials of limited time are made",
    )
    credentials_file: Path | None = Field(
        default=None, description="one line with user name and password, in place of the secret"
    )

    @model_validator(mode="after")
    def _secured(self) -> "TurnSettings":
        if (self.secret_file is None) == (self.credentials_file is None):
            raise ValueError("needs secret_file or credentials_file, one of them")
        return self


class AnywhereOptions(Settings):
    """Options of `anywhere`."""

    peer: Name | None = Field(
        default=None,
        description="the known peer (weberlink peer) to call, or to wait for; without it, a master calls the only "
        "robot that it knows, and a slave waits for every operator that it knows",
    )
    peer_store: Path | None = Field(
        default=None, description="folder of the known peers; by default ~/.local/share/weberlink/peers"
    )
    path: Literal["ice", "direct"] = Field(
        default="ice",
        description="`ice`: a path between the two hosts is found through any NAT; `direct`: only the key is that of "
        "the peer, and the master sends to link.slave",
    )
    mailbox: MailboxUrl | None = Field(
        default=None,
        description="where two hosts leave messages for each other before there is a path: the address of a "
        "magic-wormhole mailbox server, such as wss://relay.example:4000/v1; ws:// is not encrypted",
    )
    stun: Address | None = Field(default=None, description="server that tells a host its address outside (STUN)")
    turn: TurnSettings | None = Field(default=None, description="relay for hosts that cannot reach each other")
    paths: int = Field(
        default=1,
        ge=1,
        le=2,
        description="with `ice`: how many paths carry every datagram, over different network interfaces; the first "
        "copy counts",
    )
    interfaces: tuple[str, ...] = Field(
        default=(), description="with `ice`: the network interfaces to use, in order; by default all"
    )

    @model_validator(mode="after")
    def _reachable(self) -> "AnywhereOptions":
        if self.path == "ice":
            if self.mailbox is None:
                raise ValueError("path ice needs mailbox, where the two hosts leave their addresses for each other")
        elif self.paths > 1 or self.interfaces:
            raise ValueError("paths and interfaces need path: ice")
        return self
