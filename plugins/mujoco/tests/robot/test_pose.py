"""Poses in shared memory: the newest one, whole and once."""

from pathlib import Path

import numpy as np
import pytest

from weberlink_mujoco.robot.pose import PoseReader, PoseWriter


def test_reader_gets_the_newest_pose(tmp_path: Path) -> None:
    path = tmp_path / "weberlink-7.pose"
    writer = PoseWriter(path, 3)
    reader = PoseReader(path)
    assert reader.count == 3 and reader.read() is None
    for number in range(5):
        writer.write(10.0 + number, np.full(3, float(number)))
    pose = reader.read()
    assert pose is not None and pose[0] == 14.0 and pose[1].tolist() == [4.0, 4.0, 4.0]
    assert path.stat().st_mode & 0o777 == 0o600
    writer.close()
    assert not path.exists() and reader.read() is None, "once"
    reader.close()


@pytest.mark.parametrize("content", [b"", b"WEBPOSE\x01", b"nonsense" * 8])
def test_file_without_poses_is_refused(tmp_path: Path, content: bytes) -> None:
    path = tmp_path / "bad.pose"
    path.write_bytes(content)
    with pytest.raises(ValueError, match="holds no poses"):
        PoseReader(path)
