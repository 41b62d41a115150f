"""The ROS 2 node against a stand-in of ROS; and the package."""

import ast
import runpy
import sys
from pathlib import Path
from types import ModuleType, SimpleNamespace
from xml.etree import ElementTree

import pytest
import yaml

from auv_fault_diagnosis.monitor import Settings
from auv_fault_env.fleet import Fleet
from auv_fault_env.schedules import FaultEvent
from training.rollouts import roll_out

PACKAGE = Path(__file__).parents[2] / "ros2" / "auv_fault_diagnosis"
NODE = PACKAGE / "auv_fault_diagnosis" / "node.py"
FAULT = "motor_overheating:port"


class Node:
    """As much of `rclpy.node.Node` as the package uses."""

    def __init__(self, parameters):
        self.parameters = parameters
        self.declared = {}
        self.published = []
        self.errors = []
        self.ended = False
        self.time = 0.0

    def declare_parameter(self, name, default):
        self.declared[name] = default
        return SimpleNamespace(value=self.parameters.get(name, default))

    def create_publisher(self, kind, topic, depth):
        self.diagnostics_topic = topic
        return SimpleNamespace(publish=self.published.append)

    def create_subscription(self, kind, topic, callback, depth):
        self.readings_topic = topic
        self.heard = callback

    def create_timer(self, period, callback):
        self.period = period
        self.tick = callback

    def get_logger(self):
        return SimpleNamespace(error=self.errors.append)

    def get_clock(self):
        now = SimpleNamespace(nanoseconds=1e9 * self.time, to_msg=lambda: self.time)
        return SimpleNamespace(now=lambda: now)

    def destroy_node(self):
        self.ended = True


class Message(SimpleNamespace):
    """A message with any fields."""


class StatusMessage(Message):
    OK = b"\x00"
    WARN = b"\x01"
    ERROR = b"\x02"
    STALE = b"\x03"


class ArrayMessage(Message):
    def __init__(self):
        super().__init__(header=SimpleNamespace(), status=[])


@pytest.fixture
def spin(monkeypatch):
    """Run the node on messages, 0.1 s apart, with some parameters; gives node and exit code."""

    def spin(messages, **parameters):
        node = Node(parameters)

        def push(node):
            for data in messages:
                node.heard(SimpleNamespace(data=data))
                node.tick()
                node.time += 0.1
            node.time += 60.0
            node.tick()
            raise KeyboardInterrupt

        modules = {
            "rclpy": dict(
                init=lambda: None,
                create_node=lambda name: node,
                spin=push,
                try_shutdown=lambda: None,
            ),
            "rclpy.node": dict(Node=Node),
            "rclpy.executors": dict(
                ExternalShutdownException=type("ExternalShutdownException", (Exception,), {})
            ),
            "diagnostic_msgs": {},
            "diagnostic_msgs.msg": dict(
                DiagnosticArray=ArrayMessage, DiagnosticStatus=StatusMessage, KeyValue=Message
            ),
            "std_msgs": {},
            "std_msgs.msg": dict(Float64MultiArray=Message),
        }
        for name, contents in modules.items():
            fake = ModuleType(name)
            fake.__dict__.update(contents)
            monkeypatch.setitem(sys.modules, name, fake)
        with pytest.raises(SystemExit) as ended:
            runpy.run_path(str(NODE), run_name="__main__")
        assert node.ended
        return node, ended.value.code

    return spin


@pytest.fixture(scope="module")
def readings():
    rollout = roll_out(Fleet(1), [2], 300, schedules=[(FaultEvent(FAULT, 10.0, 0.8),)])
    return rollout.observations[:, 0].astype(float)


def of(array, name):
    return next(one for one in array.status if one.name == f"auv_fault_diagnosis: {name}")


