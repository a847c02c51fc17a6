# Copyright 2026 Robot fish maintainers
# SPDX-License-Identifier: Apache-2.0
from glob import glob

from setuptools import find_packages, setup

NAME = "fish_control"

setup(
    name=NAME,
    version="0.1.0",
    packages=find_packages(exclude=["test"]),
    data_files=[
        ("share/ament_index/resource_index/packages", ["resource/" + NAME]),
        ("share/" + NAME, ["package.xml"]),
        ("share/" + NAME + "/config", glob("config/*")),
        ("share/" + NAME + "/launch", glob("launch/*")),
    ],
    package_data={NAME: ["py.typed"]},
    install_requires=["setuptools"],
    zip_safe=False,
    maintainer="Robot fish maintainers",
    maintainer_email="maintainers@robot-fish.org",
    description="Kalman fusion, reference paths, line-of-sight planner and PID with learned gains.",
    license="Apache-2.0",
    extras_require={"test": ["pytest"]},
    entry_points={
        "console_scripts": [
            "fusion = fish_control.nodes.entry:fusion",
            "planner = fish_control.nodes.entry:planner",
            "controller = fish_control.nodes.entry:controller",
            "pilot = fish_control.nodes.entry:pilot",
            "exciter = fish_control.nodes.entry:exciter",
        ],
    },
)
