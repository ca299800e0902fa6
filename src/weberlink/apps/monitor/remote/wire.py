"""Frames on an asyncio stream: two bytes of length, little endian, and that many bytes. Knows nothing of what is in."""

import asyncio

LENGTH_BYTES = 2


async def read_frame(reader: asyncio.StreamReader, longest: int, patience_s: float) -> bytes:
    """The next frame.

    Raises:
        ConnectionError: the stream ended, or announces more than is allowed.
        TimeoutError: it did not come whole in time.
    """
    async with asyncio.timeout(patience_s):
        try:
            length = int.from_bytes(await reader.readexactly(LENGTH_BYTES), "little")
            if length > longest:
                raise ConnectionError(f"a frame of {length} bytes, more than {longest}")
            return await reader.readexactly(length)
        except asyncio.IncompleteReadError:
            raise ConnectionError("the connection was closed") from None


async def write_frame(writer: asyncio.StreamWriter, frame: bytes, patience_s: float) -> None:
    """Send a frame; waits while the other end takes nothing.

    Raises:
        ConnectionError: the stream is closed.
        TimeoutError: the other end took nothing for so long.
    """
    writer.write(len(frame).to_bytes(LENGTH_BYTES, "little") + frame)
    async with asyncio.timeout(patience_s):
        await writer.drain()


async def close(writer: asyncio.StreamWriter) -> None:
    """Close a stream, in whatever state it is."""
    writer.close()
    try:
        async with asyncio.timeout(1.0):
            await writer.wait_closed()
    except (OSError, TimeoutError):
        writer.transport.abort()
