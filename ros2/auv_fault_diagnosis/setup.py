"""The ROS 2 package, for `colcon build`."""

from setuptools import setup

NAME = "auv_fault_diagnosis"
SHARE = f"share/{NAME}"

setup(
    name=NAME,
    version="0.1.0",
    packages=[NAME],
    data_files=[
        ("share/ament_index/resource_index/packages", [f"resource/{NAME}"]),
        (SHARE, ["package.xml"]),
        (f"{SHARE}/launch", ["launch/diagnosis.launch.py"]),
        (f"{SHARE}/config", ["config/parameters.yaml"]),
    ],
    install_requires=["setuptools", "auv-fault"],
    zip_safe=True,
    description="Diagnoses propulsion faults of an autonomous underwater vehicle.",
    license="MIT",
    entry_points={"console_scripts": [f"diagnosis = {NAME}.node:main"]},
)
