"""Parameters of the simulated cell's node."""

from __future__ import annotations

from dataclasses import dataclass, field

from emd_core.value_ranges import bounded, check_ranges


@dataclass(frozen=True)
class OverviewConfig:
    """A second camera that films the scene from the side.

    Attributes:
        enabled: Whether it films.
        rate: Pictures a simulated second; 0: none.
    """

    enabled: bool = False
    rate: float = bounded(5.0, 0.0, 240.0)

    def __post_init__(self) -> None:
        """Check the ranges.

        Raises:
            InvalidInputError: If a value is out of its range.
        """
        check_ranges(self)


@dataclass(frozen=True)
class SimulationConfig:
    """How the simulation runs.

    Attributes:
        seed: Of the camera's noise.
        gui: Whether PyBullet opens its window.
        noise: Whether the camera has a Kinect's noise.
        real_time_factor: Simulated seconds a second at most; 0: as fast as possible.
        step: Simulated seconds between two messages of /clock and joint_states.
        camera_rate: Pairs of images a simulated second; 0: none.
        truth_rate: True voxel grids and cloth states a simulated second; 0: none.
        overview: The second camera.
    """

    seed: int = bounded(0, 0, 2**31 - 1)
    gui: bool = False
    noise: bool = True
    real_time_factor: float = bounded(1.0, 0.0, 1000.0)
    step: float = bounded(1.0 / 60.0, 1.0 / 240.0, 0.2)
    camera_rate: float = bounded(12.0, 0.0, 240.0)
    truth_rate: float = bounded(5.0, 0.0, 240.0)
    overview: OverviewConfig = field(default_factory=OverviewConfig)

    def __post_init__(self) -> None:
        """Check the ranges.

        Raises:
            InvalidInputError: If a value is out of its range.
        """
        check_ranges(self)
