"""The layouts and numbers of V4L2 are those of the kernel's own header, as a C compiler reads it."""

import shutil
import subprocess
from pathlib import Path

import pytest

from weberlink_video import v4l2

HEADER = Path("/usr/include/linux/videodev2.h")
PROGRAM = r"""
#include <linux/videodev2.h>
#include <stdio.h>
#define SHOW(it) for (size_t at = 0; at < sizeof it; at++) printf("%02x", ((unsigned char *)&it)[at]); printf("\n")
static struct v4l2_buffer buffer = {
    .index = 1, .type = V4L2_BUF_TYPE_VIDEO_CAPTURE, .bytesused = 3, .flags = 4, .field = 5, .timestamp = {6, 7},
    .sequence = 8, .memory = V4L2_MEMORY_MMAP, .m.offset = 9, .length = 10};
static struct v4l2_format form = {
    .type = V4L2_BUF_TYPE_VIDEO_CAPTURE, .fmt.pix = {.width = 2, .height = 3, .pixelformat = V4L2_PIX_FMT_MJPEG}};
static struct v4l2_streamparm parm = {
    .type = V4L2_BUF_TYPE_VIDEO_CAPTURE, .parm.capture.timeperframe = {2, 3}};
int main(void) {
    SHOW(buffer); SHOW(form); SHOW(parm);
    printf("%lu %lu %lu %lu %lu %lu %lu %lu\n", VIDIOC_QUERYCAP, VIDIOC_S_FMT, VIDIOC_REQBUFS, VIDIOC_QUERYBUF,
           VIDIOC_QBUF, VIDIOC_DQBUF, (unsigned long)VIDIOC_STREAMON, VIDIOC_S_PARM);
    printf("%lu %lu %d %d %d %d\n", sizeof(struct v4l2_capability), sizeof(struct v4l2_requestbuffers),
           V4L2_CAP_VIDEO_CAPTURE, V4L2_CAP_STREAMING, V4L2_BUF_FLAG_TIMESTAMP_MONOTONIC, V4L2_BUF_FLAG_ERROR);
}
"""


def test_layouts_are_those_of_the_header(tmp_path: Path) -> None:
    compiler = shutil.which("cc")
    if compiler is None or not HEADER.exists():
        pytest.skip("needs a C compiler and the headers of the kernel: apt-get install gcc linux-libc-dev")
    (tmp_path / "say.c").write_text(PROGRAM)
    subprocess.run([compiler, "-w", "say.c", "-o", "say"], cwd=tmp_path, check=True)
    said = subprocess.run([tmp_path / "say"], capture_output=True, text=True, check=True).stdout.splitlines()
    buffer, form, parameters = (bytes.fromhex(line) for line in said[:3])
    assert (
        v4l2.BUFFER.pack(1, v4l2.CAPTURE, 3, 4, 5, 6, 7, 0, 0, 0, 0, 0, 0, b"", 8, v4l2.MEMORY_MAPPED, 9, 10, 0)
        == buffer
    )
    assert v4l2.FORMAT.pack(v4l2.CAPTURE, 2, 3, v4l2.MJPG, 0, 0, 0) == form
    assert v4l2.PARAMETERS.pack(v4l2.CAPTURE, 0, 0, 2, 3) == parameters
    numbers = [v4l2.QUERY_CAPABILITY, v4l2.SET_FORMAT, v4l2.REQUEST_BUFFERS, v4l2.QUERY_BUFFER]
    numbers += [v4l2.QUEUE, v4l2.DEQUEUE, v4l2.STREAM_ON, v4l2.SET_PARAMETERS]
    assert [int(word) for word in said[3].split()] == numbers
    sizes = [v4l2.CAPABILITY.size, v4l2.REQUEST.size]
    flags = [v4l2.CAN_CAPTURE, v4l2.CAN_STREAM, v4l2.MONOTONIC, v4l2.ERROR]
    assert [int(word) for word in said[4].split()] == sizes + flags
