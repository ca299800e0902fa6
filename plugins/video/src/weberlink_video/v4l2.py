"""Cameras of Linux: MJPG pictures of a V4L2 device, undecoded (linux/videodev2.h, for 64-bit systems)."""

import fcntl
import os
from collections.abc import Iterator
from contextlib import ExitStack
from mmap import MAP_SHARED, PROT_READ, mmap
from pathlib import Path
from select import select
from struct import Struct
from typing import Final

CAPTURE, MEMORY_MAPPED = 1, 1  # V4L2_BUF_TYPE_VIDEO_CAPTURE, V4L2_MEMORY_MMAP
MJPG: Final = int.from_bytes(b"MJPG", "little")
CAN_CAPTURE, CAN_STREAM = 0x1, 0x0400_0000
MONOTONIC, ERROR = 0x2000, 0x40  # flags of a buffer: its time is on the monotonic clock; its data are damaged
BUFFERS: Final = 3
PATIENCE_S: Final = 3.0

CAPABILITY = Struct("<16s32s32sIII12x")  # driver, card, bus; version, capabilities, those of this node
FORMAT = Struct("<I4xIIIIII176x")  # type; width, height, pixel format, field, bytes per line, bytes per picture
PARAMETERS = Struct("<IIIII184x")  # type; capability, mode, then seconds per picture as a fraction
REQUEST = Struct("<IIIII")  # number of buffers, type, memory
BUFFER = Struct("<IIIII4xqqIIBBBB4sIIQI4xI4x")
"""Index, type, bytes used, flags, field; time [s, us]; timecode; sequence, memory, offset, length; reserved."""


def _ioctl(direction: int, number: int, size: int) -> int:
    """The number of a request (asm-generic/ioctl.h): 1 for write, 2 for read, 3 for both."""
    return direction << 30 | size << 16 | ord("V") << 8 | number


QUERY_CAPABILITY = _ioctl(2, 0, CAPABILITY.size)
SET_FORMAT = _ioctl(3, 5, FORMAT.size)
REQUEST_BUFFERS = _ioctl(3, 8, REQUEST.size)
QUERY_BUFFER, QUEUE, DEQUEUE = (_ioctl(3, number, BUFFER.size) for number in (9, 15, 17))
STREAM_ON = _ioctl(1, 18, 4)
SET_PARAMETERS = _ioctl(3, 22, PARAMETERS.size)


def _buffer(index: int) -> bytearray:
    made = bytearray(BUFFER.size)
    BUFFER.pack_into(made, 0, index, CAPTURE, 0, 0, 0, 0, 0, 0, 0, 0, 0, 0, 0, b"", 0, MEMORY_MAPPED, 0, 0, 0)
    return made


def captured(path: Path, size: tuple[int, int], rate_hz: float) -> Iterator[tuple[float, bytes]]:
    """Moment on the monotonic clock [s] and JPEG of each picture, until the iterator is closed; raises OSError if the
    device is no camera, or gives no more pictures.
    """
    with ExitStack() as stack:
        fd = os.open(path, os.O_RDWR | os.O_NONBLOCK | os.O_CLOEXEC)
        stack.callback(os.close, fd)
        maps = [stack.enter_context(each) for each in _prepare(fd, path, size, rate_hz)]
        while True:
            if not select([fd], [], [], PATIENCE_S)[0]:
                raise OSError(f"{path} gives no pictures")
            told = _buffer(0)
            fcntl.ioctl(fd, DEQUEUE, told)
            index, _, used, flags, _, seconds, microseconds, *_ = BUFFER.unpack(told)
            if not flags & MONOTONIC:
                raise OSError(f"{path} does not tell when a picture was taken on the monotonic clock")
            picture = maps[index][:used]
            fcntl.ioctl(fd, QUEUE, told)
            if not flags & ERROR:
                yield seconds + 1e-6 * microseconds, picture


def _prepare(fd: int, path: Path, size: tuple[int, int], rate_hz: float) -> list[mmap]:
    """Ask for MJPG of this size and rate, and begin; returns the memory of the buffers."""
    told = bytearray(CAPABILITY.size)
    fcntl.ioctl(fd, QUERY_CAPABILITY, told)
    can = CAPABILITY.unpack(told)[5] or CAPABILITY.unpack(told)[4]
    if not (can & CAN_CAPTURE and can & CAN_STREAM):
        raise OSError(f"{path} is no camera that streams")
    form = bytearray(FORMAT.pack(CAPTURE, *size, MJPG, 0, 0, 0))
    fcntl.ioctl(fd, SET_FORMAT, form)
    _, width, height, pixels, *_ = FORMAT.unpack(form)
    if pixels != MJPG or (width, height) != size:
        kind = pixels.to_bytes(4, "little").decode(errors="replace")
        raise OSError(f"{path} gives {kind} of {width} x {height} and not MJPG of {size[0]} x {size[1]} pixels")
    rate = bytearray(PARAMETERS.pack(CAPTURE, 0, 0, 1000, round(1000 * rate_hz)))
    fcntl.ioctl(fd, SET_PARAMETERS, rate)
    asked = bytearray(REQUEST.pack(BUFFERS, CAPTURE, MEMORY_MAPPED, 0, 0))
    fcntl.ioctl(fd, REQUEST_BUFFERS, asked)
    maps = []
    for index in range(REQUEST.unpack(asked)[0]):
        buffer = _buffer(index)
        fcntl.ioctl(fd, QUERY_BUFFER, buffer)
        *_, offset, length, _ = BUFFER.unpack(buffer)
        maps.append(mmap(fd, length, flags=MAP_SHARED, prot=PROT_READ, offset=offset))
        fcntl.ioctl(fd, QUEUE, buffer)
    fcntl.ioctl(fd, STREAM_ON, CAPTURE.to_bytes(4, "little"))
    return maps
