# Copyright 2026 Robot fish maintainers
# SPDX-License-Identifier: Apache-2.0
from glob import glob

from setuptools import find_packages, setup

NAME = "fish_vision"
VERBS = ("calibrate", "track")

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
    package_data={NAME: ["py.typed", "verbs/picking_page.html"]},
    install_requires=["setuptools"],
    zip_safe=False,
    maintainer="Robot fish maintainers",
    maintainer_email="maintainers@robot-fish.org",
    description="Overhead-camera tracker: calibration, HSV segmentation, markers to pose.",
    license="Apache-2.0",
    extras_require={"test": ["pytest"]},
    entry_points={
        "robofish.verbs": [f"{verb} = {NAME}.verbs.{verb}" for verb in VERBS],
        "console_scripts": [
            "tracker = fish_vision.nodes.entry:tracker",
            "calibrate = fish_vision.verbs.calibrate:main",
            "track = fish_report.robofish:track",
            "check_image = fish_vision.check_image:main",
        ],
    },
)
