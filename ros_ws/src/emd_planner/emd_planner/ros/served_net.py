"""The network that the planner node plans with, exchangeable while the node runs."""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path

import torch
from rcl_interfaces.msg import ParameterDescriptor, SetParametersResult
from rclpy.node import Node
from rclpy.parameter import Parameter

from emd_core.errors import ModelError
from emd_planner.state_predictor import StatePredictor
from emd_planner.trust import TrustModel, load_trust
from emd_planner.weights import SHIPPED_WEIGHTS, load_net

PARAMETER = "weights"


class ServedNet:
    """Loads the file that the parameter `weights` names, at the start and whenever it is set.

    Weights that cannot be loaded at the start leave the node alive: every plan is answered with
    the reason until good ones are set. Later, bad weights are refused and the net stays.

    Attributes:
        trust: What is known of the failures of the net's plans; None if nothing is.
    """

    def __init__(self, node: Node, device: torch.device) -> None:
        """Declare the parameter and load the net onto `device`."""
        self._device = device
        self._net: StatePredictor | None = None
        self.trust: TrustModel | None = None
        self._problem = ""
        text = "safetensors file of the trained net; empty: the one that comes with the package"
        path = node.declare_parameter(PARAMETER, "", ParameterDescriptor(description=text)).value
        try:
            self._load(path)
        except ModelError as err:
            self._problem = f"{err}; then `ros2 param set {node.get_name()} {PARAMETER} FILE`"
            node.get_logger().error(self._problem)
        node.add_on_set_parameters_callback(self._on_set)

    def get(self) -> StatePredictor:
        """Give the net.

        Raises:
            ModelError: If none has been loaded yet; says why.
        """
        if self._net is None:
            raise ModelError(self._problem)
        return self._net

    def _load(self, path: str) -> None:
        file = Path(path) if path else SHIPPED_WEIGHTS
        net = load_net(file, self._device)
        self._net, self.trust = net, load_trust(file)

    def _on_set(self, parameters: Sequence[Parameter]) -> SetParametersResult:
        for parameter in parameters:
            if parameter.name == PARAMETER:
                try:
                    self._load(str(parameter.value))
                except ModelError as err:
                    return SetParametersResult(successful=False, reason=str(err))
        return SetParametersResult(successful=True)
