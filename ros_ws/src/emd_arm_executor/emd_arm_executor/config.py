"""Every number of the executor, once, with its unit and its reason."""

from __future__ import annotations

from dataclasses import dataclass, field

from emd_core.value_ranges import bounded, check_ranges


@dataclass(frozen=True)
class KinematicsConfig:
    """Inverse kinematics.

    Attributes:
        position_tolerance: Accepted distance of the tool's origin, metres.
        rotation_tolerance: Accepted angle of the tool, radians.
        iterations: Most steps of one descent.
        patience: Steps without progress after which a descent ends.
        pool: Random configurations from which a pose's restarts are taken, the nearest first.
        restarts: Most restarts of one pose. 30 leave 6 of 10,000 random poses of HIRO's arms
            unsolved, all nearly singular; one of them needs 319.
        report_restarts: Starts that a refusal tries in order to say how near the arm comes.
        damping: Factor of the squared error that damps a step.
        max_iteration_step: Largest change of a joint in one step, radians.
        max_joint_step: Largest change of a joint between two poses of a path, radians.
        grasp_restarts: Restarts of one posture at a hem, of which there are many to try.
        seed: Seed of the pool.
        limit_clearance: Distance from the nearest joint limit below which a posture is thought
            worse of, radians.
        dexterity_clearance: Manipulability below which a posture is thought worse of, metres^3.
        clearance_weight: What a posture that stands at a limit, or is singular, is worse by, in
            radians of travel from rest.
    """

    position_tolerance: float = 1e-6
    rotation_tolerance: float = 1e-6
    iterations: int = 60
    patience: int = 6
    pool: int = 4000
    restarts: int = 500
    report_restarts: int = 5
    grasp_restarts: int = 4
    damping: float = 1e-2
    max_iteration_step: float = 0.6
    max_joint_step: float = 0.2
    seed: int = 0
    limit_clearance: float = 0.10
    dexterity_clearance: float = 0.006
    clearance_weight: float = 0.5


@dataclass(frozen=True)
class HemConfig:
    """Where the hem is sought.

    Attributes:
        max_distance_inside: Farthest hem from a grasp point inside the cloth, metres.
        max_distance_outside: Farthest hem from a grasp point beside the cloth, metres. A grasp
            far beside the cloth is a miss that the planner has been taught to mean nothing.
        candidates: Hems to try for each grasp point, corners' bisectors included.
        minimum_area: Smallest piece of cloth whose hem counts, square metres.
        tracing_resolution: Cell size to which a coarse mask is refined before tracing, metres.
        corner_tolerance: How far the traced border may leave a straight hem, metres; at least
            nine tenths of a cell are used.
        corner_angle: Least turn that counts as a corner, radians.
        corner_radius: Distance from a corner within which its bisector is used, metres.
        failed_radius: Distance from a failed grasp within which a hem is not tried again, metres;
            less than `corner_inset`, so that beside a corner both its edges remain.
        corner_inset: Distance that a grasp on an edge keeps from the edge's ends, metres.
        hidden_reach: A hem with a place so near in front of it, metres, that something hides from
            the camera may be the edge of what hides the cloth, and is not grasped.
    """

    max_distance_inside: float = 0.12
    max_distance_outside: float = 0.06
    candidates: int = 5
    minimum_area: float = 0.002
    tracing_resolution: float = 0.002
    corner_tolerance: float = 0.006
    corner_angle: float = 0.35
    corner_radius: float = 0.03
    failed_radius: float = 0.012
    corner_inset: float = 0.015
    hidden_reach: float = 0.025


