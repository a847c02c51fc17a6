# Copyright 2026 Robot fish maintainers
# SPDX-License-Identifier: Apache-2.0
"""Every constant of the fit and of the search for effects: value, unit and reason."""

from __future__ import annotations

# --- fit of one hypothesis -----------------------------------------------------------------------
# of theta in one Levenberg-Marquardt iteration: the model is linear about so far
LARGEST_STEP = 0.5
SMALL_GAIN = 0.05  # nats; an iteration that gains less has converged
COARSE_GAIN = 3.0  # nats; the same in an annealing stage, whose optimum the next stage moves anyway
FIRST_STEPS = 800  # grid points of 10 ms; eight seconds of a trial suffice to screen and to anneal

# --- noise ---------------------------------------------------------------------------------------
OPEN_GATE = 1e9  # squared normalised innovation: no measurement is left out
NOISE_GAIN = 3.0  # nats; a round of noise estimation and refit that gains less is the last
FAR_NOISE_GAIN = 100.0  # nats; after a round that gains more the noise is searched far away as well
SHORTEST_WRENCH, LONGEST_WRENCH = 0.02, 5.0  # s; a filter step is 0.01 s, a trial about 20 s
WRENCH_JUMPS = (0.25, 4.0)  # factors of the wrench's standard deviations, tried from far away
WRENCH_LADDER = (4.0, 16.0, 64.0)  # times those of usual water: a missing force is strong ...
WRENCH_TIMES = (0.2, 2.0)  # s, ... and fast or slow
INITIAL_WRENCH_LADDER = (1.0, *WRENCH_LADDER)  # before anything is fitted
ROUNDS = 5  # of noise estimation and refit at most
ROUNDS_IF_SUSPECT = 2  # where something is missing: more rounds move it into the noise
ROUND_ITERATIONS = 6  # of the refit in one round

# --- is the fit right? ---------------------------------------------------------------------------
# times the spectral density of usual water, the largest over surge, sway and yaw
RATIO_SUSPECT = 3.0  # a poor optimum, or something is missing
RATIO_REJECT = 30.0  # more than the roughest pool: something is missing
# rms of whitened innovations, 1 where model and noise are right
INNOVATION_RMS_SUSPECT = 1.2  # too large for the estimated noise: a poor optimum
INNOVATION_RMS_REJECT = 4.0  # no wrench explains it: the sensors are noisier, or the model is wrong

# --- annealing: (factor of the IMU's noise, most iterations) ---------------------------------------
CAMERA_STAGES = ((100.0, 25), (30.0, 25), (10.0, 15))  # the camera decides
IMU_STAGES = ((3.0, 15), (1.0, 15))  # up to the IMU's full weight
SCREENING_STAGES = ((100.0, 8), (30.0, 6), (10.0, 6))  # fewer iterations lose 2 % of a true gain
FINAL_ITERATIONS = 15  # with all parameters free, at the IMU's full weight
NOISE_ROUNDS, NOISE_ROUND_ITERATIONS = 2, 8  # of noise estimation and refit after the last stage
# held in the camera's stages: far from the optimum they imitate a wrong phase of the tail's swing
TAIL_INERTIAS = ("link_inertia_factor", "fin_inertia_factor")
HELD_AT = (0.0, 0.25, -0.25)  # of theta: values at which held parameters are tried
START_SPREAD, HOP_SPREAD = 0.2, 0.1  # of the logarithms: random starts, hops from the best of them
FEW_LINKS = 3  # a tail of so few has few optima

# --- screening -----------------------------------------------------------------------------------
STRENGTHS = (0.3, 1.0)  # typical strengths from which a candidate is tried
WEAK_STRENGTHS = (0.05, 0.3)  # where little is left: from far too strong no step leads back
START_STRENGTH = 0.3  # typical strengths of a new effect in a hypothesis
SCREENING_IMU_FACTOR = 10.0  # of the IMU's noise: there the likelihood has few optima
SCREENING_ITERATIONS = 6
POLISH_ITERATIONS = 4
STRENGTH_ITERATIONS = 3  # of strengths alone, in which a fit is nearly linear
PROMISING_PLACES = 3  # of the places tried for an effect, that are fitted
POLISHED = 8  # candidates that are fitted further
LARGE_EFFECT = 10  # parameters; an effect with more is held while others are screened

