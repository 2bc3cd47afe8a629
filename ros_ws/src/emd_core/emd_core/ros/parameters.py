"""ROS parameters out of a core's config dataclass, so that a default is stated once."""

from __future__ import annotations

import dataclasses
import inspect
import re
from collections.abc import Callable, Mapping
from typing import Any, Generic, TypeVar

from rcl_interfaces.msg import (
    FloatingPointRange,
    IntegerRange,
    ParameterDescriptor,
    SetParametersResult,
)
from rclpy.exceptions import InvalidParameterTypeException, InvalidParameterValueException
from rclpy.node import Node
from rclpy.parameter import Parameter

from emd_core.errors import InvalidInputError
from emd_core.value_ranges import ValueRange, range_of

T = TypeVar("T")


def declare_config(node: Node, config: T, prefix: str = "", read_only: bool = False) -> T:
    """Declare a parameter for every field of a dataclass and return it with the values set.

    Nested dataclasses become dotted names. Descriptions come from the `Attributes:` section of the
    class docstring, ranges from `emd_core.value_ranges`. The dataclass checks the values itself.

    Args:
        node: Where to declare.
        config: Instance that holds the defaults; fields are bool, int, float, str, tuples of
            these, or dataclasses.
        prefix: Put before every name, with its dot.
        read_only: Whether the values can only be given when the node starts.

    Raises:
        InvalidInputError: If a value is out of its range or the dataclass refuses it.
    """
    return _build(config, _declare_all(node, config, prefix, read_only), prefix)


class LiveConfig(Generic[T]):
    """A config dataclass whose values can be set as parameters while the node runs.

    A set of values that the dataclass refuses changes nothing, and the caller is told why.
    """

    def __init__(
        self, node: Node, config: T, prefix: str = "", check: Callable[[T], None] | None = None
    ) -> None:
        """Declare the parameters; see `declare_config`.

        Args:
            node: Where to declare.
            config: Instance that holds the defaults.
            prefix: Put before every name, with its dot.
            check: Asked about every new value; may refuse it with an InvalidInputError.

        Raises:
            InvalidInputError: If a value that the node is started with is refused.
        """
        self._default, self._prefix = config, prefix
        self._check = check
        self._values = _declare_all(node, config, prefix)
        self.value: T = _build(config, self._values, prefix)
        node.add_on_set_parameters_callback(self._judge)
        node.add_post_set_parameters_callback(self._take)

    def _judge(self, parameters: list[Parameter]) -> SetParametersResult:
        """Say whether the values will do; others may still refuse theirs."""
        ours = self._ours(parameters)
        if not ours:
            return SetParametersResult(successful=True)
        try:
            changed = _build(self._default, {**self._values, **ours}, self._prefix)
            if self._check is not None:
                self._check(changed)
        except InvalidInputError as err:
            return SetParametersResult(successful=False, reason=str(err))
        return SetParametersResult(successful=True)

    def _take(self, parameters: list[Parameter]) -> None:
        ours = self._ours(parameters)
        if ours:
            self._values = {**self._values, **ours}
            self.value = _build(self._default, self._values, self._prefix)

    def _ours(self, parameters: list[Parameter]) -> dict[str, Any]:
        return {one.name: one.value for one in parameters if one.name in self._values}


def _declare_all(node: Node, config: Any, prefix: str, read_only: bool = False) -> dict[str, Any]:
    """Declare every field, also of inner dataclasses, and give the values by full name."""
    described = _attribute_texts(type(config))
    values: dict[str, Any] = {}
    for field in dataclasses.fields(config):
        default, name = getattr(config, field.name), f"{prefix}{field.name}"
        if dataclasses.is_dataclass(default):
            values.update(_declare_all(node, default, f"{name}.", read_only))
            continue
        descriptor = _descriptor(described.get(field.name, ""), default, range_of(field))
        descriptor.read_only = read_only
        start = list(default) if isinstance(default, tuple) else default
        try:
            values[name] = node.declare_parameter(name, start, descriptor).value
        except (InvalidParameterValueException, InvalidParameterTypeException) as err:
            raise InvalidInputError(f"parameter {name} was refused: {err}") from err
    return values


def _build(config: T, values: Mapping[str, Any], prefix: str) -> T:
    """Give the dataclass with the values of that prefix; it checks them."""
    chosen: dict[str, Any] = {}
    for field in dataclasses.fields(config):  # type: ignore[arg-type]
        default, name = getattr(config, field.name), f"{prefix}{field.name}"
        if dataclasses.is_dataclass(default):
            chosen[field.name] = _build(default, values, f"{name}.")
        else:
            value = values[name]
            chosen[field.name] = tuple(value) if isinstance(default, tuple) else value
    return dataclasses.replace(config, **chosen)  # type: ignore[type-var]


def _descriptor(text: str, default: Any, allowed: ValueRange | None) -> ParameterDescriptor:
    descriptor = ParameterDescriptor(description=text)
    if allowed is not None and isinstance(default, int):
        limits = IntegerRange(from_value=int(allowed.low), to_value=int(allowed.high), step=1)
        descriptor.integer_range = [limits]
    elif allowed is not None:
        descriptor.floating_point_range = [
            FloatingPointRange(from_value=float(allowed.low), to_value=float(allowed.high))
        ]
    return descriptor


def _attribute_texts(config_type: type) -> dict[str, str]:
    """The lines of a Google docstring's `Attributes:` section, by name."""
    documentation = inspect.getdoc(config_type) or ""
    section = documentation.partition("Attributes:\n")[2]
    entries = re.split(r"\n {4}(?=\w+:)", "\n" + section)
    texts = (entry.partition(":") for entry in entries if ":" in entry)
    return {name.strip(): " ".join(text.split()) for name, _, text in texts}
