"""The pictures of a camera as a video of a LeRobot dataset: the JPEG files themselves, one for a frame (MJPEG in MP4).

Nothing is encoded again, and every frame is a key frame, so that training reads any of them without its neighbours.
"""

from fractions import Fraction
from io import BytesIO
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from weberlink_recording.lerobot_frames import Video

VIDEO = "videos/{video_key}/chunk-{chunk_index:03d}/file-{file_index:03d}.mp4"
SAMPLES = 20  # pictures of which the statistics are taken


def write_video(video: Video, fps: int, folder: Path) -> tuple[dict[str, Any], NDArray[np.uint8]]:
    """Write the video; returns its feature, and some of its pictures, shape (n, height, width, 3).

    Raises:
        ValueError: its pictures differ in size.
        OSError: it cannot be written.
    """
    import av  # noqa: PLC0415 - an optional library

    places = np.unique(np.linspace(0, len(video.jpegs) - 1, SAMPLES).astype(int))
    pixels = [_decoded(av, video.jpegs[place]) for place in places]
    height, width, _ = pixels[0].shape
    if any(each.shape != pixels[0].shape for each in pixels):
        raise ValueError(f"{video.camera}: its pictures differ in size")
    path = folder / VIDEO.format(video_key=video.camera, chunk_index=0, file_index=0)
    path.parent.mkdir(parents=True)
    with av.open(str(path), "w") as container:
        stream = container.add_stream("mjpeg", rate=fps)
        stream.width, stream.height, stream.pix_fmt = width, height, "yuvj420p"
        for place, jpeg in enumerate(video.jpegs):
            packet = av.Packet(jpeg)
            packet.stream, packet.time_base = stream, Fraction(1, fps)
            packet.pts = packet.dts = place
            packet.duration, packet.is_keyframe = 1, True
            container.mux(packet)
    told = {"height": height, "width": width, "codec": "mjpeg", "pix_fmt": "yuvj420p", "fps": fps, "channels": 3}
    info = {f"video.{name}": value for name, value in told.items()} | {"video.is_depth_map": False, "has_audio": False}
    names = ["height", "width", "channels"]
    return {"dtype": "video", "shape": [height, width, 3], "names": names, "info": info}, np.stack(pixels)


def _decoded(av: Any, jpeg: bytes) -> NDArray[np.uint8]:
    """The pixels of a JPEG, shape (height, width, 3)."""
    with av.open(BytesIO(jpeg), format="mjpeg") as container:
        pixels: NDArray[np.uint8] = next(container.decode(video=0)).to_ndarray(format="rgb24")
        return pixels
