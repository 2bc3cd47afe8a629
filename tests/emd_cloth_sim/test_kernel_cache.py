"""Claims about where compiled kernels are kept."""

import os
import subprocess
import sys
from pathlib import Path

import numba

import emd_cloth_sim
from emd_cloth_sim.kernel_cache import PREFIX, cache_folder

SOURCES = {
    "inner": "from numba import njit\n@njit(cache=True)\ndef inner(x):\n    return x + {}\n",
    "outer": (
        "from numba import njit\nfrom copied.inner import inner\n"
        "@njit(cache=True)\ndef outer(x):\n    return inner(x)\n"
    ),
}


def test_the_package_uses_the_folder_of_its_sources() -> None:
    """Importing the cloth makes Numba look where kernels of just these sources are."""
    folder = Path(numba.config.CACHE_DIR)
    package = Path(emd_cloth_sim.__file__).parent
    assert folder == cache_folder(package, folder.parent) and folder.name.startswith(PREFIX)


def test_a_change_in_an_inner_kernel_is_seen(tmp_path: Path) -> None:
    """A kernel whose own file is unchanged is compiled anew when one that it calls has changed."""
    package = tmp_path / "copied"
    package.mkdir()
    original = Path(emd_cloth_sim.__file__).parent
    for name in ("__init__.py", "kernel_cache.py"):
        text = (original / name).read_text().replace("emd_cloth_sim.kernel", "copied.kernel")
        (package / name).write_text(text)
    results = []
    for step in (1, 2):
        for name, source in SOURCES.items():
            (package / f"{name}.py").write_text(source.format(step))
        # As a checkout leaves it: an unchanged file keeps its time.
        os.utime(package / "outer.py", (1_000_000_000, 1_000_000_000))
        script = "from copied.outer import outer; print(outer(0))"
        environment = {**os.environ, "PYTHONPATH": str(tmp_path)}
        done = subprocess.run(
            [sys.executable, "-c", script], env=environment, capture_output=True, text=True
        )
        results.append(done.stdout.strip())
    assert results == ["1", "2"], done.stderr
    assert len(list((package / "__pycache__").glob(f"{PREFIX}*"))) == 1
