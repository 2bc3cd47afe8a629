"""2,000 spoilt messages and files: each is answered by a result, an error or a counted skip."""

from __future__ import annotations

import signal
from collections import Counter
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from copy import deepcopy
from pathlib import Path
from typing import Any

import cv2
import numpy as np
import pytest
from bag_files import TOPICS, Recorded, as_ros1, header_at, recorded, write_bag

from emd_cell.bag_frames import bag_frames
from emd_core.errors import CellError
from emd_core.frames import transform_from_pose
from emd_core.lens_distortion import LensDistortion
from emd_core.pinhole_camera import PinholeCamera
from emd_core.ros import conversions
from emd_core.ros.point_clouds import points_to_message
from emd_perception.calibration.calibration import Calibration
from emd_perception.files import read_colour, read_depth
from emd_perception.frame_input import Frame, InputConfig
from emd_perception.pipeline import perceive
from emd_perception.ros.frame_decoder import FrameDecoder

SEED = 20261122
CAMERA = PinholeCamera(64, 48, 52.5, 52.5, 31.5, 23.5)
LENS = LensDistortion("plumb_bob", (0.1, -0.2, 0.0, 0.0, 0.05))
SECONDS = 60  # that one case may take at most, however busy the machine is
HUGE = (0, 1, 47, 65, 1 << 16, (1 << 31) - 1, (1 << 32) - 1)
NUMBERS = (0.0, -1.0, 1e-300, 1e300, np.nan, np.inf, -np.inf, 31.0)
TEXTS = ("", "rgb8", "bgra8", "mono8", "16UC1", "32FC1", "bayer_rggb8", "\N{SNOWMAN}", "x" * 9999)
KINDS = ("registered", "unregistered", "points")

Messages = dict[str, Any]


@contextmanager
def in_time() -> Iterator[None]:
    """A case that hangs fails."""

    def stop(*_: object) -> None:
        raise AssertionError(f"no answer within {SECONDS} s")

    before = signal.signal(signal.SIGALRM, stop)
    signal.alarm(SECONDS)
    try:
        yield
    finally:
        signal.alarm(0)
        signal.signal(signal.SIGALRM, before)


def good_messages() -> Messages:
    """A small camera that looks down at a blue square on a table."""
    colour = np.full((48, 64, 3), (190, 150, 110), np.uint8)
    colour[14:34, 20:44] = (40, 70, 160)
    depth = np.full((48, 64), 0.8, np.float32)
    depth[14:34, 20:44] = 0.797
    header = header_at(1_000_000_000)
    info = conversions.camera_to_message(CAMERA, header, LENS)
    return {
        "color": conversions.image_to_message(colour, "rgb8", header),
        "depth": conversions.image_to_message(depth, "32FC1", header),
        "points": points_to_message(CAMERA.unproject(depth), header),
        "info": info,
        "depth_info": deepcopy(info),
    }


def spoil_bytes(data: bytes, rng: np.random.Generator) -> bytes:
    """Cut off, flip, zero, fill, repeat or lengthen."""
    values = bytearray(data)
    start = int(rng.integers(0, max(len(values), 1)))
    end = min(len(values), start + int(rng.integers(1, 64)))
    choice = rng.integers(0, 7)
    if choice == 0:
        return bytes(values[:start])
    if choice == 1:
        return b""
    if choice == 2:
        return bytes(values) + rng.bytes(100)
    if choice == 3:
        values[start:end] = b"\xff" * (end - start)
    elif choice == 4:
        values[start:end] = b"\0" * (end - start)
    elif choice == 5:
        values[start:end] = rng.bytes(end - start)
    else:
        values[start:start] = values[start:end]
    return bytes(values)


def spoil_message(message: Any, rng: np.random.Generator) -> None:
    """Change one field to what no good camera sends."""
    fields = list(message.get_fields_and_field_types().items())
    name, kind = fields[rng.integers(1, len(fields))]  # the header stays
    if name == "fields":
        spoil_layout(message, rng)
    elif name == "data":
        message.data = spoil_bytes(bytes(message.data), rng)
    elif kind.startswith("uint8"):
        message.is_bigendian = 1
    elif "int32" in kind:
        setattr(message, name, int(rng.choice(HUGE)))
    elif kind == "string":
        setattr(message, name, str(rng.choice(TEXTS)))
    elif kind.startswith(("double", "sequence<double")):
        spoil_numbers(message, name, kind, rng)


