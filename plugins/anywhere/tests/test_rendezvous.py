"""Known peers meet at the real mailbox server, whatever it and others do."""

import asyncio
import json
import re
from collections.abc import Iterator
from dataclasses import replace
from datetime import UTC, datetime, timedelta
from ipaddress import ip_address
from pathlib import Path
from typing import ClassVar

import pytest
from cryptography import x509
from cryptography.hazmat.primitives.asymmetric import ec
from cryptography.hazmat.primitives.hashes import SHA256
from cryptography.hazmat.primitives.serialization import Encoding, NoEncryption, PrivateFormat

from plugins.anywhere.tests.mailbox_server import MailboxServer
from plugins.anywhere.tests.meetings import PATHS, PATIENCE, Host, Pair, ThirdParty, running, waiting
from tests.wait import in_loop
from weberlink.protocol.keys import Right
from weberlink_anywhere.order import FinderOrder, PairingOrder
from weberlink_anywhere.pair import start
from weberlink_anywhere.peers import Peer, PeerStore
from weberlink_anywhere.rendezvous import presence
from weberlink_anywhere.signalling import Answer, Busy, MailboxUnreachable, Offer, PeerAbsent, Presence
from weberlink_anywhere.slave_finder import SlaveFinder

pytestmark = pytest.mark.realtime


@in_loop
async def test_call_is_answered_and_an_absent_peer_said_in_one_line(mailbox: MailboxServer) -> None:
    pair, absent = Pair(mailbox.url), Pair(mailbox.url)
    async with waiting(pair) as host:
        for _ in range(3):
            assert await pair.call() == Answer(PATHS)
        assert await presence(absent.slave, 1.0) == Presence(here=False)
    with pytest.raises(PeerAbsent, match=rf"^robot is not there: .* {mailbox.url}$"):
        await absent.call(timeout=1.0)
    assert [(label, offer.paths) for label, offer in host.offers] == 3 * [("anna", PATHS)]
    assert len({offer.attempt for _, offer in host.offers}) == 3
    assert host.notes == []


@pytest.mark.parametrize(
    ("url", "reason"),
    [
        ("ws://127.0.0.1:1/v1", "Connection refused"),
        ("ws://nowhere.invalid:1/v1", "Name or service not known|[Tt]emporary failure"),
        ("http://127.0.0.1:1", "isn't a valid URI"),
        ("{url}2", "HTTP 404"),
    ],
)
@in_loop
async def test_unreachable_server_is_said_in_one_line(mailbox: MailboxServer, url: str, reason: str) -> None:
    pair = Pair(url.format(url=mailbox.url))
    raised, asked = await asyncio.gather(pair.call(timeout=0.6), presence(pair.slave, 0.6), return_exceptions=True)
    assert isinstance(raised, MailboxUnreachable) and isinstance(asked, Presence)
    assert re.search(reason, str(raised)) and "\n" not in str(raised)
    assert asked.note == str(raised)


@pytest.fixture(scope="module")
def tls(tmp_path_factory: pytest.TempPathFactory) -> Iterator[tuple[MailboxServer, Path]]:
    """A mailbox server with TLS, by the options of its unit, and the file of its certificate, signed by itself."""
    folder, now, key = tmp_path_factory.mktemp("tls"), datetime.now(UTC), ec.generate_private_key(ec.SECP256R1())
    name = x509.Name([x509.NameAttribute(x509.NameOID.COMMON_NAME, "127.0.0.1")])
    begins, ends = now - timedelta(hours=1), now + timedelta(hours=1)
    made = x509.CertificateBuilder(name, name, key.public_key(), x509.random_serial_number(), begins, ends)
    made = made.add_extension(x509.SubjectAlternativeName([x509.IPAddress(ip_address("127.0.0.1"))]), critical=True)
    certificate = made.sign(key, SHA256()).public_bytes(Encoding.PEM)
    for file in ("cert.pem", "chain.pem"):
        (folder / file).write_bytes(certificate)
    private = key.private_bytes(Encoding.PEM, PrivateFormat.PKCS8, NoEncryption())
    (folder / "privkey.pem").write_bytes(private)
    with MailboxServer(tls=folder) as server:
        yield server, folder / "cert.pem"


