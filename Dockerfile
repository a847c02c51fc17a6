# The whole suite on the full ROS 2 Jazzy (Ubuntu 24.04, amd64 and arm64).
#
#   docker build --tag robot-fish .
#   docker run --rm robot-fish robofish demo --letter I
#   docker run --rm --network host robot-fish ros2 launch fish_bringup fish.launch.py
FROM ros:jazzy-ros-base

SHELL ["/bin/bash", "-e", "-o", "pipefail", "-c"]

# gcc: the simulator compiles its equations when they are first used. Ubuntu keeps one version of a package, so none is pinned.
# hadolint ignore=DL3008
RUN apt-get update \
    && apt-get install --yes --no-install-recommends gcc libc6-dev python3-pip python3-venv \
    && rm -rf /var/lib/apt/lists/*

WORKDIR /robot_fish
COPY requirements-ros.txt requirements-diagnose.txt ./
RUN python3 -m venv --system-site-packages .venv \
    && .venv/bin/pip install --no-cache-dir --requirement requirements-ros.txt --requirement requirements-diagnose.txt

COPY src src
COPY colcon.meta ./
RUN apt-get update \
    && rosdep update \
    && rosdep install --from-paths src --ignore-src --default-yes --dependency-types exec --skip-keys \
        "casadi-pip python3-filterpy-pip python3-rosbags-pip python3-statsmodels-pip python3-torch" \
    && rm -rf /var/lib/apt/lists/*
RUN source /opt/ros/jazzy/setup.bash \
    && source .venv/bin/activate \
    && python -m colcon build \
    && ln --symbolic --force --no-dereference ../../src/fish_report/bin/robofish .venv/bin/robofish

COPY docker-entrypoint.sh /
ENTRYPOINT ["/docker-entrypoint.sh"]
CMD ["robofish", "--help"]
