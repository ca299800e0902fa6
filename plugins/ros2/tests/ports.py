"""Zenoh endpoints on loopback for nodes of one test."""

from socket import socket


def endpoint() -> str:
    """The first node that opens it takes the place of the router."""
    with socket() as free:
        free.bind(("127.0.0.1", 0))
        return f"tcp/127.0.0.1:{free.getsockname()[1]}"
