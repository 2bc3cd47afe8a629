"""ROS parameters out of a core's config dataclass, so that a default is stated once."""

from __future__ import annotations

import dataclasses
import inspect
import re
from typing import Any, TypeVar

from rcl_interfaces.msg import ParameterDescriptor
from rclpy.node import Node

T = TypeVar("T")


def declare_config(node: Node, config: T, prefix: str = "") -> T:
    """Declare a parameter for every field of a dataclass and return it with the values set.

    Nested dataclasses become dotted names. Descriptions come from the `Attributes:` section of the
    class docstring. The dataclass checks the values itself.

    Args:
        node: Where to declare.
        config: Instance that holds the defaults; fields are bool, int, float, str, tuples of
            these, or dataclasses.
        prefix: Put before every name, with its dot.

    Raises:
        InvalidInputError: If the dataclass refuses a value.
    """
    described = _attribute_texts(type(config))
    values: dict[str, Any] = {}
    for field in dataclasses.fields(config):  # type: ignore[arg-type]
        default = getattr(config, field.name)
        if dataclasses.is_dataclass(default):
            values[field.name] = declare_config(node, default, f"{prefix}{field.name}.")
            continue
        descriptor = ParameterDescriptor(description=described.get(field.name, ""))
        start = list(default) if isinstance(default, tuple) else default
        value = node.declare_parameter(f"{prefix}{field.name}", start, descriptor).value
        values[field.name] = tuple(value) if isinstance(default, tuple) else value
    return dataclasses.replace(config, **values)  # type: ignore[type-var]


def _attribute_texts(config_type: type) -> dict[str, str]:
    """The lines of a Google docstring's `Attributes:` section, by name."""
    documentation = inspect.getdoc(config_type) or ""
    section = documentation.partition("Attributes:\n")[2]
    entries = re.split(r"\n {4}(?=\w+:)", "\n" + section)
    texts = (entry.partition(":") for entry in entries if ":" in entry)
    return {name.strip(): " ".join(text.split()) for name, _, text in texts}
