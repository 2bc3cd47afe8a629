"""Whether a posture or a motion touches the table, the robot's body or the other arm.

Pinocchio and coal test the collision primitives of the URDF and a box for the table top.
"""

from __future__ import annotations

from collections.abc import Collection, Iterable
from dataclasses import dataclass
from operator import attrgetter

import coal
import numpy as np
import pinocchio as pin
from numpy.typing import NDArray

from emd_arm_executor.config import CollisionConfig
from emd_arm_executor.motion_bound import MotionBound
from emd_arm_executor.robot_description import RobotDescription
from emd_core.errors import CollisionError
from emd_core.frames import FloatArray

TABLE = "table"

_CLEARANCE = attrgetter("distance_lower_bound")


@dataclass(frozen=True)
class Contact:
    """Two links, or a link and the table, that come closer than their margin.

    Attributes:
        first: Name of a link.
        second: Name of the other link, or "table".
    """

    first: str
    second: str

    def __str__(self) -> str:
        """Give both names."""
        return f"{self.first} and {self.second}"


@dataclass(frozen=True)
class Meeting:
    """Where a path touches; it may touch earlier, too.

    Attributes:
        contact: The pair that touches.
        share: How far along the path, 0..1.
    """

    contact: Contact
    share: float


class CollisionChecker:
    """Checks configurations of the whole robot."""

    def __init__(
        self,
        model: pin.Model,
        description: RobotDescription,
        rest: FloatArray,
        config: CollisionConfig | None = None,
    ) -> None:
        """Build the geometry and decide which pairs can ever touch.

        Left out are pairs that no joint moves against each other, neighbours and their next
        neighbours along the chain, whose primitives overlap though the real links cannot touch
        (HIRO's published collision matrix leaves the same pairs out), the fingers of one hand,
        pairs that touch at rest, and pairs of one arm that touch in none of many random postures.
        All other pairs of arm and arm, arm and body, arm and table stay.

        Args:
            model: The whole robot.
            description: The same robot with its table.
            rest: Configuration of the joints that belong to no arm, shape (nq,).
            config: Margins and samples.
        """
        self.config = config or CollisionConfig()
        self._model = model
        self._data = model.createData()
        self._geometry = pin.buildGeomFromUrdf(model, str(description.urdf), pin.COLLISION)
        self._links = [self._link_of(g) for g in self._geometry.geometryObjects]
        self._add_table(description)
        self._branches = self._find_branches(description)
        for first, second in self._moving_pairs():
            self._geometry.addCollisionPair(pin.CollisionPair(first, second))
        self._make_room()
        self._drop_pairs(rest)
        self._set_margins(description)
        self.bound = MotionBound(model, self._geometry)

    @property
    def pairs(self) -> list[Contact]:
        """The pairs of links that are checked, without repetition."""
        return list(dict.fromkeys(self._names))

    @property
    def path_step(self) -> float:
        """How finely a path must be sampled for `meeting` to miss nothing.

        With so much from each joint, radians, no pair moves by more than twice the slack.
        """
        return 2.0 * self.config.slack / max(self.bound.largest, 1e-9)

    def contact(self, q: FloatArray) -> Contact | None:
        """Give a pair that touches in a configuration (nq,), or None."""
        found = pin.computeCollisions(
            self._model, self._data, self._geometry, self._contacts, q, True
        )
        if not found:
            return None
        return next(iter(self._found()))

    def contacts(self, q: FloatArray) -> set[Contact]:
        """Give all pairs that touch in a configuration (nq,)."""
        pin.computeCollisions(self._model, self._data, self._geometry, self._contacts, q, False)
        return set(self._found())

    def clearances(self, q: FloatArray) -> FloatArray:
        """Bound from below what each pair keeps beyond its margin in a configuration (nq,).

        Returns:
            Metres, shape (P,), in the order of the collision pairs; at most 0 for what touches,
            exact for what nearly does, far too small for what is far apart.
        """
        pin.computeCollisions(self._model, self._data, self._geometry, self._contacts, q, False)
        return np.fromiter(map(_CLEARANCE, self._results), float, len(self._results))

    def nearer_than(self, clearances: FloatArray, distance: float) -> set[Contact]:
        """Name the pairs whose clearances (P,) are at most a distance, metres."""
        return {
            pair
            for pair, clearance in zip(self._names, clearances.tolist(), strict=True)
            if clearance <= distance
        }

    def meeting(
        self, configurations: FloatArray, ignored: Collection[Contact] = ()
    ) -> Meeting | None:
        """Find a place where a path touches something that is not ignored.

        Looks at the ends, then at the middle of what is not yet proven free by the clearances of
        its ends (`emd_arm_executor.motion_bound`), down to neighbouring rows, each time at those
        pairs only that are not. If no joint turns farther than `path_step` between these, no pair
        comes nearer than its margin less `CollisionConfig.slack` anywhere on the path.

        Args:
            configurations: The path, shape (N, nq), N >= 1.
            ignored: Pairs that may touch.
        """
        turned = np.abs(np.diff(configurations, axis=0, prepend=configurations[:1])).cumsum(axis=0)
        pairs = np.flatnonzero([pair not in ignored for pair in self._names])
        ends = (0, len(configurations) - 1)
        rooms = []
        for index in ends:
            rooms.append(self.clearances(configurations[index])[pairs])
            if (rooms[-1] <= 0.0).any():
                return self._meeting(rooms[-1], pairs, index / max(ends[1], 1))
        # Parts of the path that are open still: their first and last rows (N, 2), the clearances
        # there (N, 2, P), infinite where a larger part had proved a pair free.
        parts, known = np.array([ends]), np.stack(rooms)[None]
        while len(parts):
            travel = self.bound.travel(turned[parts[:, 1]] - turned[parts[:, 0]], pairs)
            unproven = travel >= known.sum(axis=1) + 2.0 * self.config.slack
            going_on = (parts[:, 1] - parts[:, 0] >= 2) & unproven.any(axis=1)
            parts, known, unproven = parts[going_on], known[going_on], unproven[going_on]
            middles = parts.sum(axis=1) // 2
            found = np.full(unproven.shape, np.inf)
            for middle, room, asked in zip(middles, found, unproven, strict=True):
                clear = self._clearances_of(pairs[asked], configurations[middle])
                if (clear <= 0.0).any():
                    return self._meeting(clear, pairs[asked], middle / ends[1])
                room[asked] = clear
            parts = np.stack([parts[:, 0], middles, middles, parts[:, 1]], axis=1).reshape(-1, 2)
            known = np.stack([known[:, 0], found, found, known[:, 1]], axis=1)
            known = known.reshape(len(parts), 2, len(pairs))
        return None

    def refusal(self, name: str, meeting: Meeting) -> CollisionError:
        """Describe what is met on a motion of this name."""
        return CollisionError(
            f"the motion '{name}' should keep {self.config.margin * 1e3:.0f} mm of clearance; "
            f"{meeting.contact} meet at {meeting.share:.0%} of it; choose another grasp or a "
            "shorter displacement"
        )

    def check_path(self, configurations: FloatArray, name: str) -> None:
        """Refuse a path on which something touches.

        Args:
            configurations: Of the whole robot along the path, shape (N, nq).
            name: What the motion is called in the error.

        Raises:
            CollisionError: Names the links and where on the path they meet.
        """
        meeting = self.meeting(configurations)
        if meeting is not None:
            raise self.refusal(name, meeting)

    def arms_in(self, contact: Contact) -> set[str]:
        """Name the arms whose links or hands take part in a contact."""
        branches = dict(zip(self._links, self._branches, strict=True))
        both = {branches[contact.first], branches[contact.second]}
        return {branch.split(" ")[0] for branch in both} - {""}

    def _clearances_of(self, pairs: NDArray[np.intp], q: FloatArray) -> FloatArray:
        """Give the clearances (K,) of some pairs (K,) in a configuration, see `clearances`."""
        pin.updateGeometryPlacements(self._model, self._data, self._geometry, self._contacts, q)
        room = np.empty(len(pairs))
        for place, pair in enumerate(pairs.tolist()):
            pin.computeCollision(self._geometry, self._contacts, pair)
            room[place] = self._results[pair].distance_lower_bound
        return room

    def _meeting(self, room: FloatArray, pairs: NDArray[np.intp], share: float) -> Meeting:
        """Name the one of some pairs that has the least clearance."""
        return Meeting(self._names[int(pairs[room.argmin()])], share)

    def _found(self) -> Iterable[Contact]:
        for pair, result in zip(self._names, self._results, strict=True):
            if result.isCollision():
                yield pair

    def _make_room(self) -> None:
        """Make room for the results of the collision pairs there are now."""
        self._contacts = pin.GeometryData(self._geometry)
        # Taking these out of their vector again and again would cost more than the checks.
        self._results = list(self._contacts.collisionResults)
        links, pairs = self._links, self._geometry.collisionPairs
        self._names = [Contact(links[pair.first], links[pair.second]) for pair in pairs]

    def _link_of(self, geometry: pin.GeometryObject) -> str:
        return str(self._model.frames[geometry.parentFrame].name)

    def _add_table(self, description: RobotDescription) -> None:
        placement = pin.SE3(np.eye(3), np.asarray(description.table_centre_in_base))
        box = coal.Box(*(float(length) for length in description.table_size))
        self._geometry.addGeometryObject(pin.GeometryObject(TABLE, 0, 0, placement, box))
        self._links.append(TABLE)

    def _find_branches(self, description: RobotDescription) -> list[str]:
        """Name for each geometry the arm it belongs to: arm, "arm hand", or "" for the rest."""
        names = {}
        for arm, parts in description.arms.items():
            names.update({joint: arm for joint in parts.group.joint_names})
            names.update({joint: f"{arm} hand" for joint in parts.gripper_joint_names})
        joints = [g.parentJoint for g in self._geometry.geometryObjects]
        return [names.get(str(self._model.names[joint]), "") for joint in joints]

    def _moving_pairs(self) -> list[tuple[int, int]]:
        objects = self._geometry.geometryObjects
        pairs = []
        for first in range(len(objects)):
            for second in range(first + 1, len(objects)):
                a, b = objects[first].parentJoint, objects[second].parentJoint
                branches = (self._branches[first], self._branches[second])
                one_hand = branches[0] == branches[1] and branches[0].endswith("hand")
                body = branches == ("", "")
                if not (self._near_in_chain(a, b) or one_hand or body):
                    pairs.append((first, second))
        return pairs

    def _near_in_chain(self, first: int, second: int) -> bool:
        """Tell whether at most two moving joints lie between two joints' links."""
        parents = self._model.parents
        lines = []
        for joint in (first, second):
            line = [joint]
            while line[-1] != 0 and len(line) < 3:
                line.append(parents[line[-1]])
            lines.append(line)
        table = 0 in (first, second)
        return not table and (second in lines[0] or first in lines[1]) or first == second

    def _drop_pairs(self, rest: FloatArray) -> None:
        """Drop the pairs that touch at rest, and those of one arm that never touch at random."""
        for request in self._contacts.collisionRequests:
            request.security_margin = self.config.margin
        at_rest = self.contacts(rest)
        rng = np.random.default_rng(self.config.seed)
        lower, upper = self._model.lowerPositionLimit, self._model.upperPositionLimit
        hits = np.zeros(len(self._geometry.collisionPairs), dtype=int)
        for _ in range(self.config.samples):
            q = rng.uniform(lower, upper)
            pin.computeCollisions(
                self._model, self._data, self._geometry, self._contacts, q, False
            )
            hits += [result.isCollision() for result in self._results]
        pairs = list(self._geometry.collisionPairs)
        for pair, name, count in zip(pairs, self._names, hits, strict=True):
            arms = {self._branches[i].split(" ")[0] for i in (pair.first, pair.second)}
            own = len(arms) == 1 and "" not in arms
            if (own and count == 0) or name in at_rest:
                self._geometry.removeCollisionPair(pair)
        self._make_room()

    def _set_margins(self, description: RobotDescription) -> None:
        tips = {link for arm in description.arms.values() for link in arm.fingertip_links}
        for index, pair in enumerate(self._geometry.collisionPairs):
            links = frozenset({self._links[pair.first], self._links[pair.second]})
            margin = self.config.margin
            if TABLE in links and links & tips:
                margin = -self.config.nail_penetration
            elif links in description.pair_margins:
                margin = description.pair_margins[links]
            self._contacts.collisionRequests[index].security_margin = margin
