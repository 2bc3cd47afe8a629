"""A ROS domain that nothing else on this machine uses, or has used a moment ago."""

from __future__ import annotations

import random
from contextlib import AbstractContextManager

from domain_coordinator import domain_id


def own_domain() -> AbstractContextManager[int]:
    """Reserve a random domain's number while the context lasts.

    The first free one, which `domain_id` gives by itself, is the same for every test; what the
    killed nodes of one left in shared memory would be in the way of the next.
    """
    return domain_id(lambda: random.SystemRandom().randint(1, 100))
