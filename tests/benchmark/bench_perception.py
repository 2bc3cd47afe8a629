"""Perception on 200 synthetic scenes whose mask, layers and grid are known, beside plain grabCut.

Scenes are drawn by number: a towel of 3 mm, flat, folded or crumpled by the cloth simulation, on
one of four tables, in five looks, under lamps and shadows, every fifth one with a hand of the
robot in view; ten noisy frames of a Kinect from about where it is on HIRO's head. Plain grabCut
is given the rectangle of the field of view and makes five iterations at full resolution, on the
first frame of the first scenes only; ours is timed on the same frame beside it.

Where the folder runs/scenes exists, scenes are kept there (4 GB) and taken from there.
"""

import time
from collections import defaultdict
from collections.abc import Callable, Sequence
from dataclasses import asdict, dataclass
from pathlib import Path
from typing import Any

import cv2
import numpy as np
from numpy.typing import NDArray
from rich.console import Console
from rich.progress import track
from scipy.ndimage import maximum_filter, minimum_filter

from emd_cell.bench import BenchmarkResult
from emd_cell.scenes.scene import Scene, column_centres
from emd_cell.scenes.store import SceneStore
from emd_cloth_sim.config import ClothConfig
from emd_core.errors import CellError
from emd_core.frames import transform_points
from emd_core.metrics import voxel_mse
from emd_perception.config import PerceptionConfig, SegmentationConfig
from emd_perception.layers import count_layers
from emd_perception.perception import Perception
from emd_perception.pipeline import perceive_frames
from emd_perception.region import field_of_view_region
from emd_perception.stream_memory import StreamMemory

SCENES = 200
PLAIN_SCENES = 20
FRAMES = 10
SEED = 0
REPETITIONS = 5  # of a timed frame; the median counts
SCENES_FOLDER = Path(__file__).parents[2] / "runs" / "scenes"
CLOTH = ClothConfig(vertices=(41, 41), thickness=0.003)
# Shapes whose layers are counted, as a towel is folded in the cell.
LAYERED = ("half", "quarter")
_TIMED = ("segmentation", "total")
# A frame of a stream in which something moves; one that looks as before takes far less.
_EACH_ANEW = PerceptionConfig(SegmentationConfig(most_uses=0))


@dataclass(frozen=True)
class Row:
    """What was made of one scene.

    Attributes:
        scene: Its number.
        shape: Of the cloth.
        cloth: Its look.
        table: Its look.
        hand_in_view: Whether a hand hung over the table.
        refusal: Why nothing was found; empty if something was.
        quality: What perception says of itself.
        mask_iou: Intersection over union with the true mask; 0 if refused.
        voxel_mse: Of the grid of all frames; that of an empty grid if refused.
        voxel_mse_seen: The same without the columns of which the camera sees no cloth for what
            stands before it.
        layers_right: Share of the interior columns whose layers are counted right; None for
            shapes whose layers are not counted. A column is interior if it and the eight around
            it have as many layers.
        layers_right_lying: The same where the layers lie on each other; near creases they gape.
        segmentation_ms: Time of the segmentation of one frame alone; None where not timed.
        total_ms: Time of all that is made of one frame.
        stream_segmentation_ms: As segmentation_ms, with the colours of the frame before.
        stream_total_ms: As total_ms, with the colours of the frame before.
        frame_iou: Mask of one frame.
        plain_iou: Of plain grabCut on the same frame.
        plain_ms: Its time.
    """

    scene: str
    shape: str
    cloth: str
    table: str
    hand_in_view: bool
    refusal: str
    quality: float
    mask_iou: float
    voxel_mse: float
    voxel_mse_seen: float
    voxel_mse_known: float | None
    hidden: int
    hidden_as_empty: int
    layers_right: float | None
    layers_right_lying: float | None
    segmentation_ms: float | None
    total_ms: float | None
    stream_segmentation_ms: float | None
    stream_total_ms: float | None
    frame_iou: float | None
    plain_iou: float | None
    plain_ms: float | None


