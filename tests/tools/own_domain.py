"""A ROS domain that nothing else on this machine uses, or has used a moment ago."""

from __future__ import annotations

import random
from collections.abc import Iterator
from contextlib import AbstractContextManager, contextmanager

import rclpy
from domain_coordinator import domain_id
from rclpy.context import Context


def own_domain() -> AbstractContextManager[int]:
    """Reserve a random domain's number while the context lasts.

    The first free one, which `domain_id` gives by itself, is the same for every test; what the
    killed nodes of one left in shared memory would be in the way of the next.
    """
    return domain_id(lambda: random.SystemRandom().randint(1, 100))


@contextmanager
def own_context() -> Iterator[Context]:
    """Reserve a domain and give a context in it, shut down at the end."""
    context = Context()
    with own_domain() as number:
        rclpy.init(context=context, domain_id=number)
        try:
            yield context
        finally:
            rclpy.try_shutdown(context=context)
