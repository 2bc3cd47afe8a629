"""Write JSON files whole or not at all."""

from __future__ import annotations

import json
import math
from pathlib import Path
from typing import Any

from emd_core.whole_file import write_text


def write_json(path: Path, content: Any) -> None:
    """Write `content`, numbers that are not finite as null; makes the folder.

    Raises:
        InvalidInputError: If nothing can be written there.
    """
    write_text(path, json.dumps(_finite(content), indent=1, allow_nan=False) + "\n")


def _finite(content: Any) -> Any:
    if isinstance(content, dict):
        return {key: _finite(value) for key, value in content.items()}
    if isinstance(content, list | tuple):
        return [_finite(value) for value in content]
    if isinstance(content, float) and not math.isfinite(content):
        return None
    return content