@pytest.mark.parametrize("is_trusted", [True, False])
@in_loop
async def test_peers_meet_and_pair_by_a_server_with_a_certificate_and_not_by_one_that_nobody_signed(
    tls: tuple[MailboxServer, Path], is_trusted: bool, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    server, authority = tls
    assert server.url.startswith("wss://")
    if is_trusted:
        monkeypatch.setenv("SSL_CERT_FILE", str(authority))
    pair = Pair(server.url)
    async with waiting(pair):
        if is_trusted:
            assert await pair.call() == Answer(PATHS)
        else:
            with pytest.raises(MailboxUnreachable, match=r"certificate of .* is not accepted: self-signed"):
                await pair.call(timeout=1.0)
    inviting = start(PairingOrder("slave", "robot", str(tmp_path), server.url, patience_s=60.0 if is_trusted else 5.0))
    try:
        told: dict[str, str] = {}
        while not {"code", "refused"} & told.keys():
            for line in await asyncio.to_thread(inviting.lines, 0.2):
                told |= json.loads(line)
        assert ("code" in told) is is_trusted, told
        assert is_trusted or "cannot be reached" in told["refused"], told
    finally:
        inviting.end(5.0)


@in_loop
async def test_presence_says_whom_a_slave_serves(mailbox: MailboxServer) -> None:
    pair = Pair(mailbox.url)
    async with waiting(pair) as host:
        assert await presence(pair.slave, PATIENCE) == Presence(here=True)
        host.waiter.serves = "bob"
        assert await presence(pair.slave, PATIENCE) == Presence(here=True, serves="bob")
    assert host.offers == [], "nobody was called"
    assert (await presence(pair.master, PATIENCE)).note.startswith("an operator calls")


@in_loop
async def test_newer_offer_cancels_the_handler_of_the_older(mailbox: MailboxServer) -> None:
    pair, started, ended = Pair(mailbox.url), asyncio.Event(), []
    host = Host([pair])

    async def answer(peer: Peer, offer: Offer) -> Answer | Busy:
        if not started.is_set():
            started.set()
            try:
                await asyncio.Future()
            finally:
                ended.append(offer.attempt)
        return Answer(offer.paths)

    async with running(host.waiter.serve(answer)), running(pair.call()):
        await started.wait()
        assert await pair.call() == Answer(PATHS)
        assert len(ended) == 1


@in_loop
async def test_who_is_known_no_more_is_left_and_who_became_known_is_met(mailbox: MailboxServer) -> None:
    kept, removed, new = Pair(mailbox.url), Pair(mailbox.url), Pair(mailbox.url)
    async with waiting(kept, removed) as host:
        assert await kept.call() == await removed.call() == Answer(PATHS)
        host.waiter.meet([kept.master, new.master])
        assert await kept.call() == await new.call() == Answer(PATHS)
        with pytest.raises(PeerAbsent):
            await removed.call(timeout=1.0)
        host.waiter.meet([])
        host.waiter.meet([replace(kept.master, right=Right.STOP)])
        host.waiter.serves = "anna"
        assert await presence(kept.slave, PATIENCE) == Presence(here=True), "who may stop is not told whom it serves"


@in_loop
async def test_a_slave_follows_the_folder_of_its_peers(tmp_path: Path) -> None:
    """Who is removed loses its paths too; a file that cannot be used is that of nobody."""
    store, forgotten = PeerStore(tmp_path), []

    class Paths:
        sessions: ClassVar[dict[str, str]] = {}

        def news(self, *_news: object) -> None:
            """No mailbox is there."""

        def forget(self, peer: str) -> None:
            forgotten.append(peer)

    anna, bob = (replace(Pair("").master, label=name, name=name) for name in ("anna", "bob"))
    for peer in (anna, bob, replace(Pair("").slave, label="robot")):
        store.add(peer)
    order = FinderOrder("slave", (), str(tmp_path), "robot", "ws://127.0.0.1:1/v1")
    finder = SlaveFinder(order, store, Paths())  # type: ignore[arg-type]
    async with running(finder.run()):
        for change, left, gone in (
            (lambda: None, [anna, bob], []),
            (lambda: store.remove("anna"), [bob], ["anna"]),
            (lambda: store.add(anna), [anna, bob], ["anna"]),
            (lambda: (store.folder / "bob.json").chmod(0o644), [anna], ["anna", "bob"]),
        ):
            change()
            async with asyncio.timeout(PATIENCE):
                while set(finder._waiter._lines) != set(left):
                    await asyncio.sleep(0.01)
            assert forgotten == gone


# --- outages


@in_loop
async def test_both_ends_survive_a_restart_of_the_server(mailbox: MailboxServer) -> None:
    pair = Pair(mailbox.url)
    async with waiting(pair) as host:
        assert await pair.call() == Answer(PATHS)
        await asyncio.to_thread(mailbox.stop)
        async with running(pair.call()) as call:
            await asyncio.sleep(0.1)
            await asyncio.to_thread(mailbox.start)
            assert await call == Answer(PATHS)
    lost, found = host.notes
    assert lost.startswith(f"the mailbox server {mailbox.url} cannot be reached: ")
    assert found == f"the mailbox server {mailbox.url} is reached again"


@in_loop
async def test_waiter_empties_a_mailbox_of_many_messages(mailbox: MailboxServer) -> None:
    pair = Pair(mailbox.url)
    async with waiting(pair, too_many=40) as host, ThirdParty(pair, pair.sealing.other_side) as party:
        assert await presence(pair.slave, PATIENCE) == Presence(here=True)
        for _ in range(40):
            await party.add("call", "00" * 40)  # also of who has no key: nothing comes of it
        assert len(await party.stored()) == 40 + 2
        host.waiter.renew()
        async with ThirdParty(pair, pair.sealing.side) as own:
            while await own.stored():
                await asyncio.sleep(0.05)
        assert await pair.call() == Answer(PATHS)


# --- attacks by who knows the mailbox: the server, or who listens to it


@in_loop
async def test_repeated_messages_are_not_answered_again(mailbox: MailboxServer) -> None:
    pair = Pair(mailbox.url)
    async with waiting(pair) as host:
        assert await pair.call() == Answer(PATHS)
        async with ThirdParty(pair, pair.sealing.other_side) as party:
            overheard = await party.stored()
            assert [each["phase"] for each in overheard] == ["call", "ready", "offer", "answer"]
            for each in 3 * overheard:
                await party.add(each["phase"], each["body"])
            await presence(pair.slave, PATIENCE)  # answered after them
            ours = [each for each in await party.stored() if each["side"] == pair.sealing.side]
        assert [each["phase"] for each in ours] == ["ready"], "to the question above alone"
        assert len(host.offers) == 1
    async with waiting(pair) as other:  # after a start, which forgets what it heard
        await presence(pair.slave, PATIENCE)
        assert other.offers == []


@in_loop
async def test_third_side_that_joins_first_is_told_to_a_person(mailbox: MailboxServer) -> None:
    pair = Pair(mailbox.url)
    async with ThirdParty(pair, "first"), ThirdParty(pair, "second"):
        with pytest.raises(MailboxUnreachable, match="refuses: a third party opened the mailbox of this pair"):
            await pair.call()
        async with waiting(pair) as host:
            while not host.notes:
                await asyncio.sleep(0.02)
            assert host.notes[0].startswith(f"anna: the mailbox server {mailbox.url} refuses: a third party")
    assert host.offers == []


@in_loop
async def test_mailbox_learns_no_address(mailbox: MailboxServer) -> None:
    pair = Pair(mailbox.url)
    async with waiting(pair), ThirdParty(pair, pair.sealing.side) as party:
        await pair.call()
        told = b"".join(bytes.fromhex(each["body"]) for each in await party.stored())
    for secret in (b"192.0.2.1", b"ufrag", b"p" * 22, pair.master.key, b"anna", b"robot"):
        assert secret not in told