def spoil_numbers(message: Any, name: str, kind: str, rng: np.random.Generator) -> None:
    """Change some numbers of a matrix, or how many a list has."""
    values = np.array(getattr(message, name), dtype=np.float64)
    if kind.startswith("sequence"):
        values = np.zeros(int(rng.choice([0, 1, 4, 5, 8, 99])))
    chosen = rng.random(len(values)) < 0.4
    values[chosen] = rng.choice(NUMBERS, chosen.sum())
    setattr(message, name, values.tolist() if kind.startswith("sequence") else values)


def spoil_layout(cloud: Any, rng: np.random.Generator) -> None:
    """Change the layout of a cloud's points."""
    if rng.random() < 0.3:
        cloud.fields = cloud.fields[: rng.integers(0, 3)]
        return
    one = cloud.fields[rng.integers(0, len(cloud.fields))]
    one.name = str(rng.choice(["x", "y", "z", "", "rgb"]))
    one.offset = int(rng.choice(HUGE))
    one.datatype = int(rng.choice([0, 5, 7, 8, 200]))


def answered(case: Callable[[], str], label: str, counts: Counter[str]) -> None:
    """Run a case; all that may come out is a result or an error of the cell's own."""
    with in_time():
        try:
            counts[case()] += 1
        except CellError as err:
            assert str(err), label
            counts["refused"] += 1
        except Exception as err:
            raise AssertionError(f"{label}: {type(err).__name__}: {err}") from err


def test_spoilt_messages_are_answered() -> None:
    """1,200 messages with one to three wrong fields, in all three ways in which depth comes."""
    rng = np.random.default_rng(SEED)
    good, counts = good_messages(), Counter[str]()
    pose = transform_from_pose([0.0, 0.0, 0.8], [0.7071, 0.7071, 0.0, 0.0])
    for number in range(1200):
        messages = deepcopy(good)
        source = KINDS[number % 3]
        depth = "points" if source == "points" else "depth"
        for _ in range(rng.integers(1, 4)):
            spoil_message(messages[str(rng.choice(["color", depth, "info", "depth_info"]))], rng)

        def case(messages: Messages = messages, source: str = source, number: int = number) -> str:
            decoder = FrameDecoder(InputConfig(source))
            frame = decoder.decode(
                messages["color"],
                messages["points" if source == "points" else "depth"],
                messages["info"],
                messages["depth_info"],
            )
            if number % 4 == 0:
                perceive(frame.colour, frame.depth, frame.camera, pose)
                return "perceived"
            return "decoded"

        answered(case, f"message {number}", counts)
    assert sum(counts.values()) == 1200
    assert min(counts["refused"], counts["decoded"]) > 200, counts


def test_spoilt_bytes_in_a_bag_are_counted(tmp_path) -> None:
    """300 serialised messages with wrong bytes: as many answers as pairs and broken messages."""
    rng = np.random.default_rng(SEED + 1)
    good = good_messages()
    bag: list[Recorded] = [recorded("info", 0, good["info"])]
    for number in range(300):
        stamp = 1_000_000_000 * (number + 2)
        for kind in ("color", "depth"):
            good[kind].header = header_at(stamp)
        pair = [recorded(kind, stamp, good[kind]) for kind in ("color", "depth")]
        spoilt = int(rng.integers(0, 2))
        # The first bytes name the encoding; most of a message is pixels that may be anything.
        whole, head = pair[spoilt].data, 64
        data = spoil_bytes(whole[:head], rng) + (whole[head:] if rng.random() < 0.7 else b"")
        pair[spoilt] = Recorded(pair[spoilt].kind, stamp, data or b"\0")
        bag += pair
    counts = Counter[str]()

    def case() -> str:
        found = list(bag_frames(write_bag(tmp_path / "bag", bag), TOPICS, InputConfig()))
        for item in found:
            counts["frame" if isinstance(item, Frame) else "reason"] += 1
        return "read"

    answered(case, "bag", Counter())
    assert counts["reason"] > 100
    assert counts.total() >= 200  # the rest have lost their stamp, and with it their partner


