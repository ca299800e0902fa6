"""Tests of finding the other host: pairing, mailbox, paths through NATs, the relay."""

from pathlib import Path

FILE = Path(__file__).parents[1] / "configs" / "anywhere.yaml"  # the shipped one
