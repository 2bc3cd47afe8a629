"""Keeps synthetic scenes, because making them takes far longer than looking at them."""

from __future__ import annotations

import hashlib
import pickle
from dataclasses import astuple
from pathlib import Path

import emd_arm_executor.hiro
import emd_cloth_sim
from emd_cell.scenes.scene import Scene, SceneMaker
from emd_cloth_sim.config import ClothConfig

_MAKERS = ("cloth_states.py", "looks.py", "scene.py")


class SceneStore:
    """Makes scenes by number, or takes those that it made before from a folder.

    A scene is found again only if it was asked for with the same arguments and made by the same
    sources. The files are pickles of about 21 MB: load none that others made.
    """

    def __init__(self, seed: int, cloth: ClothConfig, frames: int, folder: Path | None) -> None:
        """Choose the scenes.

        Args:
            seed: Of everything drawn.
            cloth: The sheet.
            frames: Noisy frames of each scene.
            folder: Where scenes are kept; None keeps none.
        """
        self._arguments = (seed, cloth, frames)
        self._folder = folder
        self._maker: SceneMaker | None = None
        self._key = scenes_key(seed, cloth, frames)

    def scene(self, number: int) -> Scene:
        """Take a scene from the folder, or make and keep it."""
        if self._folder is None:
            return self._make(number)
        file = self._folder / f"{self._key}_{number:04d}.pickle"
        if file.exists():
            scene: Scene = pickle.loads(file.read_bytes())
            return scene
        scene = self._make(number)
        part = file.with_suffix(".part")
        part.write_bytes(pickle.dumps(scene))
        part.replace(file)  # whole or not at all
        return scene

    def _make(self, number: int) -> Scene:
        if self._maker is None:
            self._maker = SceneMaker(*self._arguments)
        return self._maker.make(number)


def scenes_key(seed: int, cloth: ClothConfig, frames: int) -> str:
    """Give a short name for what decides how scenes look: arguments and sources."""
    digest = hashlib.sha256(repr((seed, astuple(cloth), frames)).encode())
    here = Path(__file__).parent
    sources = [here / name for name in _MAKERS]
    for package in (emd_cloth_sim, emd_arm_executor.hiro):
        sources += sorted(Path(package.__path__[0]).rglob("*.py"))
    for source in sources:
        digest.update(source.read_bytes())
    return digest.hexdigest()[:12]
