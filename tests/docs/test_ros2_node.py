"""The ROS 2 node against a stand-in for ROS: readings pushed through, diagnoses taken out."""

import runpy
import sys
from pathlib import Path
from types import ModuleType, SimpleNamespace

import numpy as np
import pytest

from auv_fault_env.fleet import Fleet
from auv_fault_env.schedules import FaultEvent
from training.rollouts import roll_out

NODE = Path(__file__).parents[2] / "docs" / "examples" / "ros2_node.py"
FAULT = "motor_overheating:port"


class Node:
    """As much of `rclpy.node.Node` as the example uses."""

    def __init__(self, parameters):
        self.parameters = parameters
        self.published = []
        self.errors = []
        self.ended = False

    def declare_parameter(self, name, default):
        return SimpleNamespace(value=self.parameters.get(name, default))

    def create_publisher(self, kind, topic, depth):
        assert topic == "/diagnostics"
        return SimpleNamespace(publish=self.published.append)

    def create_subscription(self, kind, topic, callback, depth):
        assert topic == "readings"
        self.heard = callback

    def get_logger(self):
        return SimpleNamespace(error=self.errors.append)

    def get_clock(self):
        return SimpleNamespace(now=lambda: SimpleNamespace(to_msg=lambda: "now"))

    def destroy_node(self):
        self.ended = True


def message(**defaults):
    def make(**fields):
        return SimpleNamespace(**defaults | fields)

    return make


@pytest.fixture
def spin(monkeypatch):
    """Run the example on messages, with some parameters; gives the node."""

    def spin(messages, **parameters):
        node = Node(parameters)

        def push(node):
            for data in messages:
                node.heard(SimpleNamespace(data=data))
            raise KeyboardInterrupt

        status = message()
        status.OK = b"\x00"
        status.WARN = b"\x01"
        modules = {
            "rclpy": dict(
                init=lambda: None,
                create_node=lambda name: node,
                spin=push,
                try_shutdown=lambda: None,
            ),
            "rclpy.executors": dict(
                ExternalShutdownException=type("ExternalShutdownException", (Exception,), {})
            ),
            "diagnostic_msgs.msg": dict(
                DiagnosticArray=lambda status: SimpleNamespace(
                    header=SimpleNamespace(), status=status
                ),
                DiagnosticStatus=status,
                KeyValue=message(),
            ),
            "std_msgs.msg": dict(Float64MultiArray=message()),
        }
        for name, contents in modules.items():
            fake = ModuleType(name)
            fake.__dict__.update(contents)
            monkeypatch.setitem(sys.modules, name, fake)
        runpy.run_path(str(NODE), run_name="__main__")
        assert node.ended
        return node

    return spin


@pytest.fixture(scope="module")
def readings():
    rollout = roll_out(Fleet(1), [2], 300, schedules=[(FaultEvent(FAULT, 10.0, 0.8),)])
    return rollout.observations[:, 0].astype(float)


@pytest.mark.parametrize("diagnoser", ["integrated", "filter_bank"])
def test_a_fault_is_said_when_it_is_there(spin, readings, diagnoser):
    said = [answer.status[0] for answer in spin(readings, diagnoser=diagnoser).published]
    assert len(said) == 300
    assert (said[80].level, said[80].message) == (b"\x00", "normal")
    assert (said[-1].level, said[-1].message) == (b"\x01", FAULT)
    figures = {pair.key: float(pair.value) for pair in said[-1].values}
    assert figures["p(normal)"] < 0.1 and figures[f"p({FAULT})"] > 0.5
    assert abs(figures["severity"] - 0.8) < 0.3 and figures["severity std"] > 0.0


def test_silent_channels_pass_and_wrong_messages_are_reported(spin, readings):
    silent = readings[:3].copy()
    silent[1, 4:] = np.nan
    node = spin([silent[0], silent[1], silent[2][:5], np.full(12, np.inf), silent[2]])
    assert len(node.published) == 4
    assert len(node.errors) == 1 and "(1, 5)" in node.errors[0]
