# Copyright 2026 Robot fish maintainers
# SPDX-License-Identifier: Apache-2.0
from glob import glob

from setuptools import find_packages, setup

NAME = "fish_description"

setup(
    name=NAME,
    version="0.1.0",
    packages=find_packages(exclude=["test"]),
    data_files=[
        ("share/ament_index/resource_index/packages", ["resource/" + NAME]),
        ("share/" + NAME, ["package.xml"]),
        *(
            ("share/" + NAME + "/" + folder, glob(folder + "/*"))
            for folder in ("config", "foxglove", "launch", "rviz", "urdf")
        ),
    ],
    package_data={NAME: ["py.typed"]},
    install_requires=["setuptools"],
    zip_safe=False,
    maintainer="Robot fish maintainers",
    maintainer_email="maintainers@robot-fish.org",
    description="The fish as URDF, its joint angles for robot_state_publisher, layouts for rviz and Foxglove.",
    license="Apache-2.0",
    extras_require={"test": ["pytest"]},
    entry_points={
        "console_scripts": ["joint_angles = fish_description.nodes.entry:joint_angles"],
    },
)