@dataclass(frozen=True)
class GraspConfig:
    """How a hand takes hold of a hem.

    Attributes:
        insertion: How far inside the hem the tool frame's origin grips, metres.
        grip_height: Height of the tool frame's origin above the table while gripping, metres; the
            nails of an opening hand stand out by up to 3 mm (paper, IV-B item 2: fixed).
        open_width: Opening of the jaws on the way to the hem, metres.
        closed_width: Opening that closes the jaws, metres.
        close_time: Time that the jaws get for closing, seconds.
        open_time: Time that the jaws get for opening, seconds.
        pre_grasp_distances: Distances outside the hem at which the hand is lowered, tried in this
            order, metres; where the arm ends at the hem, only a short one is within reach.
        hover_clearance: Height of the nails above the cloth's highest point before the hand is
            lowered, metres.
        yaw_deviations: Turns of the grasp direction away from the hem's normal, tried in this
            order, radians.
        max_asked_turn: Largest angle between a grasp direction that was asked for and the hem's
            normal, radians; less than a right corner's 45 degrees, so that a direction across one
            of its hems does not slide along the other.
        tilts: Leanings of the hand, tried in this order, radians; positive: the fingers point
            into the cloth. 0 is vertical.
        torso_turns: Turns of the torso that are tried, in this order, when nothing can be done
            with the torso at rest, radians.
        max_pairs: Most pairs of grips that are tried for two hands.
        keep_crease: Whether the displacement is corrected where the hand grips elsewhere than the
            plan said, so that the crease stays where the plan put it.
        jaw_depth: How far inside the held point the cloth leaves the jaws, metres; `keep_crease`
            allows for it. In our simulation a half fold without it lands 15 mm too far.
    """

    insertion: float = 0.010
    grip_height: float = 0.004
    open_width: float = 0.045
    closed_width: float = 0.0
    close_time: float = 0.5
    open_time: float = 0.5
    pre_grasp_distances: tuple[float, ...] = (0.03, 0.015, 0.0)
    hover_clearance: float = 0.04
    yaw_deviations: tuple[float, ...] = (0.0, 0.35, -0.35)
    max_asked_turn: float = 0.7
    tilts: tuple[float, ...] = (0.0, -0.15, 0.15)
    torso_turns: tuple[float, ...] = (0.25, -0.25, 0.5, -0.5)
    max_pairs: int = 12
    keep_crease: bool = True
    jaw_depth: float = 0.006


@dataclass(frozen=True)
class PathConfig:
    """The hands' path in space.

    Attributes:
        lift_height: Height at which the cloth is carried, metres above the table (paper, Fig. 5).
            The paper does not say how high; its authors' generator lifts straight paths by 3.6 cm
            and arcs by 6.1 cm, and above 5 cm HIRO's elbows come against its chest near the robot.
        lift_shape: "arc" rises while it advances, so that the lower layer is not dragged;
            "vertical" is the paper's plain path: up, across, down (Fig. 5).
        release_clearance: Height of the hand above the cloth where it lets go, metres.
        release_radius: Radius around the release point in which the cloth's height counts, metres.
        blend: Half the length over which corners of the carrying path are rounded, metres.
        linear_step: Largest distance between via-poses, metres.
        angular_step: Largest turn between via-poses, radians.
        minimum_displacement: Shortest displacement worth carrying out, metres.
        retreat_height: Height above the table to which an empty hand rises, metres.
    """

    lift_height: float = 0.045
    lift_shape: str = "arc"
    release_clearance: float = 0.008
    release_radius: float = 0.02
    blend: float = 0.04
    linear_step: float = 0.003
    angular_step: float = 0.035
    minimum_displacement: float = 0.01
    retreat_height: float = 0.03


@dataclass(frozen=True)
class TimingConfig:
    """How fast everything goes.

    Attributes:
        speed_factor: Share of the joints' published speeds that is used, 0..1.
        max_velocity: Cap on every joint's speed, rad/s. MoveIt's limit for HIRO is 1.
        max_acceleration: Of every joint, rad/s^2. MoveIt's limits: HIRO 1, NEXTAGE 1.5.
        max_jerk: Of every joint, rad/s^3.
        stop_acceleration: Of every joint when a motion is cancelled, rad/s^2.
        stop_jerk: Of every joint when a motion is cancelled, rad/s^3.
        lower_speed: Of a hand on its way down to the table, m/s.
        insert_speed: Of a hand on its way under the hem, m/s.
        carry_speed: Of a hand that carries cloth, m/s.
        retreat_speed: Of a hand that leaves the cloth, m/s.
        sample_period: Time between the points of a sampled trajectory, seconds.
    """

    speed_factor: float = 0.5
    max_velocity: float = 1.0
    max_acceleration: float = 3.0
    max_jerk: float = 40.0
    stop_acceleration: float = 6.0
    stop_jerk: float = 100.0
    lower_speed: float = 0.15
    insert_speed: float = 0.06
    carry_speed: float = 0.20
    retreat_speed: float = 0.15
    sample_period: float = 0.02


