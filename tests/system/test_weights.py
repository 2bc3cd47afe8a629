"""A planner without usable weights says so, lives on, and takes good ones while it runs."""

import math
import shutil
from collections.abc import Iterator
from contextlib import suppress
from pathlib import Path

import pytest
from rcl_interfaces.srv import SetParameters
from rclpy.parameter import Parameter
from safetensors import safe_open
from safetensors.torch import load_file, save_file

from emd_cell.launcher import Launcher, NodeSpec
from emd_cloth_sim.config import ClothConfig
from emd_cloth_sim.neat_folds import neat_fold
from emd_core.errors import DeadlineError, ErrorCode
from emd_core.frames import FieldOfView
from emd_core.ros import conversions
from emd_msgs_py.srv import PlanFold
from emd_planner.trust import TrustModel
from emd_planner.weights import SHIPPED_WEIGHTS

pytestmark = pytest.mark.system

NAMESPACE = "/without_weights"


@pytest.fixture(scope="module")
def planner(ros_domain, tmp_path_factory) -> Iterator[Launcher]:
    """A planner that was told of weights which do not exist."""
    folder = tmp_path_factory.mktemp("planner")
    parameters = {
        "weights": str(folder / "missing.safetensors"),
        "search.max_iterations": 3,
        "keep_out": [0.3, 0.3, 0.4, 0.3, 0.4, 0.4, math.nan, -0.4, -0.4, -0.3, -0.4, -0.3, -0.3],
    }
    spec = NodeSpec(
        "planner", "emd_planner.ros.planner_node", parameters, restart=False, namespace=NAMESPACE
    )
    with Launcher([spec], folder / "logs") as launcher:
        yield launcher


def ask(client, service_type, name: str, request):
    """Call a service of the planner and give its response.

    The middleware may lose the answer to a call that is made as soon as the service is there: the
    server need not have found the client yet. So a call without answer is made again.
    """
    service = client.create_client(service_type, f"{NAMESPACE}/planner/{name}")
    assert service.wait_for_service(timeout_sec=60.0)
    for _ in range(2):
        with suppress(DeadlineError):
            return client._wait(service.call_async(request), 30.0, name)
    return client._wait(service.call_async(request), 60.0, name)


def ask_for_a_plan(client) -> PlanFold.Response:
    """Plan a half fold."""
    grid = conversions.voxel_grid_to_message(
        neat_fold("half", ClothConfig()).goal_grid(FieldOfView()),
        conversions.header(0.0, conversions.TABLE_FRAME),
    )
    request = PlanFold.Request(initial_grid=grid, goal_grid=grid, steps=1)
    return ask(client, PlanFold, "plan", request)


def set_weights(client, path: Path | str):
    """Set the parameter and give the node's verdict."""
    return set_parameter(client, "weights", str(path))


def set_parameter(client, name: str, value: str | float):
    """Set a parameter of the planner and give the node's verdict."""
    parameter = Parameter(name, value=value).to_parameter_msg()
    request = SetParameters.Request(parameters=[parameter])
    return ask(client, SetParameters, "set_parameters", request).results[0]


def with_a_weight_of_another_shape(path: Path) -> Path:
    """Copy the shipped weights, one of them cut."""
    tensors = load_file(SHIPPED_WEIGHTS)
    name = sorted(tensors)[0]
    tensors[name] = tensors[name][:1].contiguous()
    with safe_open(SHIPPED_WEIGHTS, framework="pt") as stored:
        save_file(tensors, path, stored.metadata())
    return path


def test_missing_and_misshapen_weights_are_named_and_good_ones_taken(
    client, planner, tmp_path
) -> None:
    """The same node answers with the reason, refuses worse, and plans once it can."""
    answer = ask_for_a_plan(client)
    assert answer.error_code == ErrorCode.MODEL
    assert "missing.safetensors" in answer.error_msg
    verdict = set_weights(client, with_a_weight_of_another_shape(tmp_path / "cut.safetensors"))
    assert not verdict.successful
    assert "should have shape" in verdict.reason
    assert ask_for_a_plan(client).error_code == ErrorCode.MODEL
    assert set_weights(client, SHIPPED_WEIGHTS).successful
    answer = ask_for_a_plan(client)
    assert answer.error_code == ErrorCode.NONE, answer.error_msg
    assert answer.plan.manipulations
    assert not set_weights(client, tmp_path / "nothing").successful
    assert ask_for_a_plan(client).plan.manipulations
    planner.require_alive()


def test_plans_that_are_too_likely_to_fail_are_refused_but_told(client, planner, tmp_path) -> None:
    """By what is known of the weights' plans; a limit without such knowledge refuses all."""
    weights = Path(shutil.copy(SHIPPED_WEIGHTS, tmp_path / "net.safetensors"))
    assert set_weights(client, weights).successful
    plain = ask_for_a_plan(client)
    assert plain.error_code == ErrorCode.NONE and math.isnan(plain.plan.failure_probability)
    assert not set_parameter(client, "max_failure_probability", 1.5).successful
    assert set_parameter(client, "max_failure_probability", 0.5).successful
    unknown = ask_for_a_plan(client)
    assert unknown.error_code == ErrorCode.DOUBTFUL_PLAN and "fit-trust" in unknown.error_msg
    for weight, code in ((3.0, ErrorCode.DOUBTFUL_PLAN), (-3.0, ErrorCode.NONE)):
        TrustModel((weight, 0.0, 0.0, 0.0, 0.0), 10, 5).save(weights)
        assert set_weights(client, weights).successful
        answer = ask_for_a_plan(client)
        assert answer.error_code == code and answer.plan.manipulations
        chance = 1.0 / (1.0 + math.exp(-weight))
        assert answer.plan.failure_probability == pytest.approx(chance)
    assert set_parameter(client, "max_failure_probability", 1.0).successful
    assert set_weights(client, SHIPPED_WEIGHTS).successful
