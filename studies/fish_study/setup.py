# Copyright 2026 Robot fish maintainers
# SPDX-License-Identifier: Apache-2.0
from setuptools import find_packages, setup

NAME = "fish_study"
VERBS = ("prove", "paper")

setup(
    name=NAME,
    version="0.1.0",
    packages=find_packages(exclude=["test"]),
    data_files=[
        ("share/ament_index/resource_index/packages", ["resource/" + NAME]),
        ("share/" + NAME, ["package.xml"]),
    ],
    package_data={NAME: ["py.typed"]},
    install_requires=["setuptools"],
    zip_safe=False,
    maintainer="Robot fish maintainers",
    maintainer_email="maintainers@robot-fish.org",
    description="Blind studies of the diagnosis, a second plant, and the figures of the paper.",
    license="Apache-2.0",
    extras_require={"test": ["pytest"]},
    entry_points={
        "robofish.verbs": [f"{verb} = {NAME}.verbs.{verb}" for verb in VERBS],
        "console_scripts": [
            *(f"{verb} = fish_report.robofish:{verb}" for verb in VERBS),
        ],
    },
)
