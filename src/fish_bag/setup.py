# Copyright 2026 Robot fish maintainers
# SPDX-License-Identifier: Apache-2.0
from glob import glob

from setuptools import find_packages, setup

NAME = "fish_bag"
VERBS = ("inspect", "recover", "import_pool")

setup(
    name=NAME,
    version="0.1.0",
    packages=find_packages(exclude=["test"]),
    data_files=[
        ("share/ament_index/resource_index/packages", ["resource/" + NAME]),
        ("share/" + NAME, ["package.xml"]),
        ("share/" + NAME + "/config", glob("config/*")),
    ],
    package_data={NAME: ["py.typed"]},
    install_requires=["setuptools"],
    zip_safe=False,
    maintainer="Robot fish maintainers",
    maintainer_email="maintainers@robot-fish.org",
    description="Recordings: recorder, replayer, reader, recovery, inspection, import of foreign recordings.",
    license="Apache-2.0",
    extras_require={"test": ["pytest"]},
    entry_points={
        "robofish.verbs": [f"{verb} = {NAME}.verbs.{verb}" for verb in VERBS],
        "console_scripts": [
            "recorder = fish_bag.nodes.entry:recorder",
            "replayer = fish_bag.nodes.entry:replayer",
            *(f"{verb} = fish_report.robofish:{verb}" for verb in VERBS),
        ],
    },
)
