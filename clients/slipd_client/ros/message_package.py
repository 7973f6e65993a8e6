"""The ROS 2 package ``slipd_msgs``: its files, made from the types.

``python -m slipd_client.ros.message_package FOLDER`` writes it into a folder such as ``~/ros2_ws/src``, for
``colcon build``. The files of this package in the repository are written by the same command.
"""

from __future__ import annotations

import argparse
import sys
from collections.abc import Sequence
from pathlib import Path

from slipd_client.ros.ros_types import STOCK_TYPES
from slipd_client.ros.slipd_types import PACKAGE, SLIPD_TYPES

VERSION = "0.1.0"

_PACKAGE_XML = """\
<?xml version="1.0"?>
<?xml-model href="http://download.ros.org/schema/package_format3.xsd" schematypens="http://www.w3.org/2001/XMLSchema"?>
<package format="3">
  <name>{package}</name>
  <version>{version}</version>
  <description>Messages of slipd, which warns a robot that its gripper is about to drop something.</description>
  <maintainer email="slipd@example.org">slipd</maintainer>
  <license>Apache-2.0</license>

  <buildtool_depend>ament_cmake</buildtool_depend>
  <buildtool_depend>rosidl_default_generators</buildtool_depend>
{depends}
  <exec_depend>rosidl_default_runtime</exec_depend>

  <member_of_group>rosidl_interface_packages</member_of_group>

  <export>
    <build_type>ament_cmake</build_type>
  </export>
</package>
"""

_CMAKE = """\
cmake_minimum_required(VERSION 3.8)
project({package})

find_package(ament_cmake REQUIRED)
find_package(rosidl_default_generators REQUIRED)
{finds}

rosidl_generate_interfaces(${{PROJECT_NAME}}
{messages}
  DEPENDENCIES {packages}
)

ament_export_dependencies(rosidl_default_runtime)
ament_package()
"""


def files() -> dict[str, str]:
    """Return every file of the package: its path within the package, and its text."""
    texts = {f"msg/{name.partition('/')[2]}.msg": kind.commented_text() for name, kind in SLIPD_TYPES.items()}
    used = {field.type for kind in SLIPD_TYPES.values() for field in kind.fields} & set(STOCK_TYPES)
    packages = sorted({name.partition("/")[0] for name in used})
    depends = "\n".join(f"  <depend>{name}</depend>" for name in packages)
    texts["package.xml"] = _PACKAGE_XML.format(package=PACKAGE, version=VERSION, depends=depends)
    texts["CMakeLists.txt"] = _CMAKE.format(
        package=PACKAGE,
        finds="\n".join(f"find_package({name} REQUIRED)" for name in packages),
        messages="\n".join(f'  "{name}"' for name in sorted(texts) if name.startswith("msg/")),
        packages=" ".join(packages),
    )
    return texts


def main(arguments: Sequence[str] | None = None) -> int:
    """Write the package, print its path, and return the exit code.

    Args:
        arguments: Of the command line; None: those of this process.
    """
    parser = argparse.ArgumentParser(
        prog="python -m slipd_client.ros.message_package", description="Write the ROS 2 package slipd_msgs."
    )
    parser.add_argument("folder", type=Path, metavar="FOLDER", help="folder to write it into, e.g. ~/ros2_ws/src")
    folder: Path = parser.parse_args(arguments).folder
    package = folder / PACKAGE
    try:
        for name, text in files().items():
            path = package / name
            path.parent.mkdir(parents=True, exist_ok=True)
            path.write_text(text, encoding="utf-8")
    except OSError as error:
        print(f"{folder}: cannot be written: {error.strerror}", file=sys.stderr)
        return 1
    print(package)
    return 0


if __name__ == "__main__":
    sys.exit(main())
