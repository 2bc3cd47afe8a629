"""Ending a search between two layers of a net, not only between two iterations."""

from __future__ import annotations

import time
from collections.abc import Callable
from typing import Any

import torch
from torch import Tensor, nn

from emd_core.errors import CancelledError


class TimeIsUp(Exception):
    """The time budget of a search is spent."""


class Watch:
    """Ends what it is asked in, when the caller wants so or time is up."""

    def __init__(self, should_stop: Callable[[], bool] | None, deadline: float) -> None:
        """Watch.

        Args:
            should_stop: Whether the caller wants an end; None: never.
            deadline: By `time.monotonic`, seconds; infinite: none.
        """
        self._should_stop, self._deadline = should_stop, deadline

    def __call__(self, needed: float = 0.0) -> None:
        """Do nothing, usually.

        Args:
            needed: Seconds that shall be left before the deadline.

        Raises:
            CancelledError: If `should_stop` says so.
            TimeIsUp: If the deadline has passed, or less time is left than needed.
        """
        if self._should_stop is not None and self._should_stop():
            raise CancelledError("the search for a plan was asked to stop")
        if time.monotonic() + needed > self._deadline:
            raise TimeIsUp


def ask_between_layers(net: nn.Module, watch: Callable[[], None]) -> None:
    """Let a net ask a watch before each of its modules, on the way back too, from now on.

    What the watch raises ends the prediction or the back-propagation.
    """

    def before(module: nn.Module, inputs: Any) -> None:
        watch()

    def on_gradient(gradient: Tensor) -> None:
        watch()

    def after(module: nn.Module, inputs: Any, output: Any) -> None:
        if isinstance(output, torch.Tensor) and output.requires_grad:
            output.register_hook(on_gradient)

    for module in net.modules():
        module.register_forward_pre_hook(before)
        module.register_forward_hook(after)
