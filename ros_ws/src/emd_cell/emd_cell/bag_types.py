"""The message types that bags of the cell hold."""

from __future__ import annotations

from pathlib import Path

from ament_index_python.packages import get_package_share_directory
from rosbags.typesys import Stores, get_types_from_msg, get_typestore
from rosbags.typesys.store import Typestore


def cell_typestore() -> Typestore:
    """All types of ROS 2 Jazzy's common interfaces and of emd_msgs_py."""
    typestore = get_typestore(Stores.ROS2_JAZZY)
    share = Path(get_package_share_directory("emd_msgs_py"))
    types = {}
    for file in sorted(share.glob("msg/*.msg")):
        types.update(get_types_from_msg(file.read_text(), f"emd_msgs_py/msg/{file.stem}"))
    typestore.register(types)
    return typestore
