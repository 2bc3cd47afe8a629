"""Pictures of the simulated camera are drawn beside the simulation and published in order."""

from __future__ import annotations

import threading
import time
from collections.abc import Callable, Iterator

import numpy as np
import pytest
from own_domain import own_context
from rclpy.context import Context
from rclpy.executors import SingleThreadedExecutor
from rclpy.node import Node
from sensor_msgs.msg import Image

from emd_arm_executor.hiro.camera import CameraFrame, CameraView
from emd_arm_executor.ros.camera_publisher import CameraPublisher
from emd_cloth_sim.cloth import Cloth
from emd_cloth_sim.config import ClothConfig
from emd_core.pinhole_camera import PinholeCamera
from emd_core.ros import conversions
from emd_core.simulated_cloth import SimulatedCloth, StillCloth

PINHOLE = PinholeCamera(4, 3, 2.0, 2.0, 1.5, 1.0)


class SlowCamera:
    """Draws a picture when told to; its brightness is the number of the view."""

    def __init__(self) -> None:
        """Nothing is drawn yet."""
        self.may_draw = threading.Event()
        self.error: Exception | None = None
        self.views = self.drawn = 0
        self.transform_camera_to_table = np.eye(4)

    def view(self, cloth: SimulatedCloth) -> CameraView:
        """Keep what is seen."""
        self.views += 1
        links = np.eye(4)[None]
        return CameraView(links[0], links[0], links, StillCloth.of(cloth))

    def take(self, view: CameraView) -> CameraFrame:
        """Wait until it may be drawn."""
        assert self.may_draw.wait(20.0)
        if self.error is not None:
            raise self.error
        self.drawn += 1
        colour = np.full((3, 4, 3), self.drawn, dtype=np.uint8)
        return CameraFrame(colour, np.ones((3, 4), np.float32), PINHOLE, np.eye(4))


class Studio:
    """A camera that publishes, and someone who may look."""

    def __init__(self, context: Context) -> None:
        """Make both nodes."""
        self.context = context
        self.nodes = [Node(name, context=context) for name in ("simulation", "viewer")]
        self.camera = SlowCamera()
        self.publisher = CameraPublisher(self.nodes[0], self.camera)  # type: ignore[arg-type]
        self.cloth = Cloth(ClothConfig(vertices=(5, 5)))
        self.seen: list[tuple[float, int]] = []

    def look(self) -> None:
        """Listen to the colour images, as soon as the publisher knows."""
        topic = "camera/color/image_raw"
        self.nodes[1].create_subscription(Image, topic, self._on_image, 10)
        wait_until(lambda: self.publisher._colour.get_subscription_count() > 0)

    def receive(self, count: int) -> None:
        """Take what comes until so many images have come."""
        spinner = SingleThreadedExecutor(context=self.context)
        spinner.add_node(self.nodes[1])

        def received() -> bool:
            spinner.spin_once(0.05)
            return len(self.seen) >= count

        wait_until(received)
        spinner.shutdown()

    def _on_image(self, message: Image) -> None:
        stamp = conversions.time_from_message(message.header.stamp)
        self.seen.append((stamp, int(message.data[0])))


def wait_until(holds: Callable[[], bool]) -> None:
    """Wait until something holds, at most 20 s."""
    end = time.monotonic() + 20.0
    while not holds():
        assert time.monotonic() < end
        time.sleep(0.01)


@pytest.fixture
def studio() -> Iterator[Studio]:
    """A graph in a domain of its own."""
    with own_context() as context:
        made = Studio(context)
        yield made
        made.camera.may_draw.set()
        made.publisher.close()
        for node in made.nodes:
            node.destroy_node()


def test_the_simulation_does_not_wait_for_the_picture(studio: Studio) -> None:
    """The view is taken at once; the picture, drawn later, bears its time."""
    studio.look()
    studio.publisher.publish(studio.cloth, 1.5)
    assert (studio.camera.views, studio.camera.drawn) == (1, 0)
    studio.camera.may_draw.set()
    studio.receive(1)
    assert studio.seen == [(1.5, 1)]


def test_no_picture_is_left_out(studio: Studio) -> None:
    """A picture that is due waits for the one before it."""
    studio.look()
    studio.publisher.publish(studio.cloth, 1.0)
    waiting = threading.Thread(target=studio.publisher.publish, args=(studio.cloth, 2.0))
    waiting.start()
    waiting.join(0.2)
    assert waiting.is_alive() and studio.camera.views == 1
    studio.camera.may_draw.set()
    waiting.join(20.0)
    assert not waiting.is_alive()
    studio.receive(2)
    assert studio.seen == [(1.0, 1), (2.0, 2)]


def test_nothing_is_drawn_for_nobody(studio: Studio) -> None:
    """A picture costs more than all the rest."""
    studio.publisher.publish(studio.cloth, 1.0)
    assert studio.camera.views == 0


def test_an_error_of_the_camera_is_not_lost(studio: Studio) -> None:
    """It ends the next call, not a thread that nobody looks at."""
    studio.look()
    studio.camera.error = ValueError("no film")
    studio.camera.may_draw.set()
    studio.publisher.publish(studio.cloth, 1.0)
    with pytest.raises(ValueError, match="no film"):
        studio.publisher.publish(studio.cloth, 2.0)
