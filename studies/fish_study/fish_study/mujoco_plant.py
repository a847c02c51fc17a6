# Copyright 2026 Robot fish maintainers
# SPDX-License-Identifier: Apache-2.0
"""The second plant: a fish in MuJoCo. No code and no equation is shared with fish_sim.

    Water: the engine's ellipsoid fluid model (added mass, blunt, slender and angular drag, Kutta lift) on every body. No point
    of the tail is held: the fin grips the water by its own added mass, drag and lift.
    Tail: a servo horn and five elastic joints, the last link carries the fin. Rudder: position servo with limited torque and
    rate. Rotor: a wheel in the head on a velocity motor. Integrator: implicitfast, 0.5 ms; the fish moves in the plane.
MuJoCo (https://mujoco.org) is an optional dependency (requirements-bench.txt).
"""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

import numpy as np
from numpy.typing import NDArray

from fish_sim.water_push import WaterPush
from fish_study.scenario import Scenario, ScenarioError
from fish_study.swim import Inertial, SensorErrors

Array = NDArray[np.float64]

PERIOD, HOLDS, STEPS = 0.01, 4, 5  # s; set-points in it, steps of the engine for each of them
TAIL_LENGTH, FIN_LENGTH, HALF_HEIGHT = 0.07, 0.03, 0.0375  # m
SERVO_RATE, SERVO_RANGE = 6.0, 0.8  # rad/s, rad
VISCOSITY = 9e-4  # Pa s
# blunt, slender, angular drag, Kutta lift, Magnus force. The engine's drag opposes the velocity, whatever the direction of a
# body, and drives nothing; thrust is the fin's lift. Chosen so that the fish swims at 0.05 to 0.25 m/s.
FLUID = {"head": "0.5 0.3 0.3 0.5 0", "link": "0.3 0.05 0.1 0 0", "fin": "0.5 0.01 0.1 40 0"}
FIN_LIFT = 4  # index of the Kutta lift in the engine's numbers of a geom
# a body without an ellipsoid in the water would get drag from a box as large as its inertia
DRY = '<geom type="sphere" size="0.001" mass="0" fluidshape="ellipsoid" fluidcoef="0 0 0 0 0"/>'
STRIP, HEAD_WATER = 4.4, 0.55  # kg/m of tail and fin, kg: water moved sideways
RAIL = 15.0  # rad/s, of the entrained water along its body
NOMINAL = {
    "tail_stiffness": 0.10,  # N m/rad, of three equal joints
    "rotor_inertia": 1.0e-4,  # kg m^2
    "head_inertia": 2.4e-3,  # kg m^2, that of the water included
}


class MujocoError(ScenarioError):
    """The plant cannot be had or has become unstable; the message says which."""


def _mujoco() -> Any:
    try:
        import mujoco
    except ImportError as error:
        raise MujocoError(
            "the second plant needs mujoco: pip install -r requirements-bench.txt"
        ) from error
    return mujoco


