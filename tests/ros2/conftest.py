"""ROS cannot be installed with pip, so that a test in it is no part of the suite elsewhere."""

import importlib.util

collect_ignore = [] if importlib.util.find_spec("rclpy") else ["test_in_ros.py"]