# --- forward selection ---------------------------------------------------------------------------
MOST_EFFECTS = 3  # more have not been told apart on twelve trials of 20 s
SHORTLIST, ANNEALED_SHORTLIST = 4, 2  # candidates that are refitted
# of the best gain and of the gain needed: whole trials gain more than short ones
WORTH_A_REFIT = 0.2
MOST_RESTARTS = 3  # screenings in a round, each from a better optimum of the base
POOR_BASE = 0.5  # share of the best candidate's gain that a restarted base reaches without it
FAIR_SHARE = 0.5  # of the gain on other trials that a true effect has in the mean
LOOK_ALIKES = (  # names that are easily taken for each other
    ("tip_slip", "wake_memory", "tail_joint_damping"),
    ("rudder_lag", "rudder_delay"),
    ("quadratic_drag", "dry_friction"),
    ("rudder_offset", "camera_heading_offset", "hull_asymmetry"),
    ("current", "nonuniform_current"),
)
SEARCH_TRIALS = 4  # the search's time is proportional to them; final fits use all training trials

# --- significance --------------------------------------------------------------------------------
# nats of innovations that are worth one nat of evidence: model errors too small for a name, and the
# search itself, make likelihood ratios too sure (docs: statistics)
TEMPER = 4.0
SMALLEST_GAIN = 0.001  # nats per scalar measurement; less is no physics worth a name
SMALLEST_CHECK = 10.0  # nats on the check trials, however little a true effect would gain there
SMALLEST_Z = 4.0  # standard errors between an effect's strength and neutral
PLAUSIBLE = 0.02  # probability below which a rival is not named
MOST_UNEXPLAINED = 0.5  # share of the mismatch; names that leave more are not stated
UNIDENTIFIABLE = 0.25  # of the prior's standard deviation: a refit would follow the prior
STILL = 1e-3  # rad, rad/s; a command that varies less excites nothing

# --- number of links -----------------------------------------------------------------------------
MORE_LINKS = (1, 2)  # beyond the robot's, that are tried
# of the best fit's process noise, and times that of usual water; with less than both the next number of links is tried
PROMISING_RATIO, PROMISING_NOISE = 0.5, 10.0

# --- cross-validation and residual regression ------------------------------------------------------
MOST_ITERATIONS, NEAR_GAIN = 20, 1.0  # to the optimum of all trials, far for a flow; nats
RIDGE = 1e-9  # of the diagonal, for terms that the recordings do not excite
MOST_TERMS = 4  # of a law
SMALLEST_TERM = 10.0  # nats where a term is chosen: beyond chi square in 1e-3 for 90 terms

# --- symmetry tests --------------------------------------------------------------------------------
FEWEST_TRIALS = 3  # of fewer a jackknife says nothing
NEARLY_COLLINEAR = 1e-3  # singular values of unit columns, relative; less is no direction
SMALLEST_SQUARE = 1e-12  # mean square of a left-out trial; less is rounding
SYMMETRY_LEVEL = 0.01  # p value of a left-out gain
# log gain of left-out trials: hidden flows had 1.85 to 2.34 with a fish of another simulator and 0.7 on
# a real one, data without a flow at most 0.06
SYMMETRY_GAIN = 0.5
SENSOR_GAIN = 0.1  # the same of scales and axes: 5 % of a rate are little beside its noise
SMALLEST_SCALE = 0.01  # data sheets promise no better
SMALLEST_ANGLE = 0.02  # rad; markers and boards are mounted no better
SMALLEST_DEAD_TIME = 0.02  # s, two grid points
# of a term that a black-box fish does not span; with less the data cannot tell
LEAST_OWN_SHARE = 0.1
LEAST_TURNING = 0.05  # rad/s, spread of the stroke-mean yaw rate; a straight swim has 0.02
LEAST_ACCELERATION = 0.03  # m/s^2, spread of windowed accelerations; an IMU's noise leaves 0.004
LEAST_SPEED = 0.02  # m/s, mean; a fish that hardly swims has no course
LEAST_SIDES = 0.05  # share of stroke means in which the rudder is left, and right
LEAST_NEAR_WALL = 0.05  # share of stroke means near a wall
LEAST_SPREAD = 0.3  # m, of places; a flow that varies needs several
