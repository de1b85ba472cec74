"""The ROS 2 example, run against a stand-in of the few parts of ROS 2's Python interface that it uses."""

import importlib.util
import sys
from pathlib import Path
from types import MappingProxyType, ModuleType, SimpleNamespace

import numpy as np
import pytest

import flocking as fk

EXAMPLE = Path(__file__).resolve().parents[3] / "docs" / "examples" / "ros2_controller.py"


class Wrench:
    """``geometry_msgs/Wrench``."""

    def __init__(self):
        self.force = SimpleNamespace(x=0.0, y=0.0, z=0.0)


class Odometry:
    """``nav_msgs/Odometry``: the stamp, the position and the velocity."""

    def __init__(self, nanoseconds, q, p):
        self.header = SimpleNamespace(stamp=SimpleNamespace(sec=nanoseconds // 10**9, nanosec=nanoseconds % 10**9))
        self.pose = SimpleNamespace(pose=SimpleNamespace(position=SimpleNamespace(x=q[0], y=q[1], z=0.0)))
        self.twist = SimpleNamespace(twist=SimpleNamespace(linear=SimpleNamespace(x=p[0], y=p[1], z=0.0)))


class Node:
    """``rclpy.node.Node``: parameters, a clock, publishers, subscriptions and timers that the test drives."""

    parameters = MappingProxyType({})
    now = 0

    def __init__(self, name):
        self.name, self.subscribed, self.published, self.timers, self.warnings = name, {}, [], [], []

    def declare_parameter(self, name, value):
        return SimpleNamespace(value=self.parameters.get(name, value))

    def create_publisher(self, kind, topic, depth):
        assert (kind, topic) == (Wrench, "force")
        return SimpleNamespace(publish=self.published.append)

    def create_subscription(self, kind, topic, callback, quality):
        assert kind is Odometry
        self.subscribed[topic] = callback

    def create_timer(self, period, callback):
        self.timers.append((period, callback))

    def get_clock(self):
        return SimpleNamespace(now=lambda: SimpleNamespace(nanoseconds=Node.now))

    def get_logger(self):
        return SimpleNamespace(warning=self.warnings.append)


@pytest.fixture
def example(monkeypatch):
    modules = {
        "rclpy": {}, "rclpy.node": {"Node": Node}, "rclpy.qos": {"qos_profile_sensor_data": 1},
        "geometry_msgs": {}, "geometry_msgs.msg": {"Wrench": Wrench}, "nav_msgs": {},
        "nav_msgs.msg": {"Odometry": Odometry},
    }  # fmt: skip
    for name, parts in modules.items():
        module = ModuleType(name)
        vars(module).update(parts)
        monkeypatch.setitem(sys.modules, name, module)
    spec = importlib.util.spec_from_file_location("ros2_controller", EXAMPLE)
    found = importlib.util.module_from_spec(spec)
    spec.loader.exec_module(found)
    return found


def test_robots_with_odometry_fly_the_law(example, monkeypatch):
    monkeypatch.setattr(Node, "parameters", {"agents": 3})
    start = fk.State([[0.0, 0.0], [2.0, 0.3], [0.5, 2.5]], [[0.1, 0.0], [0.0, 0.2], [-0.3, 0.0]])
    expected = fk.control(example.LAW, start)
    nodes = []
    for agent in range(3):
        monkeypatch.setattr(Node, "parameters", {"agents": 3, "agent": agent})
        nodes.append(example.FlockingNode())
    second = 10**9
    monkeypatch.setattr(Node, "now", 100 * second)
    assert [node.timers[0][0] for node in nodes] == [0.02] * 3
    for node in nodes:
        # Nothing is flown before the robot's own odometry is there.
        node.timers[0][1]()
        assert node.published == []
        for robot in range(3):
            # Odometry that comes late is older than what is known, and not used.
            for stamp, shift in ((100 * second, 0.0), (99 * second, 1.0)):
                node.subscribed[f"/robot_{robot}/odometry"](Odometry(stamp, start.q[robot] + shift, start.p[robot]))
        node.timers[0][1]()
    found = np.array([[node.published[-1].force.x, node.published[-1].force.y] for node in nodes])
    assert found == pytest.approx(expected, rel=1e-12)
    # Half a second later nothing is known of the others any more.
    monkeypatch.setattr(Node, "now", 100 * second + second // 2)
    nodes[0].subscribed["/robot_0/odometry"](Odometry(100 * second + second // 2, start.q[0], start.p[0]))
    nodes[0].timers[0][1]()
    assert (nodes[0].published[-1].force.x, nodes[0].published[-1].force.y) == (0.0, 0.0)
    assert nodes[0].warnings == []
    # Two robots at one place have no force: none is flown, and it is said.
    monkeypatch.setattr(Node, "now", 101 * second)
    for robot in (0, 1):
        nodes[0].subscribed[f"/robot_{robot}/odometry"](Odometry(101 * second, [1.0, 1.0], [0.0, 0.0]))
    nodes[0].timers[0][1]()
    assert (nodes[0].published[-1].force.x, nodes[0].published[-1].force.y) == (0.0, 0.0)
    assert "where the force of the law is finite" in nodes[0].warnings[0]


@pytest.mark.parametrize(("age", "flown"), [(0, True), (499, True), (500, False), (9000, False), (-20, False)])
def test_a_robot_whose_own_odometry_is_old_flies_no_force(age, flown, example, monkeypatch):
    """Its neighbours are as new as can be; a force from where it was once would be a wrong one."""
    monkeypatch.setattr(Node, "parameters", {"agents": 2})
    node, now = example.FlockingNode(), 100 * 10**9
    monkeypatch.setattr(Node, "now", now)
    node.subscribed["/robot_0/odometry"](Odometry(now - age * 10**6, [0.0, 0.0], [0.0, 0.0]))
    node.subscribed["/robot_1/odometry"](Odometry(now, [3.0, 0.0], [0.0, 0.0]))
    node.timers[0][1]()
    assert (node.published[-1].force.x != 0.0) == flown
    assert len(node.warnings) == (not flown)
    assert flown or "own odometry" in node.warnings[0]
