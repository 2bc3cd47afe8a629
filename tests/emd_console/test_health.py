"""What the operator is told of the nodes."""

from emd_console.health import SILENT_AFTER, node_health, report_from_status


def by_name(reports, now=100.0):
    """Health by node."""
    return {item.node: item for item in node_health(reports, now)}


def test_a_node_never_heard_of_is_missed_with_what_it_costs() -> None:
    """Each needed node is listed from the beginning."""
    health = by_name([])
    assert list(health) == ["perception", "planner", "arm_executor"]
    assert health["planner"].level == "silent"
    assert "nothing can be planned" in health["planner"].text


def test_a_node_that_falls_silent_is_named_and_comes_back() -> None:
    """Silence begins after a few seconds, ends with the next report."""
    report = report_from_status("planner: plans", 0, "ready", "/planner", 100.0)
    assert by_name([report], 100.0 + SILENT_AFTER - 0.1)["planner"].level == "ok"
    silent = by_name([report], 108.0)["planner"]
    assert silent.level == "silent" and "silent for 8 s" in silent.text
    again = report_from_status("planner: plans", 0, "planning", "/planner", 108.0)
    assert by_name([again], 108.0)["planner"].text == "planning"


def test_a_node_is_as_bad_as_its_worst_part() -> None:
    """A lost camera is not hidden by what was said of the cloth; what is old does not count."""
    camera = report_from_status("perception: camera", 2, "no images", "/perception", 100.0)
    cloth = report_from_status("perception: cloth", 0, "cloth found", "/perception", 100.5)
    health = by_name([camera, cloth], 101.0)["perception"]
    assert (health.level, health.text) == ("error", "no images")
    later = report_from_status("perception: cloth", 0, "cloth found", "/perception", 108.0)
    health = by_name([camera, later], 108.0)["perception"]
    assert (health.level, health.text) == ("ok", "cloth found")


def test_levels_are_those_of_diagnostics() -> None:
    """0 ok, 1 warning, 2 error; what is beyond counts as stale."""
    levels = [report_from_status("a: b", n, "", "", 0.0).level for n in (0, 1, 2, 3, 77)]
    assert levels == ["ok", "warning", "error", "silent", "silent"]


def test_the_nodes_name_comes_from_its_hardware_id_without_the_namespace() -> None:
    """Where there is none, from the status's name."""
    assert report_from_status("x: cloth", 0, "", "/cell/perception", 0.0).node == "perception"
    assert report_from_status("lidar: driver", 0, "", "", 0.0).node == "lidar"
