"""The perception node as its camera and its operator meet it."""

import time
from collections.abc import Callable, Iterator
from dataclasses import dataclass, field
from functools import partial

import cv2
import pytest
import rclpy
from diagnostic_msgs.msg import DiagnosticArray, DiagnosticStatus
from geometry_msgs.msg import PoseStamped
from own_domain import own_domain
from perception_scenes import Scene
from rclpy.executors import SingleThreadedExecutor
from rclpy.node import Node
from rclpy.parameter import Parameter
from rclpy.qos import QoSProfile
from sensor_msgs.msg import CameraInfo, Image, PointCloud2

from emd_core.metrics import voxel_mse
from emd_core.pinhole_camera import PinholeCamera
from emd_core.ros import conversions
from emd_core.ros.quality_of_service import LATCHED
from emd_core.voxel_grid import VoxelGrid
from emd_msgs_py.msg import VoxelGrid as VoxelGridMsg
from emd_perception.ros.perception_node import PerceptionNode

CAMERA = PinholeCamera(320, 240, 262.5, 262.5, 159.5, 119.5)
RELIABLE = QoSProfile(depth=5)


@dataclass
class Bench:
    """The node, a camera that a test works, and what the node says."""

    node: PerceptionNode
    camera: Node
    executor: SingleThreadedExecutor
    scene: Scene
    grids: list[VoxelGrid] = field(default_factory=list)
    statuses: dict[str, DiagnosticStatus] = field(default_factory=dict)
    stamp: float = 100.0

    def __post_init__(self) -> None:
        """Advertise the camera's topics and listen to the node."""
        make = self.camera.create_publisher
        self.colour = make(Image, "camera/color/image_raw", RELIABLE)
        self.depth = make(Image, "camera/depth_registered/image_raw", RELIABLE)
        self.cloud = make(PointCloud2, "camera/depth_registered/points", RELIABLE)
        self.own_depth = make(Image, "camera/depth/image_raw", RELIABLE)
        self.info = make(CameraInfo, "camera/color/camera_info", RELIABLE)
        self.own_info = make(CameraInfo, "camera/depth/camera_info", RELIABLE)
        self.pose = make(PoseStamped, "camera/pose", LATCHED)
        listen = self.camera.create_subscription
        listen(VoxelGridMsg, "perception/voxel_grid", self._on_grid, RELIABLE)
        listen(DiagnosticArray, "/diagnostics", self._on_diagnostics, RELIABLE)
        pose = conversions.pose_to_message(self.scene.transform_camera_to_table)
        self.pose.publish(PoseStamped(header=self._header(), pose=pose))

    def send(self, colour: Image | None = None) -> None:
        """Send calibration, colour and depth of the next moment."""
        self.stamp += 0.1
        size = (CAMERA.width, CAMERA.height)
        picture = cv2.resize(self.scene.colour, size, interpolation=cv2.INTER_AREA)
        depth = cv2.resize(self.scene.depth_frames[0], size, interpolation=cv2.INTER_NEAREST)
        header = self._header()
        for info in (self.info, self.own_info):
            info.publish(conversions.camera_to_message(CAMERA, header))
        whole = conversions.image_to_message(picture, "rgb8", header)
        if colour is not None:
            colour.header = header
        self.colour.publish(colour or whole)
        for image in (self.depth, self.own_depth):
            image.publish(conversions.image_to_message(depth, "32FC1", header))
        self.cloud.publish(conversions.points_to_message(CAMERA.unproject(depth), header))

    def until(self, happened: Callable[[], object], sending: bool = True) -> None:
        """Let the camera run until something has happened."""
        deadline, next_frame = time.monotonic() + 60.0, 0.0
        while not happened():
            assert time.monotonic() < deadline, self.statuses
            if sending and time.monotonic() > next_frame:
                self.send()
                next_frame = time.monotonic() + 0.2
            self.executor.spin_once(timeout_sec=0.05)

    def level(self, part: str) -> bytes | None:
        """How a part of perception is."""
        status = self.statuses.get(part)
        return None if status is None else status.level

    def values(self, part: str) -> dict[str, str]:
        """Its figures."""
        return {item.key: item.value for item in self.statuses[part].values}

    def _header(self):
        return conversions.header(self.stamp, conversions.CAMERA_FRAME)

    def _on_grid(self, message: VoxelGridMsg) -> None:
        self.grids.append(conversions.voxel_grid_from_message(message))

    def _on_diagnostics(self, message: DiagnosticArray) -> None:
        for status in message.status:
            self.statuses[status.name.removeprefix("perception: ")] = status


@pytest.fixture
def arguments(request) -> list[str]:
    """Parameters of the node; a test may give others."""
    given = getattr(request, "param", {})
    values = {"node.camera_timeout": 1.0, "node.reliable": True, **given}
    return [part for name, value in values.items() for part in ("-p", f"{name}:={value}")]