def model_text(
    links: int, factors: Mapping[str, float], effects: Mapping[str, Mapping[str, float]]
) -> str:
    """The fish in MuJoCo's language. factors: on NOMINAL; effects: of `mujoco_effects.CONCEALED`."""
    value = {name: size * factors.get(name, 1.0) for name, size in NOMINAL.items()}
    wind = effects.get("wind", {"x": 0.0, "y": 0.0})
    thickness = effects.get("viscosity", {"factor": 1.0})["factor"]
    damping = 2e-5 + effects.get("joint_damping", {"c": 0.0})["c"]
    loss = effects.get("joint_friction", {"loss": 0.0})["loss"]
    lag = effects.get("servo_filter")
    dynamics = f'dyntype="filterexact" dynprm="{lag["time"]}"' if lag else ""
    weight = effects.get("ballast") or {"mass": 1e-6, "forward": 0.0, "left": 0.0}
    length, stiffness = TAIL_LENGTH / links, value["tail_stiffness"] * links / 3.0
    joint = (
        f'<joint axis="0 0 1" stiffness="{stiffness}" damping="{damping}" frictionloss="{loss}"/>'
    )
    fin = _shape("fin", FIN_LENGTH, 0.001, 0.02, -length) + _entrained(
        STRIP * FIN_LENGTH, -length - FIN_LENGTH / 2.0
    )
    tail = fin
    for _ in range(links):
        shape = _shape("link", length, 0.008, 0.05 / links, 0.0) + _entrained(
            STRIP * length, -length / 2.0
        )
        tail = f'<body pos="{{at}} 0 0">{joint}{shape}{tail}</body>'.replace(
            "{at}", f"{-length}", 1
        )
    tail = tail.replace(
        f'pos="{-length} 0 0"', 'pos="0 0 0"', 1
    )  # the first link begins at the horn
    return f"""
<mujoco>
  <option timestep="{PERIOD / HOLDS / STEPS}" gravity="0 0 0" integrator="implicitfast" density="1000"
    viscosity="{VISCOSITY * thickness}" wind="{wind["x"]} {wind["y"]} 0"><flag contact="disable"/></option>
  <default><geom contype="0" conaffinity="0"/></default>
  <worldbody>
    <body name="head">
      <joint name="x" type="slide" axis="1 0 0"/><joint name="y" type="slide" axis="0 1 0"/><joint name="heading" axis="0 0 1"/>
      <inertial pos="0 0 0" mass="0.465" diaginertia="{value["head_inertia"]} {value["head_inertia"]} {value["head_inertia"]}"/>
      <geom type="ellipsoid" size="0.075 0.03 {HALF_HEIGHT}" fluidshape="ellipsoid" fluidcoef="{FLUID["head"]}" mass="0"/>
      <site name="imu"/>
      <body name="rotor"><joint name="rotor" axis="0 0 1"/>
        <inertial pos="0 0 0" mass="0.001" diaginertia="1e-4 1e-4 {value["rotor_inertia"]}"/>{DRY}</body>
      <body name="ballast" pos="{weight["forward"]} {weight["left"]} 0">{DRY}
        <inertial pos="0 0 0" mass="{weight["mass"]}" diaginertia="1e-9 1e-9 1e-9"/></body>
      {_entrained(HEAD_WATER, 0.0)}
      <body name="horn" pos="-0.075 0 0"><joint name="rudder" axis="0 0 1" damping="0.002"/>
        <inertial pos="0 0 0" mass="0.002" diaginertia="2e-6 2e-6 2e-6"/>{DRY}{tail}</body>
    </body>
  </worldbody>
  <actuator>
    <velocity joint="rotor" kv="0.05"/>
    <general joint="rudder" gainprm="4" biastype="affine" biasprm="0 -4 -0.04" forcerange="-0.6 0.6" {dynamics}/>
  </actuator>
  <sensor><gyro site="imu"/><accelerometer site="imu"/></sensor>
</mujoco>
"""


def _entrained(mass: float, at: float) -> str:
    """Water that a body moves sideways and not ahead: a mass on a rail along the body, held by a spring and a damper.

    The engine's fluid forces know velocities only; this is how they come to have inertia.
    """
    return (
        f'<body pos="{at} 0 0"><joint type="slide" axis="1 0 0" stiffness="{mass * RAIL**2}" damping="{2.0 * mass * RAIL}"/>'
        f'<inertial pos="0 0 0" mass="{mass}" diaginertia="1e-9 1e-9 1e-9"/>{DRY}</body>'
    )


def _shape(kind: str, length: float, half_width: float, mass: float, at: float) -> str:
    """An ellipsoid that reaches backwards by `length` from `at`; the fin has its kind as name."""
    name = 'name="fin"' if kind == "fin" else ""
    return (
        f'<geom {name} type="ellipsoid" pos="{at - length / 2} 0 0" size="{length / 2} {half_width} {HALF_HEIGHT}" mass="{mass}" '
        f'fluidshape="ellipsoid" fluidcoef="{FLUID[kind]}"/>'
    )