@dataclass(frozen=True)
class CollisionConfig:
    """What counts as touching.

    Attributes:
        margin: Distance that links keep from each other and from the table, metres.
        nail_penetration: How deep the model's fingertips may stand in the table, metres: the real
            nails give way.
        slack: How much nearer than its margin a pair may come between two checked configurations
            of a path, metres.
        samples: Random configurations that decide which pairs of one arm can never touch.
        seed: Seed of these configurations.
    """

    margin: float = 0.003
    nail_penetration: float = 0.004
    slack: float = 0.001
    samples: int = 2000
    seed: int = 0


@dataclass(frozen=True)
class ExecutionConfig:
    """How a running motion is watched.

    Attributes:
        monitor_period: Time between two looks at the robot, seconds.
        tracking_tolerance: Largest deviation of a joint from its trajectory, radians.
        end_tolerance: Largest deviation of a joint when a segment counts as done, radians.
        settle_time: Time that the robot gets after a trajectory to come that near, seconds.
        start_delay: How far ahead a trajectory's start lies when it is sent, so that both arms
            begin together, seconds.
        holding_width: Opening of closed jaws above which there is cloth between them, metres.
    """

    monitor_period: float = 0.05
    tracking_tolerance: float = 0.10
    end_tolerance: float = 0.01
    settle_time: float = 0.5
    start_delay: float = 0.0
    holding_width: float = 0.0005


@dataclass(frozen=True)
class SightConfig:
    """How the camera tells whether a manipulation took the cloth along.

    Attributes:
        enabled: Whether perception is asked when the arms are home again.
        frames: Depth frames that it fuses.
        timeout: Longest wait for its answer, seconds.
        radius: Distance from the hem within which the cloth must have changed, metres. A fold
            bares more than that, as a hand grips 10 mm inside the hem. What is moved less across
            the hem is not judged.
        moved_share: Least share of that cloth, before and after together, that must have come or
            gone. A hem that is seen twice differs by less than 0.22 with 2 mm of noise, one pulled
            outwards by 20 mm by more than 0.31, a folded one by more than 0.84.
    """

    enabled: bool = True
    frames: int = bounded(3, 1, 100)
    timeout: float = bounded(10.0, 0.1, 300.0)
    radius: float = bounded(0.02, 0.005, 0.1)
    moved_share: float = bounded(0.3, 0.0, 1.0)

    def __post_init__(self) -> None:
        """Check the ranges.

        Raises:
            InvalidInputError: If a value is out of its range.
        """
        check_ranges(self)


@dataclass(frozen=True)
class ReachConfig:
    """How the reach on the table is sampled.

    Attributes:
        extent: Half the side of the sampled square around the table frame's origin, metres.
        step: Distance between samples, metres.
        lift_step: Distance between the heights that are tried while a hand rises, metres.
        map_step: Distance between the samples of a reach map, metres.
        directions: How many directions of a hand a reach map samples over a whole turn.
    """

    extent: float = 0.30
    step: float = 0.03
    lift_step: float = 0.02
    map_step: float = 0.04
    directions: int = 8


@dataclass(frozen=True)
class MotionConfig:
    """Everything that the planning and the execution of a motion can be told.

    Attributes:
        hem: Where the hem is sought.
        grasp: How a hand takes hold of it.
        path: The hands' path.
        timing: How fast everything goes.
        kinematics: Inverse kinematics.
        collision: What counts as touching.
        execution: How a running motion is watched.
        sight: How the camera tells whether the cloth came along.
        reach: How the reach on the table is sampled.
    """

    hem: HemConfig = field(default_factory=HemConfig)
    grasp: GraspConfig = field(default_factory=GraspConfig)
    path: PathConfig = field(default_factory=PathConfig)
    timing: TimingConfig = field(default_factory=TimingConfig)
    kinematics: KinematicsConfig = field(default_factory=KinematicsConfig)
    collision: CollisionConfig = field(default_factory=CollisionConfig)
    execution: ExecutionConfig = field(default_factory=ExecutionConfig)
    sight: SightConfig = field(default_factory=SightConfig)
    reach: ReachConfig = field(default_factory=ReachConfig)
