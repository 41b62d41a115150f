"""Diagnosis of propulsion faults as a ROS 2 node; `monitor` is the part that needs no ROS."""