class MujocoPlant:
    """`count` equal fish."""

    def __init__(
        self, text: str, count: int, noise: float, random: np.random.Generator, trim: float = 0.0
    ) -> None:
        self._engine = _mujoco()
        self._model = self._engine.MjModel.from_xml_string(text)
        self._data = [self._engine.MjData(self._model) for _ in range(count)]
        self._random, self._water, self._trim = random, WaterPush.usual(noise), trim
        joints = [self._model.joint(name) for name in ("rotor", "rudder")]
        self._rotor, self._rudder = (int(j.qposadr[0]) for j in joints)
        self._head, self._fin = self._model.body("head").id, self._model.geom("fin").id
        self._lift = float(self._model.geom_fluid[self._fin, FIN_LIFT])
        self.reset(np.zeros((count, 3)))

    @classmethod
    def of(cls, scenario: Scenario, count: int, random: np.random.Generator) -> MujocoPlant:
        """The plant of a scenario."""
        trim = scenario.effects.get("servo_trim", {"angle": 0.0})["angle"]
        return cls(
            model_text(scenario.links, scenario.parameters, scenario.effects),
            count,
            scenario.noise,
            random,
            trim,
        )

    def reset(self, poses: Array) -> None:
        """Afloat at (M, 3) poses with a straight tail, at rest in the water, which carries the fish along.

        Not at rest over ground: with water from behind at the start the fish swims on backwards, as the fin's lift knows no
        trailing edge. From here it swims in any steady wind as in still water, seen from the water.
        """
        for data, pose in zip(self._data, poses, strict=True):
            self._engine.mj_resetData(self._model, data)
            data.qpos[:3], data.qvel[:2] = pose, self._model.opt.wind[:2]
        self._unstable = np.zeros(len(poses), dtype=bool)
        self._at = np.zeros((len(poses), 2))  # rotor speed, rudder that the drivers ask for
        self._push = self._water.first(self._random.standard_normal((len(poses), 3)))

    def step(self, commands: Array) -> Inertial:
        """One period: the drivers' set-points move linearly to the commands, the rudder's at most at the servo's rate.

        Raises MujocoError when a fish has become unstable, after all others have swum this period too: its motion is NaN from
        then on, and who can do without it may go on.
        """
        before = self._unstable.copy()
        target = np.clip(commands[:, 1], -SERVO_RANGE, SERVO_RANGE)
        reach = SERVO_RATE * PERIOD
        goal = np.column_stack(
            [commands[:, 0], self._at[:, 1] + np.clip(target - self._at[:, 1], -reach, reach)]
        )
        felt = np.array([self._step_one(m, self._at[m], goal[m]) for m in range(len(self._data))])
        self._at = goal
        self._push = self._water.after(self._push, self._random.standard_normal(self._push.shape))
        if (self._unstable & ~before).any():
            raise MujocoError("the engine became unstable")
        return Inertial(*felt.T)

    def _step_one(self, m: int, start: Array, goal: Array) -> tuple[float, float, float]:
        if self._unstable[m]:
            return np.nan, np.nan, np.nan
        data = self._data[m]
        cos, sin = np.cos(data.qpos[2]), np.sin(data.qpos[2])
        X, Y, N = self._push[m]
        data.xfrc_applied[self._head, :2] = X * cos - Y * sin, X * sin + Y * cos
        data.xfrc_applied[self._head, 5] = N
        for j in range(1, HOLDS + 1):
            rotor, alpha = start + (goal - start) * (j / HOLDS)
            data.ctrl[:] = rotor, -(alpha + self._trim)
            self._set_lift(data)
            self._engine.mj_step(self._model, data, STEPS if j > 1 else 1)
            if j == 1:  # the engine's sensors speak of the start of the last step
                felt = (
                    float(data.sensordata[2]),
                    float(data.sensordata[3]),
                    float(data.sensordata[4]),
                )
                self._engine.mj_step(self._model, data, STEPS - 1)
        # the engine warns and puts an unstable fish back to its start
        self._unstable[m] = not np.isfinite(data.qpos).all() or data.warning.number.any()
        return felt

    def _set_lift(self, data: Any) -> None:
        """The fin lifts while water comes from ahead of it alone: water from behind leaves no sharp edge and does not follow it.

        The engine's lift knows no trailing edge: with it a fish that is pushed backwards at the start swims on backwards.
        """
        motion = np.zeros(6)
        self._engine.mj_objectVelocity(
            self._model, data, self._engine.mjtObj.mjOBJ_GEOM, self._fin, motion, 1
        )
        direction = data.geom_xmat[self._fin].reshape(3, 3)[:, 0]
        ahead = motion[3] - self._model.opt.wind @ direction
        self._model.geom_fluid[self._fin, FIN_LIFT] = self._lift if ahead > 0.0 else 0.0

    @property
    def pose(self) -> Array:
        """(M, 3)."""
        return np.array([data.qpos[:3] for data in self._data])

    @property
    def motion(self) -> Array:
        """(M, 6): pose, surge, sway [m/s], yaw rate [rad/s]; NaN of fish that became unstable."""
        rows = []
        for data in self._data:
            x, y, heading = data.qpos[:3]
            vx, vy, rate = data.qvel[:3]
            cos, sin = np.cos(heading), np.sin(heading)
            rows.append([x, y, heading, cos * vx + sin * vy, cos * vy - sin * vx, rate])
        return np.where(self._unstable[:, None], np.nan, np.array(rows))

    @property
    def rotor_speed(self) -> Array:
        """(M,) rad/s, of the wheel against the head."""
        return np.array([data.qvel[self._rotor] for data in self._data])


def sensor_errors(scenario: Scenario) -> SensorErrors:
    """Of the scenario's sensors."""
    return SensorErrors(latency=scenario.effects.get("image_age", {"delay": 0.0})["delay"])
