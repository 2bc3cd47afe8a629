"""Asking perception for the cloth, and what happens when it does not say."""

from __future__ import annotations

import threading
from collections.abc import Callable, Iterator

import numpy as np
import pytest
from own_domain import own_context
from rclpy.callback_groups import ReentrantCallbackGroup
from rclpy.context import Context
from rclpy.executors import SingleThreadedExecutor
from rclpy.node import Node
from std_msgs.msg import Header

from emd_arm_executor.config import SightConfig
from emd_arm_executor.ros.cloth_sight import ClothSight
from emd_arm_executor.silhouette import Silhouette
from emd_core.errors import ErrorCode, NoObservationError
from emd_core.ros import conversions
from emd_core.voxel_grid import voxelise
from emd_msgs_py.srv import CaptureState

HEADER = Header(frame_id=conversions.TABLE_FRAME)
Answer = Callable[[CaptureState.Request, CaptureState.Response], CaptureState.Response]


class Graph:
    """A node that looks, and one that answers if it is told how; both spin in a thread."""

    def __init__(self, context: Context) -> None:
        """Make both nodes and spin them."""
        self.nodes = [Node(name, context=context) for name in ("looking", "perception")]
        self.requests: list[CaptureState.Request] = []
        self._spinner = SingleThreadedExecutor(context=context)
        for node in self.nodes:
            self._spinner.add_node(node)
        self._thread = threading.Thread(target=self._spinner.spin, daemon=True)
        self._thread.start()

    def serve(self, answer: Answer) -> None:
        """Offer the capture, answered like this."""

        def on_request(
            request: CaptureState.Request, response: CaptureState.Response
        ) -> CaptureState.Response:
            self.requests.append(request)
            return answer(request, response)

        self.nodes[1].create_service(CaptureState, "perception/capture_state", on_request)

    def sight(self, config: SightConfig, serves: bool = True) -> ClothSight:
        """Look with this configuration, as soon as the capture is there."""
        sight = ClothSight(self.nodes[0], config, ReentrantCallbackGroup())
        if serves:
            assert sight._capture.wait_for_service(20.0)
        return sight

    def close(self) -> None:
        """Stop spinning."""
        self._spinner.shutdown()
        self._thread.join(10.0)
        for node in self.nodes:
            node.destroy_node()


@pytest.fixture
def graph() -> Iterator[Graph]:
    """A graph in a domain of its own."""
    with own_context() as context:
        made = Graph(context)
        yield made
        made.close()


def square(_: CaptureState.Request, response: CaptureState.Response) -> CaptureState.Response:
    """A cloth of 0.2 m, points 4 mm apart."""
    axis = np.arange(-0.1, 0.1001, 0.004)
    x, y = np.meshgrid(axis, axis)
    points = np.stack([x.ravel(), y.ravel(), np.full(x.size, 0.003)], axis=1)
    response.points = conversions.points_to_message(points, HEADER)
    response.voxel_grid = conversions.voxel_grid_to_message(voxelise(points), HEADER)
    return response


def test_the_cloth_is_seen_as_perception_gives_it(graph: Graph) -> None:
    """One capture of as many frames as configured gives the silhouette."""
    graph.serve(square)
    seen = graph.sight(SightConfig(frames=2)).look()
    assert isinstance(seen, Silhouette)
    places = np.array([[0.0, 0.0], [0.095, -0.095], [0.12, 0.0]])
    assert seen.covers(places).tolist() == [True, True, False]
    assert [request.frames for request in graph.requests] == [2]


def refuse(_: CaptureState.Request, response: CaptureState.Response) -> CaptureState.Response:
    """What perception says of a picture without cloth."""
    response.error_code, response.error_msg = int(ErrorCode.NO_CLOTH), "bare table"
    return response


def test_what_perception_cannot_see_is_not_judged(graph: Graph) -> None:
    """An error of perception's is a warning, and nothing has been seen."""
    graph.serve(refuse)
    assert graph.sight(SightConfig()).look() is None
    assert len(graph.requests) == 1


def test_without_perception_nothing_is_seen(graph: Graph) -> None:
    """Where nobody offers a capture it is not waited for."""
    assert graph.sight(SightConfig(timeout=300.0), serves=False).look() is None


def test_looking_can_be_switched_off(graph: Graph) -> None:
    """Then perception is not asked."""
    graph.serve(square)
    assert graph.sight(SightConfig(enabled=False)).look() is None
    assert graph.requests == []


def test_before_the_first_observation_there_is_no_cloth(graph: Graph) -> None:
    """The remedy is to capture it."""
    with pytest.raises(NoObservationError, match="capture the cloth first"):
        graph.sight(SightConfig(), serves=False).latest()
