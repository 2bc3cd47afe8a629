"""Room for whole images on their way between processes of one machine (Fast DDS)."""

from __future__ import annotations

import os
import shutil
from pathlib import Path

PROFILE = Path(__file__).with_name("large_messages.xml")
_FILES = ("FASTRTPS_DEFAULT_PROFILES_FILE", "FASTDDS_DEFAULT_PROFILES_FILE")
_SHARED_MEMORY = Path("/dev/shm")
# What the profile's segments of a handful of processes can fill together, bytes. Containers often
# have less, and a process that writes beyond it is killed.
ROOM = 256 * 2**20
_CHOSEN = (*_FILES, "FASTDDS_BUILTIN_TRANSPORTS")


def use_large_messages() -> None:
    """Let this process and those it starts have transports that hold images.

    It counts for what joins the graph afterwards. Where the user has chosen profiles or transports
    by an environment variable, or shared memory is too small, nothing is changed.
    """
    chosen = any(os.environ.get(name) for name in _CHOSEN)
    if not chosen and shutil.disk_usage(_SHARED_MEMORY).free >= ROOM:
        for name in _FILES:  # older and newer versions read different ones
            os.environ[name] = str(PROFILE)
