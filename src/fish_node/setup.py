# Copyright 2026 Robot fish maintainers
# SPDX-License-Identifier: Apache-2.0
from setuptools import find_packages, setup

NAME = "fish_node"

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
    description="What every node does alike: parameters, help, a clean end, its state on the console.",
    license="Apache-2.0",
    extras_require={"test": ["pytest"]},
)