def test_a_fault_is_said_of_its_motor_when_it_is_there(spin, readings):
    node, code = spin(readings, diagnoser="filter_bank")
    assert code == 0 and len(node.published) == 301
    assert all(one.level == b"\x00" for one in node.published[80].status)
    port = of(node.published[-2], "port motor")
    assert (port.level, port.message) == (b"\x02", FAULT)
    figures = {pair.key: pair.value for pair in port.values}
    assert figures["class"] == FAULT and float(figures["probability"]) > 0.9
    assert abs(float(figures["severity"]) - 0.8) < 0.3 and float(figures["severity std"]) > 0.0
    assert 5.0 < float(figures["alarm for [s]"]) < 20.0
    assert of(node.published[-2], "starboard motor").level == b"\x00"
    assert {one.level for one in node.published[-1].status} == {b"\x03"}
    assert node.published[3].header.stamp == pytest.approx(0.3)


def test_wrong_messages_are_reported_and_left_out(spin, readings):
    node, _ = spin([readings[0], readings[1][:5], readings[2]], diagnoser="null")
    assert len(node.errors) == 1 and "number of readings: got 5" in node.errors[0]
    assert of(node.published[2], "hull").level == b"\x00"


def test_a_parameter_that_cannot_be_used_ends_the_node_in_one_line(spin, capsys):
    node, code = spin([], diagnoser="filter_bang")
    assert code == 2 and not node.published
    shown = capsys.readouterr().err
    assert shown.count("\n") == 1 and "did you mean 'filter_bank'" in shown
    assert spin([], rate=0.0)[1] == 2


def test_the_file_of_parameters_has_those_of_the_node_at_their_defaults(spin):
    [(name, content)] = yaml.safe_load((PACKAGE / "config" / "parameters.yaml").read_text()).items()
    assert name == "auv_fault_diagnosis"
    given = content["ros__parameters"]
    node, _ = spin([], topic="x")
    assert node.declared == given and set(Settings.__dataclass_fields__) < set(given)
    node, _ = spin([], readings_topic="a", diagnostics_topic="b", rate=4.0)
    assert (node.readings_topic, node.diagnostics_topic, node.period) == ("a", "b", 0.25)


def test_the_package_installs_what_it_has(monkeypatch):
    given = {}
    setuptools = ModuleType("setuptools")
    monkeypatch.setitem(sys.modules, "setuptools", setuptools)
    setuptools.setup = lambda **fields: given.update(fields)
    runpy.run_path(str(PACKAGE / "setup.py"))
    description = ElementTree.parse(PACKAGE / "package.xml").getroot()
    assert description.find("name").text == given["name"] == "auv_fault_diagnosis"
    assert description.find("version").text == given["version"]
    assert description.find("export/build_type").text == "ament_python"
    installed = {name for _, names in given["data_files"] for name in names}
    assert all((PACKAGE / name).is_file() for name in installed)
    kept = {"launch", "config", "resource"}
    present = {
        path.relative_to(PACKAGE).as_posix()
        for path in PACKAGE.rglob("*")
        if path.is_file() and path.parent.name in kept
    }
    assert present == installed - {"package.xml"}
    [(script, target)] = [one.split(" = ") for one in given["entry_points"]["console_scripts"]]
    module, _, function = target.partition(":")
    assert (PACKAGE / f"{module.replace('.', '/')}.py").is_file() and function == "main"
    depends = {one.text for one in description.findall("exec_depend")}
    imported = {
        name.partition(".")[0]
        for path in (NODE, PACKAGE / "launch" / "diagnosis.launch.py")
        for node in ast.walk(ast.parse(path.read_text()))
        if isinstance(node, ast.ImportFrom | ast.Import)
        for name in ([node.module] if isinstance(node, ast.ImportFrom) else [node.names[0].name])
    }
    own = {"sys", "pathlib", "auv_fault_env", "auv_fault_diagnosis"}
    assert imported - own == depends
    assert f'executable="{script}"' in (PACKAGE / "launch" / "diagnosis.launch.py").read_text()


def test_the_monitor_needs_no_ros():
    tree = ast.parse((NODE.parent / "monitor.py").read_text())
    names = [node.module for node in ast.walk(tree) if isinstance(node, ast.ImportFrom)]
    assert not [name for name in names if name.startswith(("rclpy", "diagnostic_msgs", "std_msgs"))]
