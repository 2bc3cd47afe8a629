"""Room for whole images on their way between processes of one machine (Fast DDS)."""

from __future__ import annotations

import os
from pathlib import Path

PROFILE = Path(__file__).with_name("large_messages.xml")
_FILES = ("FASTRTPS_DEFAULT_PROFILES_FILE", "FASTDDS_DEFAULT_PROFILES_FILE")
_CHOSEN = (*_FILES, "FASTDDS_BUILTIN_TRANSPORTS")


def use_large_messages() -> None:
    """Let this process and those it starts have transports that hold images.

    It counts for what joins the graph afterwards. Where the user has chosen profiles or transports
    by an environment variable, nothing is changed.
    """
    if not any(os.environ.get(name) for name in _CHOSEN):
        for name in _FILES:  # older and newer versions read different ones
            os.environ[name] = str(PROFILE)
