"""Joints of HIRO: origins, axes, limits and speeds.

From the HIRO model in rtmros_hironx (start-jsk) and the OpenHRP model in hironx-interface, which
agree. LARM_JOINT3 is mirrored as in the OpenHRP and NEXTAGE models: the COLLADA model gives the
left arm the right arm's limits.
"""

from __future__ import annotations

from dataclasses import replace

from emd_arm_executor.hiro.figures.records import JointFigures, Vector

# No joint torque of HIRO is published: 100 Nm is what its MoveIt model writes. The fingers carry
# grams, and no speed or torque of theirs is published either; both are choices of this model.
ARM_EFFORT = 100.0
HAND_EFFORT = 10.0
HAND_SPEED = 120.0

TORSO_AND_HEAD: tuple[JointFigures, ...] = (
    JointFigures("CHEST_JOINT0", "WAIST", (0, 0, 0), (0, 0, 1), -163, 163, 130, ARM_EFFORT),
    JointFigures(
        "HEAD_JOINT0", "CHEST_JOINT0_Link", (0, 0, 0.5695), (0, 0, 1), -70, 70, 150, ARM_EFFORT
    ),
    JointFigures(
        "HEAD_JOINT1", "HEAD_JOINT0_Link", (0, 0, 0), (0, 1, 0), -20, 70, 250, ARM_EFFORT
    ),
)

LEFT_ARM: tuple[JointFigures, ...] = (
    JointFigures(
        "LARM_JOINT0",
        "CHEST_JOINT0_Link",
        (0, 0.145, 0.370296),
        (0, 0, 1),
        -88,
        88,
        172,
        ARM_EFFORT,
        roll=-15,
    ),
    JointFigures(
        "LARM_JOINT1", "LARM_JOINT0_Link", (0, 0, 0), (0, 1, 0), -140, 60, 133, ARM_EFFORT
    ),
    JointFigures(
        "LARM_JOINT2", "LARM_JOINT1_Link", (0, 0.095, -0.25), (0, 1, 0), -158, 0, 229, ARM_EFFORT
    ),
    JointFigures(
        "LARM_JOINT3", "LARM_JOINT2_Link", (-0.03, 0, 0), (0, 0, 1), -105, 165, 150, ARM_EFFORT
    ),
    JointFigures(
        "LARM_JOINT4", "LARM_JOINT3_Link", (0, 0, -0.235), (0, 1, 0), -100, 100, 250, ARM_EFFORT
    ),
    JointFigures(
        "LARM_JOINT5",
        "LARM_JOINT4_Link",
        (-0.04, 0, -0.09),
        (1, 0, 0),
        -163,
        163,
        300,
        ARM_EFFORT,
    ),
)

# Limits: the soft limits used at AIST. The +-30 degrees of the published models are a placeholder
# that would keep the jaws from opening beyond 74 mm.
FINGERS: tuple[JointFigures, ...] = (
    JointFigures(
        "HAND_JOINT0",
        "ARM_JOINT5_Link",
        (-0.0299, -0.033, 0),
        (0, 0, 1),
        -109,
        68,
        HAND_SPEED,
        HAND_EFFORT,
    ),
    JointFigures(
        "HAND_JOINT1",
        "HAND_JOINT0_Link",
        (-0.0419, 0, 0),
        (0, 0, 1),
        -150,
        90,
        HAND_SPEED,
        HAND_EFFORT,
    ),
    JointFigures(
        "HAND_JOINT2",
        "ARM_JOINT5_Link",
        (-0.0299, 0.033, 0),
        (0, 0, 1),
        -109,
        68,
        HAND_SPEED,
        HAND_EFFORT,
    ),
    JointFigures(
        "HAND_JOINT3",
        "HAND_JOINT2_Link",
        (-0.0419, 0, 0),
        (0, 0, 1),
        -150,
        90,
        HAND_SPEED,
        HAND_EFFORT,
    ),
)


def all_joints() -> tuple[JointFigures, ...]:
    """Every joint of both sides, each after its parent."""
    joints = list(TORSO_AND_HEAD)
    for side in ("L", "R"):
        joints += arm_joints(side)
        joints += hand_joints(side)
    return tuple(joints)


def arm_joints(side: str) -> tuple[JointFigures, ...]:
    """The six joints of the left ("L") or right ("R") arm."""
    return LEFT_ARM if side == "L" else tuple(_mirror(joint) for joint in LEFT_ARM)


def hand_joints(side: str) -> tuple[JointFigures, ...]:
    """The four joints of a hand; the hands are alike, not mirrored."""
    return tuple(replace(f, name=side + f.name, parent=side + f.parent) for f in FINGERS)


def mirror_vector(vector: Vector) -> Vector:
    """Mirror a point or direction in the plane y = 0."""
    return vector[0], -vector[1], vector[2]


def _mirror(joint: JointFigures) -> JointFigures:
    # Mirroring in y turns rotations about x and z round and leaves those about y.
    keeps_sense = joint.axis[1] != 0
    lower, upper = (joint.lower, joint.upper) if keeps_sense else (-joint.upper, -joint.lower)
    return replace(
        joint,
        name="R" + joint.name[1:],
        parent="R" + joint.parent[1:] if joint.parent.startswith("LARM") else joint.parent,
        origin=mirror_vector(joint.origin),
        lower=lower,
        upper=upper,
        roll=-joint.roll,
    )