def run() -> BenchmarkResult:
    """Perceive every scene."""
    cv2.setNumThreads(1)
    store = SceneStore(SEED, CLOTH, FRAMES, SCENES_FOLDER if SCENES_FOLDER.is_dir() else None)
    rows = []
    for number in track(range(SCENES), "scenes", console=Console(stderr=True)):
        scene = store.scene(number)
        if number == 0:
            _perceived(scene, FRAMES)  # what is done once only
        rows.append(_row(scene, number < PLAIN_SCENES))
    config = {"scenes": SCENES, "frames": FRAMES, "seed": SEED, "cloth": asdict(CLOTH)}
    return BenchmarkResult(config, [asdict(row) for row in rows], _summary(rows))


def _perceived(scene: Scene, frames: int, last: StreamMemory | None = None) -> Perception | str:
    try:
        return perceive_frames(
            scene.colours[:frames],
            scene.depths[:frames],
            scene.camera,
            scene.transform_camera_to_table,
            _EACH_ANEW,
            last=last,
        )
    except CellError as err:
        return str(err)


def _row(scene: Scene, timed: bool) -> Row:
    found = _perceived(scene, FRAMES)
    timing = _timing(scene) if timed else (None,) * 7
    known = (
        scene.name,
        scene.state.shape,
        scene.look.cloth,
        scene.look.table,
        scene.hand_in_view,
    )
    if isinstance(found, str):
        empty = scene.grid.occupancy
        mse = float(empty.mean()), float(empty[_seen(scene)].mean()), None
        hidden = int((~_seen(scene)).sum())
        return Row(*known, found, 0.0, 0.0, *mse, hidden, hidden, *_layers(scene, None), *timing)
    seen = _seen(scene)
    unknown = found.voxel_grid.unknown
    told = np.zeros_like(seen) if unknown is None else unknown
    wrong = found.voxel_grid.occupancy != scene.grid.occupancy
    return Row(
        *known,
        "",
        found.quality,
        _iou(found.mask, scene.mask),
        voxel_mse(found.voxel_grid, scene.grid),
        float(wrong[seen].mean()),
        float(wrong[~told].mean()),
        int((~seen).sum()),
        int((~seen & ~told & ~found.voxel_grid.silhouette).sum()),
        *_layers(scene, found),
        *timing,
    )


def _seen(scene: Scene) -> NDArray[np.bool_]:
    """Columns, shape (X, Y), all but those of whose cloth the camera sees nothing.

    The surroundings of a column's middle, a little more than the column, are looked up in the
    true mask, so that a column which shows a corner of its cloth counts.
    """
    middles = np.column_stack([column_centres(scene.grid.field_of_view), scene.heights.ravel()])
    to_camera = np.linalg.inv(scene.transform_camera_to_table)
    pixels = np.rint(scene.camera.project(transform_points(to_camera, middles))).astype(int)
    near = cv2.dilate(scene.mask.astype(np.uint8), np.ones((13, 13), np.uint8))
    columns = np.clip(pixels[:, 0], 0, scene.camera.width - 1)
    rows = np.clip(pixels[:, 1], 0, scene.camera.height - 1)
    visible = near[rows, columns].reshape(scene.heights.shape) > 0
    return visible | ~scene.grid.silhouette


def _timing(scene: Scene) -> tuple[float | None, ...]:
    """Time one frame alone and after another, and plain grabCut on it; give their IoU too."""
    plain_iou, plain_ms = _plain(scene)
    alone = [_perceived(scene, 1) for _ in range(REPETITIONS)]
    first = alone[0]
    if isinstance(first, str):
        return None, None, None, None, 0.0, plain_iou, plain_ms
    after = [_perceived(scene, 1, first.memory) for _ in range(REPETITIONS)]
    took = [
        float(np.median([run.milliseconds[name] for run in runs if not isinstance(run, str)]))
        for runs in (alone, after)
        for name in _TIMED
    ]
    return *took, _iou(first.mask, scene.mask), plain_iou, plain_ms


def _iou(mask: NDArray[np.bool_], truth: NDArray[np.bool_]) -> float:
    return float((mask & truth).sum() / max((mask | truth).sum(), 1))


def _layers(scene: Scene, found: Perception | None) -> tuple[float, float] | tuple[None, None]:
    """Compare the layers that heights tell with the true ones, where neighbours have as many.

    Gives the share everywhere, and where they lie on each other.
    """
    if scene.state.shape not in LAYERED:
        return None, None
    if found is None:
        return 0.0, 0.0
    layers, thickness = scene.layers, scene.state.thickness
    inner = (layers > 0) & (minimum_filter(layers, 3) == maximum_filter(layers, 3))
    lying = inner & (scene.heights < (layers + 0.5) * thickness)
    told = count_layers(found.points_in_table, thickness, scene.grid.field_of_view)
    return float((told == layers)[inner].mean()), float((told == layers)[lying].mean())


