"""Where Numba keeps the compiled kernels: in a folder of its own for each version of the sources.

Numba compiles a kernel anew when its own file has changed, but not when that of a kernel it calls
has. Without this, a changed kernel would go on being run as it was.
"""

from __future__ import annotations

import hashlib
import os
import shutil
from pathlib import Path
from typing import Any

import numba

PREFIX = "emd_cloth_sim-"


def cache_folder(package: Path, base: Path) -> Path:
    """Name the folder for the present sources of a package, within `base`."""
    digest = hashlib.sha256()
    for path in sorted(package.glob("*.py")):
        digest.update(path.name.encode() + b"\0" + path.read_bytes() + b"\0")
    return base / f"{PREFIX}{digest.hexdigest()[:16]}"


def use_own_folder() -> None:
    """Let Numba keep kernels that are imported from now on in the folder of these sources.

    That is in the package's `__pycache__`, from which those of other versions are removed, or in
    `NUMBA_CACHE_DIR` if it is set, which other checkouts may share. Where nothing can be written,
    Numba's own choice stays.
    """
    package = Path(__file__).parent
    config: Any = numba.config
    base = Path(config.CACHE_DIR or package / "__pycache__")
    folder = cache_folder(package, base)
    try:
        if not folder.exists():
            old = [] if config.CACHE_DIR else list(base.glob(f"{PREFIX}*"))
            folder.mkdir(parents=True, exist_ok=True)
            for other in old:
                shutil.rmtree(other, ignore_errors=True)
    except OSError:
        return
    if os.access(folder, os.W_OK):
        config.CACHE_DIR = str(folder)
