# Copyright 2026 Robot fish maintainers
# SPDX-License-Identifier: Apache-2.0
from glob import glob

from setuptools import find_packages, setup

NAME = "fish_bringup"
VERBS = (
    "demo",
    "score",
    "latency",
    "excite",
    "arm",
    "disarm",
    "view",
    "drive",
    "loopback",
)

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
    package_data={NAME: ["py.typed", "*.html"]},
    install_requires=["setuptools"],
    zip_safe=False,
    maintainer="Robot fish maintainers",
    maintainer_email="maintainers@robot-fish.org",
    description="Starts the robot: node table, process starter, launch files, demo, score, excite.",
    license="Apache-2.0",
    extras_require={"test": ["pytest"]},
    entry_points={
        "robofish.verbs": [f"{verb} = {NAME}.verbs.{verb}" for verb in VERBS],
        "console_scripts": [
            "live_view = fish_bringup.nodes.entry:live_view",
            *(f"{verb} = fish_report.robofish:{verb}" for verb in VERBS),
        ],
    },
)
