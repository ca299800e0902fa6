"""The ROS 2 package that defines the messages of a recording; a test compares the files with this.

python -m weberlink_ros2.ros_package plugins/ros2/weberlink_msgs
"""

import sys
from pathlib import Path

from weberlink.telemetry.message import SCHEMA_NAME, SCHEMA_TEXT

MESSAGES = {SCHEMA_NAME: SCHEMA_TEXT}
"""Name and definition of each message, with those that it consists of."""

PACKAGE_XML = """<?xml version="1.0"?>
<package format="3">
  <name>weberlink_msgs</name>
  <version>0.1.0</version>
  <description>Messages of WeberLink's recordings: the telemetry of one tick of one side.</description>
  <maintainer email="weberlink@users.noreply.github.com">WeberLink</maintainer>
  <license>Apache-2.0</license>
  <buildtool_depend>ament_cmake</buildtool_depend>
  <buildtool_depend>rosidl_default_generators</buildtool_depend>
  <depend>geometry_msgs</depend>
  <exec_depend>rosidl_default_runtime</exec_depend>
  <member_of_group>rosidl_interface_packages</member_of_group>
  <export>
    <build_type>ament_cmake</build_type>
  </export>
</package>
"""

CMAKE = """cmake_minimum_required(VERSION 3.8)
project(weberlink_msgs)

find_package(ament_cmake REQUIRED)
find_package(geometry_msgs REQUIRED)
find_package(rosidl_default_generators REQUIRED)

rosidl_generate_interfaces(${{PROJECT_NAME}}
{messages}
  DEPENDENCIES geometry_msgs
)

ament_export_dependencies(rosidl_default_runtime)
ament_package()
"""


def files() -> dict[str, str]:
    """Contents of the files of the package, by path."""
    messages = {f"msg/{name.rpartition('/')[2]}.msg": text.partition("=" * 80)[0] for name, text in MESSAGES.items()}
    listed = "\n".join(f'  "{path}"' for path in messages)
    return {"package.xml": PACKAGE_XML, "CMakeLists.txt": CMAKE.format(messages=listed), **messages}


def write(folder: Path) -> None:
    for name, text in files().items():
        path = folder / name
        path.parent.mkdir(parents=True, exist_ok=True)
        path.write_text(text, encoding="utf-8")


if __name__ == "__main__":
    write(Path(sys.argv[1]))