def _plain(scene: Scene) -> tuple[float, float]:
    """Give IoU and milliseconds of grabCut from a rectangle at full resolution."""
    region = field_of_view_region(
        scene.camera, scene.transform_camera_to_table, scene.grid.field_of_view, 0.0
    )
    rectangle = cv2.boundingRect(region.astype(np.uint8))
    labels = np.zeros(region.shape, np.uint8)
    models = np.zeros((1, 65)), np.zeros((1, 65))
    cv2.setRNGSeed(0)
    picture = cv2.cvtColor(scene.colours[0], cv2.COLOR_RGB2BGR)
    begin = time.perf_counter()
    cv2.grabCut(picture, labels, rectangle, *models, 5, cv2.GC_INIT_WITH_RECT)
    elapsed = time.perf_counter() - begin
    return _iou((labels & 1).astype(bool), scene.mask), 1e3 * elapsed


def _summary(rows: Sequence[Row]) -> dict[str, Any]:
    ious = np.array([row.mask_iou for row in rows])
    layers = [row.layers_right for row in rows if row.layers_right is not None]
    lying = [row.layers_right_lying for row in rows if row.layers_right_lying is not None]
    beside = [row for row in rows if row.plain_ms is not None]
    plain = np.array([(row.plain_ms, row.plain_iou, row.frame_iou) for row in beside], float)
    both = [row for row in beside if row.segmentation_ms is not None]
    ratios, stream_ratios = (
        [(row.plain_ms or 0.0) / (getattr(row, name) or np.inf) for row in both]
        for name in ("segmentation_ms", "stream_segmentation_ms")
    )
    return {
        "mask_iou": float(ious.mean()),
        "mask_iou_worst_decile": float(np.percentile(ious, 10)),
        "voxel_mse": float(np.mean([row.voxel_mse for row in rows])),
        "voxel_mse_seen": float(np.mean([row.voxel_mse_seen for row in rows])),
        "voxel_mse_no_hand": float(
            np.mean([row.voxel_mse for row in rows if not row.hand_in_view])
        ),
        "voxel_mse_known": float(
            np.mean([row.voxel_mse_known for row in rows if row.voxel_mse_known is not None])
        ),
        "hidden_with_hand": sum(row.hidden for row in rows if row.hand_in_view),
        "hidden_as_empty_with_hand": sum(row.hidden_as_empty for row in rows if row.hand_in_view),
        "layers_right": float(np.mean(layers)),
        "layers_right_lying": float(np.mean(lying)),
        "refused": sum(bool(row.refusal) for row in rows),
        "segmentation_ms": float(np.median([row.segmentation_ms or 0.0 for row in both])),
        "total_ms": float(np.median([row.total_ms or 0.0 for row in both])),
        "plain_ms": float(np.median(plain[:, 0])),
        "stream_total_ms": float(np.median([row.stream_total_ms or 0.0 for row in both])),
        "times_faster_than_plain": float(np.median(ratios)),
        "times_faster_than_plain_in_stream": float(np.median(stream_ratios)),
        "frame_iou_beside_plain": float(plain[:, 2].mean()),
        "plain_iou": float(plain[:, 1].mean()),
        "voxel_mse_by_shape": _by(rows, lambda row: row.shape, lambda row: row.voxel_mse_seen),
        "mask_iou_by": {
            "shape": _by(rows, lambda row: row.shape),
            "cloth": _by(rows, lambda row: row.cloth),
            "table": _by(rows, lambda row: row.table),
            "hand in view": _by(rows, lambda row: str(row.hand_in_view)),
        },
    }


def _by(
    rows: Sequence[Row],
    key: Callable[[Row], str],
    value: Callable[[Row], float] = lambda row: row.mask_iou,
) -> dict[str, float]:
    groups: dict[str, list[float]] = defaultdict(list)
    for row in rows:
        groups[key(row)].append(value(row))
    return {name: float(np.mean(values)) for name, values in sorted(groups.items())}
