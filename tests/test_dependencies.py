"""The dependency rule: cores know no ROS, packages import emd_core and not each other."""

import ast
import subprocess
import sys
from pathlib import Path

import pytest

SOURCE = Path(__file__).parents[1] / "ros_ws" / "src"
WORKERS = ("emd_core", "emd_cloth_sim", "emd_perception", "emd_planner", "emd_arm_executor")
PACKAGES = (*WORKERS, "emd_console")
# The console draws neat folds as goals; all else it knows from the graph.
FURTHER = {"emd_console": {"emd_cloth_sim"}}
MESSAGES = (
    "rclpy", "emd_msgs_py", "std_msgs", "sensor_msgs", "geometry_msgs", "trajectory_msgs",
    "visualization_msgs", "diagnostic_msgs", "builtin_interfaces", "std_srvs", "rosgraph_msgs",
    "action_msgs", "rcl_interfaces",
)  # fmt: skip
BLOCKED_IMPORT = """
import sys
class Block:
    def find_spec(self, name, path=None, target=None):
        if name.split(".")[0] in {blocked!r}:
            raise ImportError("blocked: " + name)
sys.meta_path.insert(0, Block())
import importlib
for module in {modules!r}:
    importlib.import_module(module)
"""


def core_modules(package: str) -> list[str]:
    """All modules of a package outside its ros folder."""
    root = SOURCE / package / package
    files = [file for file in root.rglob("*.py") if "ros" not in file.relative_to(root).parts]
    names = [".".join(file.relative_to(root.parent).with_suffix("").parts) for file in files]
    return sorted(name.removesuffix(".__init__") for name in names)


@pytest.mark.parametrize("package", PACKAGES)
def test_cores_import_without_ros(package) -> None:
    """Every core module imports while rclpy and all messages are blocked."""
    script = BLOCKED_IMPORT.format(blocked=set(MESSAGES), modules=core_modules(package))
    done = subprocess.run([sys.executable, "-c", script], capture_output=True, text=True)
    assert done.returncode == 0, done.stderr


def imported_packages(file: Path) -> set[str]:
    """Names of the packages that a source file imports."""
    tree = ast.parse(file.read_text())
    names: set[str] = set()
    for node in ast.walk(tree):
        if isinstance(node, ast.Import):
            names |= {alias.name.split(".")[0] for alias in node.names}
        elif isinstance(node, ast.ImportFrom) and node.module:
            names.add(node.module.split(".")[0])
    return names


@pytest.mark.parametrize("package", PACKAGES)
def test_packages_import_emd_core_and_not_each_other(package) -> None:
    """The workers are independent of each other, and nobody imports emd_console or emd_cell."""
    allowed = {package, "emd_core", "emd_msgs_py"} | FURTHER.get(package, set())
    for file in (SOURCE / package).rglob("*.py"):
        foreign = {name for name in imported_packages(file) if name.startswith("emd_")} - allowed
        assert not foreign, f"{file.relative_to(SOURCE)} imports {sorted(foreign)}"
