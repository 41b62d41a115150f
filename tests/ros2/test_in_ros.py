"""The ROS 2 node in ROS; collected only where that is installed, see conftest.py."""

import numpy as np
import rclpy
from diagnostic_msgs.msg import DiagnosticArray
from std_msgs.msg import Float64MultiArray

from auv_fault_diagnosis.node import prepare
from auv_fault_env.fleet import Fleet
from training.rollouts import roll_out


def test_the_node_runs_in_ros():
    readings = roll_out(Fleet(1), [1], 20, schedules=[()], missions=[0.3]).observations[:, 0]
    rclpy.init(args=["--ros-args", "-p", "diagnoser:=gaussian_bank", "-p", "rate:=20.0"])
    try:
        node = rclpy.create_node("auv_fault_diagnosis")
        prepare(node)
        received = []
        node.create_subscription(DiagnosticArray, "/diagnostics", received.append, 10)
        sender = node.create_publisher(Float64MultiArray, "readings", 10)
        for row in readings:
            sender.publish(Float64MultiArray(data=np.asarray(row).tolist()))
            for _ in range(20):
                rclpy.spin_once(node, timeout_sec=0.01)
        assert received and received[-1].status[0].level == b"\x00"
    finally:
        rclpy.try_shutdown()
