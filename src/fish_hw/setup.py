# Copyright 2026 Robot fish maintainers
# SPDX-License-Identifier: Apache-2.0
from glob import glob

from setuptools import find_packages, setup

NAME = "fish_hw"

setup(
    name=NAME,
    version="0.1.0",
    packages=find_packages(exclude=["test"]),
    data_files=[
        ("share/ament_index/resource_index/packages", ["resource/" + NAME]),
        ("share/" + NAME, ["package.xml"]),
        ("share/" + NAME + "/config", glob("config/*")),
        ("share/" + NAME + "/launch", glob("launch/*")),
        ("share/" + NAME + "/system", glob("system/*")),
    ],
    package_data={NAME: ["py.typed"]},
    install_requires=["setuptools"],
    zip_safe=False,
    maintainer="Robot fish maintainers",
    maintainer_email="maintainers@robot-fish.org",
    description="Hardware drivers: rotor (Vertiq), rudder servo, IMU (BNO085) and USB camera.",
    license="Apache-2.0",
    extras_require={"test": ["pytest"]},
    entry_points={
        "console_scripts": [
            "rotor = fish_hw.nodes.entry:rotor",
            "rudder = fish_hw.nodes.entry:rudder",
            "imu = fish_hw.nodes.entry:imu",
            "camera = fish_hw.nodes.entry:camera",
            "fake_robot = fish_hw.nodes.entry:fake_robot",
            "safe_stop = fish_hw.safe_stop:main",
        ],
    },
)
