"""Parameters out of dataclasses: described, ranged, checked, changeable."""

from collections.abc import Iterator
from dataclasses import dataclass, field

import pytest
import rclpy
from own_domain import own_domain
from rclpy.node import Node
from rclpy.parameter import Parameter

from emd_core.errors import InvalidInputError
from emd_core.ros.parameters import LiveConfig, declare_config
from emd_core.value_ranges import bounded, check_ranges


@dataclass(frozen=True)
class Inner:
    """Inner settings.

    Attributes:
        low: Lower end,
            in metres.
        high: Upper end.
    """

    low: float = bounded(1.0, 0.0, 10.0)
    high: float = bounded(2.0, 0.0, 10.0)

    def __post_init__(self) -> None:
        """Check the order of the ends."""
        check_ranges(self)
        if self.low > self.high:
            raise InvalidInputError(f"low must not exceed high, got {self.low}, {self.high}")


@dataclass(frozen=True)
class Settings:
    """Settings.

    Attributes:
        count: How many.
        place: Where, x y.
        inner: More.
    """

    count: int = bounded(3, 1, 5)
    place: tuple[float, float] = (0.0, 1.0)
    inner: Inner = field(default_factory=Inner)


@pytest.fixture
def node() -> Iterator[Node]:
    """A node in a domain of its own."""
    with own_domain() as number:
        rclpy.init(domain_id=number)
        made = rclpy.create_node("settings")
        yield made
        made.destroy_node()
        rclpy.try_shutdown()


def set_values(node: Node, **values) -> tuple[bool, str]:
    """Set parameters at once; names have __ for dots."""
    wanted = [Parameter(name.replace("__", "."), value=value) for name, value in values.items()]
    result = node.set_parameters_atomically(wanted)
    return result.successful, result.reason


def test_parameters_tell_their_meaning_and_range(node) -> None:
    """The docstring's text and the range beside the default are in the descriptor."""
    assert declare_config(node, Settings(), "my.") == Settings()
    low = node.describe_parameter("my.inner.low")
    assert low.description == "Lower end, in metres."
    assert (low.floating_point_range[0].from_value, low.floating_point_range[0].to_value) == (
        0,
        10,
    )
    count = node.describe_parameter("my.count").integer_range[0]
    assert (count.from_value, count.to_value) == (1, 5)


def test_values_change_while_the_node_runs(node) -> None:
    """Inner values and tuples too; who checks them is asked."""
    asked: list[Settings] = []
    live = LiveConfig(node, Settings(), "my.", asked.append)
    assert set_values(node, my__count=5, my__place=[2.0, 3.0], my__inner__high=4.0)[0]
    assert live.value == Settings(5, (2.0, 3.0), Inner(1.0, 4.0)) == asked[-1]


def test_values_that_fit_only_together_are_set_together(node) -> None:
    """Both ends move at once; one alone would be out of order."""
    live = LiveConfig(node, Settings(), "my.")
    done, reason = set_values(node, my__inner__low=8.0)
    assert not done and "exceed" in reason
    assert live.value == Settings()
    assert set_values(node, my__inner__low=8.0, my__inner__high=9.0)[0]
    assert live.value.inner == Inner(8.0, 9.0)


@pytest.mark.parametrize(
    "values", [{"my__count": 6}, {"my__inner__low": -1.0}, {"my__count": "many"}]
)
def test_what_is_out_of_range_changes_nothing(node, values) -> None:
    """Neither the config nor the parameter, and the answer has a reason."""
    live = LiveConfig(node, Settings(), "my.")
    done, reason = set_values(node, **values)
    assert not done and reason
    assert live.value == Settings()
    assert node.get_parameter("my.count").value == 3


def test_what_one_config_refuses_no_other_takes(node) -> None:
    """Values of two configs that are set together change both or none."""
    first, second = LiveConfig(node, Settings(), "one."), LiveConfig(node, Settings(), "two.")
    assert not set_values(node, one__count=4, two__inner__low=8.0)[0]
    assert (first.value, second.value) == (Settings(), Settings())
    assert set_values(node, one__count=4, two__inner__low=1.5)[0]
    assert (first.value.count, second.value.inner.low) == (4, 1.5)


def test_a_refusal_of_the_check_changes_nothing(node) -> None:
    """What the node cannot use stays out, with its reason."""

    def refuse(config: Settings) -> None:
        raise InvalidInputError("not now")

    live = LiveConfig(node, Settings(), "my.", refuse)
    assert set_values(node, my__count=4) == (False, "not now")
    assert live.value == Settings()


def test_parameters_of_others_are_none_of_its_business(node) -> None:
    """Another parameter of the node is set without a question."""
    LiveConfig(node, Settings(), "my.")
    node.declare_parameter("other", 1)
    assert set_values(node, other=2)[0]


def test_a_start_out_of_range_is_refused_by_name() -> None:
    """The node does not start with what it would not take later."""
    with own_domain() as number:
        rclpy.init(domain_id=number)
        node = rclpy.create_node("settings", parameter_overrides=[Parameter("my.count", value=9)])
        try:
            with pytest.raises(InvalidInputError, match="my.count"):
                declare_config(node, Settings(), "my.")
        finally:
            node.destroy_node()
            rclpy.try_shutdown()
