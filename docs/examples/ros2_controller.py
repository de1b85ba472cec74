"""A ROS 2 node that flies the law of one robot: odometry of everyone in, force out, 50 times a second.

Start one on each robot: ``python ros2_controller.py --ros-args -p agent:=3 -p agents:=12``. The tests of this library
run it against a stand-in of the few parts of ``rclpy`` that it uses, not against ROS 2.
"""

import rclpy
from geometry_msgs.msg import Wrench
from nav_msgs.msg import Odometry
from rclpy.node import Node
from rclpy.qos import qos_profile_sensor_data

import flocking as fk
from flocking.errors import InvalidInput

EXPIRES = 0.5
"""Age in seconds from which odometry is not used, the robot's own as that of others."""

LAW = fk.Law(fk.Hysteresis(4.0, 0.5), [fk.Gradient(fk.Potential("1/r + 1/(R - r)", R=4.0)), fk.Consensus(0.7)])


def seconds(stamp):
    """Time of a stamp of ROS."""
    return stamp.sec + 1e-9 * stamp.nanosec


def motion(message):
    """Position and velocity in the plane, both in the frame of the header.

    Many drivers give the twist in the frame of the body: turn it first by the orientation of the pose.
    """
    place, speed = message.pose.pose.position, message.twist.twist.linear
    return [place.x, place.y], [speed.x, speed.y]


class FlockingNode(Node):
    """The controller of one robot."""

    def __init__(self):
        super().__init__("flocking")
        self.agent = self.declare_parameter("agent", 0).value
        count = self.declare_parameter("agents", 3).value
        # Forces are at most 5 N.
        self.controller = fk.Controller(LAW, self.agent, agents=count, mass=1.0, limit=5.0, expires=EXPIRES)
        self.newest = {}
        self.output = self.create_publisher(Wrench, "force", 1)
        for robot in range(count):
            self.create_subscription(
                Odometry, f"/robot_{robot}/odometry", lambda message, robot=robot: self.hear(robot, message),
                qos_profile_sensor_data,
            )  # fmt: skip
        self.create_timer(0.02, self.act)

    def hear(self, robot, message):
        """Keep the newest odometry of a robot."""
        known = self.newest.get(robot)
        if known is None or seconds(message.header.stamp) > seconds(known.header.stamp):
            self.newest[robot] = message

    def act(self):
        """Publish the force of the law now, or none and a warning where there is none."""
        own = self.newest.get(self.agent)
        if own is None:
            return
        now = self.get_clock().now().nanoseconds * 1e-9
        age = now - seconds(own.header.stamp)
        if not 0.0 <= age < EXPIRES:
            # Where the robot is now is not known, as when its estimator has stopped.
            self.get_logger().warning(f"own odometry is {age:.3g} s old: no force is flown")
            self.output.publish(Wrench())
            return
        # A stamp of another robot's clock may be ahead of this one's.
        others = {j: m for j, m in self.newest.items() if j != self.agent and seconds(m.header.stamp) <= now}
        motions = [motion(message) for message in others.values()]
        force = Wrench()
        try:
            u = self.controller(
                now, *motion(own), ids=list(others), q=[q for q, _ in motions], p=[p for _, p in motions],
                stamps=[seconds(message.header.stamp) for message in others.values()],
            )  # fmt: skip
            force.force.x, force.force.y = float(u[0]), float(u[1])
        except InvalidInput as error:
            self.get_logger().warning(str(error))
        self.output.publish(force)


def main():
    """Fly until the node is ended."""
    rclpy.init()
    node = FlockingNode()
    try:
        rclpy.spin(node)
    finally:
        node.destroy_node()
        rclpy.shutdown()


if __name__ == "__main__":
    main()