@pytest.mark.parametrize(("storage", "files"), [("mcap", 120), ("sqlite", 80), ("ros1", 80)])
def test_spoilt_bags_are_answered(tmp_path, storage, files) -> None:
    """280 bags with wrong bytes, of messages, index or metadata: read in part, or refused."""
    rng = np.random.default_rng([SEED + 2, files])
    good, counts = good_messages(), Counter[str]()
    messages = [recorded("info", 0, good["info"])]
    messages += [recorded(kind, 1_000_000_000, good[kind]) for kind in ("color", "depth")]
    bag = write_bag(tmp_path / "good", messages, sqlite=storage == "sqlite")
    if storage == "ros1":
        bag = as_ros1(bag, tmp_path / "good.bag")
    for number in range(files):
        spoilt = spoilt_copy(bag, tmp_path / f"spoilt_{number}{bag.suffix}", rng)

        def case(spoilt: Path = spoilt) -> str:
            found = list(bag_frames(spoilt, TOPICS, InputConfig()))
            return "read" if all(isinstance(item, Frame) for item in found) else "read in part"

        answered(case, f"{storage} bag {number}", counts)
    assert counts.total() == files
    assert counts["refused"] > 10, counts


def spoilt_copy(bag: Path, target: Path, rng: np.random.Generator) -> Path:
    """Copy a bag and spoil one to three places of one of its files."""
    if bag.is_file():
        target.write_bytes(spoil_bytes(bag.read_bytes(), rng))
        return target
    target.mkdir()
    files = sorted(bag.iterdir())
    chosen = files[rng.integers(0, len(files))]
    for file in files:
        data = file.read_bytes()
        for _ in range(rng.integers(1, 4) if file == chosen else 0):
            data = spoil_bytes(data, rng)
        (target / file.name).write_bytes(data)
    return target


def test_spoilt_files_are_answered(tmp_path) -> None:
    """220 pictures, arrays and calibrations with wrong bytes."""
    rng = np.random.default_rng(SEED + 3)
    counts = Counter[str]()
    colour, depth, array, yaml = good_files(tmp_path)
    readers: list[tuple[Path, Callable[[Path], Any]]] = [
        (colour, read_colour),
        (depth, lambda path: read_depth(path, "mm")),
        (array, lambda path: read_depth(path, "m")),
        (yaml, Calibration.load),
    ]
    for number in range(220):
        good, read = readers[number % 4]
        file = tmp_path / f"spoilt_{number}{good.suffix}"
        file.write_bytes(spoil_bytes(good.read_bytes(), rng))

        def case(file: Path = file, read: Callable[[Path], Any] = read) -> str:
            read(file)
            return "read"

        answered(case, f"{good.name} {number}", counts)
    assert counts.total() == 220
    assert min(counts["read"], counts["refused"]) > 30, counts


def good_files(folder: Path) -> tuple[Path, Path, Path, Path]:
    """A colour picture, a depth picture, a depth array, a calibration."""
    pixels = np.random.default_rng(0).integers(0, 255, (48, 64, 3), dtype=np.uint8)
    cv2.imwrite(str(folder / "colour.png"), pixels)
    cv2.imwrite(str(folder / "depth.png"), np.full((48, 64), 800, np.uint16))
    np.save(folder / "depth.npy", np.full((48, 64), 0.8, np.float32))
    plane = np.array([0.0, 0.0, -1.0, 0.8])
    transform = transform_from_pose([0.0, 0.0, 0.8], [1.0, 0.0, 0.0, 0.0])
    stored = Calibration(CAMERA, transform, plane, 0.1, 12, 1, 0.0, 0.0, "today")
    stored.save(folder / "camera.yaml")
    return tuple(folder / name for name in ("colour.png", "depth.png", "depth.npy", "camera.yaml"))  # type: ignore[return-value]
