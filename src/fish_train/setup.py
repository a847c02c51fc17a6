from glob import glob
from pathlib import Path
from runpy import run_path

from setuptools import find_packages, setup

NAME = "fish_train"
VERBS = run_path(str(Path(__file__).parent / NAME / "commands" / "verbs.py"))["VERBS"]

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
    package_data={NAME: ["py.typed", "reports/*.j2", "training/c/*", "identify/c/*"]},
    install_requires=["setuptools"],
    zip_safe=False,
    maintainer="Robot fish maintainers",
    maintainer_email="maintainers@robot-fish.org",
    description="Offline package: recordings, identification, diagnosis, training, evaluation, reports.",
    license="Apache-2.0",
    extras_require={"test": ["pytest"]},
    entry_points={
        "console_scripts": [
            "fish_train = fish_train.commands.main:main",
            "recorder = fish_train.nodes.entry:recorder",
            "replayer = fish_train.nodes.entry:replayer",
            *(f"{verb} = fish_train.commands.main:{verb}" for verb in VERBS),
        ],
    },
)
