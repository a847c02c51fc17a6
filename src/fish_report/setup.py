# Copyright 2026 Robot fish maintainers
# SPDX-License-Identifier: Apache-2.0
from setuptools import find_packages, setup

NAME = "fish_report"

setup(
    name=NAME,
    version="0.1.0",
    packages=find_packages(exclude=["test"]),
    data_files=[
        ("share/ament_index/resource_index/packages", ["resource/" + NAME]),
        ("share/" + NAME, ["package.xml"]),
    ],
    package_data={NAME: ["py.typed", "*.j2"]},
    install_requires=["setuptools"],
    zip_safe=False,
    maintainer="Robot fish maintainers",
    maintainer_email="maintainers@robot-fish.org",
    description="What people read and type: the command robofish, HTML pages, tables, JSON files, worker pools, user errors.",
    license="Apache-2.0",
    extras_require={"test": ["pytest"]},
    entry_points={
        "console_scripts": ["robofish = fish_report.robofish:main"],
    },
)