@pytest.fixture
def bench(flat_scene, arguments) -> Iterator[Bench]:
    """A node in a domain of its own, spun by the test."""
    with own_domain() as number:
        rclpy.init(args=["--ros-args", *arguments], domain_id=number)
        node, camera = PerceptionNode(), rclpy.create_node("camera")
        executor = SingleThreadedExecutor()
        executor.add_node(node)
        executor.add_node(camera)
        try:
            yield Bench(node, camera, executor, flat_scene)
        finally:
            node.destroy_node()
            camera.destroy_node()
            rclpy.try_shutdown()


def test_the_cell_survives_loss_and_return_of_the_camera(bench) -> None:
    """Grids come; silence is an error with its cause; with an earlier clock it goes on."""
    bench.until(lambda: bench.grids and bench.level("camera") == DiagnosticStatus.OK)
    assert voxel_mse(bench.grids[-1], bench.scene.grid) < 0.006
    bench.until(lambda: bench.level("camera") == DiagnosticStatus.ERROR, sending=False)
    assert "no colour" in bench.statuses["camera"].message
    bench.stamp -= 50.0  # the camera was started anew, and its clock with it
    count = len(bench.grids)
    bench.until(lambda: len(bench.grids) > count and bench.level("camera") == DiagnosticStatus.OK)
    assert bench.values("camera")["clock_jumps"] == "1"


def test_latency_rates_and_losses_are_told(bench) -> None:
    """The figures that an operator asks for."""
    bench.until(lambda: len(bench.grids) >= 3 and "camera" in bench.statuses)
    bench.until(lambda: "work_ms" in bench.values("camera"))
    values = bench.values("camera")
    assert float(values["work_ms"]) > 0
    assert float(values["rate_out_hz"]) > 0
    assert float(values["since_arrival_ms_p95"]) >= float(values["work_ms"])
    assert {"frames_dropped", "frames_refused", "unpaired", "rate_in_hz"} <= set(values)
    assert bench.level("table") == DiagnosticStatus.OK
    assert abs(float(bench.values("table")["offset_mm"])) < 5.0


def told(bench: Bench, reason: str) -> bool:
    """Whether the last verdict names a reason."""
    status = bench.statuses.get("cloth")
    return status is not None and reason in status.message


def test_a_frame_that_cannot_be_used_is_answered_and_the_next_one_served(bench) -> None:
    """Cut off, of an unknown encoding, empty: each has its reason, and grids come again."""
    bench.until(lambda: bench.grids)
    cut = Image(width=320, height=240, encoding="rgb8", step=960, data=b"123")
    bad = {"carries 3": cut, "zzz": Image(encoding="zzz"), "out of rgb8": Image()}
    for reason, message in bad.items():
        bench.send(message)
        bench.until(partial(told, bench, reason), sending=False)
        assert bench.level("cloth") == DiagnosticStatus.ERROR
    count = len(bench.grids)
    bench.until(lambda: len(bench.grids) > count)


def test_parameters_change_while_it_runs(bench) -> None:
    """A stricter setting takes hold with the next frame; what is out of range does not."""
    bench.until(lambda: bench.grids)
    done = bench.node.set_parameters([Parameter("segmentation.min_area", value=1.2)])[0]
    assert done.successful
    bench.until(lambda: bench.level("cloth") == DiagnosticStatus.ERROR)
    back = [Parameter("segmentation.min_area", value=0.004)]
    assert bench.node.set_parameters(back)[0].successful
    bench.until(lambda: bench.level("cloth") == DiagnosticStatus.OK)
    for name, value in (
        ("segmentation.min_area", -1.0), ("node.max_rate", 1e9),
        ("segmentation.max_contrast", 1.0), ("node.reliable", False), ("input.depth", "points"),
    ):  # fmt: skip
        refused = bench.node.set_parameters([Parameter(name, value=value)])[0]
        assert not refused.successful and refused.reason, name


def test_numeric_parameters_have_a_description_and_most_a_range(bench) -> None:
    """Every one says what it is for; those of rates, tables and fusion tell their range."""
    groups = ("node.", "input.", "tracker.", "calibration_check.", "segmentation.", "plane.")
    names = [name for name in bench.node.get_parameters_by_prefix("") if name.startswith(groups)]
    described = bench.node.describe_parameters(names)
    assert len(described) > 30
    assert all(one.description for one in described)
    for one in described:
        numeric = one.type in (Parameter.Type.DOUBLE.value, Parameter.Type.INTEGER.value)
        group = one.name.split(".")[0]
        if numeric and group in ("node", "tracker", "calibration_check", "plane"):
            assert one.floating_point_range or one.integer_range, one.name


@pytest.mark.parametrize(
    "arguments", [{"input.depth": "points"}, {"input.depth": "unregistered"}], indirect=True
)
def test_other_depth_gives_the_same_grid(bench) -> None:
    """A cloud, and the depth image of a camera with a calibration of its own."""
    bench.until(lambda: bench.grids)
    assert voxel_mse(bench.grids[-1], bench.scene.grid) < 0.006
