# Copyright 2026 Robot fish maintainers
# SPDX-License-Identifier: Apache-2.0
"""What is wrong with a trial: sample flags and problems. Nothing is changed or removed here.

Two publishers on one topic show in values that jump between two sources.
"""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import fields

import numpy as np

from fish_bag.camera_checks import find_jumps
from fish_bag.decode import ABSENT_COLUMNS, JOINT_VALUES, ROLES
from fish_bag.decode import NOT_MEASURED as NOT_MEASURED_ARRAY
from fish_bag.problem import SEVERITIES, Problem
from fish_bag.streams import Decoded
from fish_bag.time_axis import ClockEstimate
from fish_bag.topic_map import TopicRule
from fish_bag.trial import (
    BAD_STAMP,
    DUPLICATE,
    JUMP,
    NOT_FINITE,
    NOT_MEASURED,
    TIME_BACK,
    UNREADABLE,
    WRONG_FRAME,
    Camera,
    Commands,
    Encoder,
    Stream,
)

GAP_PERIODS = 2.5  # a distance of more than so many periods is a gap
LONG_GAP_S = 0.5  # from here on a warning
STEP_BACK_S = 0.1  # a clock that is set back by more cuts a piece out of a swim
STEP_TOLD_S = 0.02  # smaller steps are not told from latencies that change
DAY_S = 86400.0  # a stamp so far from its arrival was never set
AROUND_S = 1.0  # before and after such a step; messages that arrive late make no second of it
AROUND = 10  # messages, where fewer come in that time
FEWEST_AFTER = 10  # messages at the end; fewer are late ones
SHORTEST = 0.1  # share of the latencies around a step that are below its shortest one; a busy network makes only others longer
CONSTANT = 1e-6  # a command that varies less is constant, rad/s or rad
OF_USE = {
    "imu": "warning",
    "encoder": "info",
}  # severity of the absence of topics that are not required

FLAG_TEXTS = {
    DUPLICATE: ("warning", "duplicate", "stamps repeat an earlier one"),
    TIME_BACK: ("warning", "time_back", "stamps are older than the one before"),
    NOT_FINITE: ("warning", "nan", "messages carry NaN, infinity or lack a value"),
    JUMP: ("warning", "jump", "poses lie far from those before and after"),
    BAD_STAMP: ("warning", "bad_stamp", "stamps are zero or far from the rest"),
    NOT_MEASURED: (
        "warning",
        "not_measured",
        "messages say by a covariance of -1 that gyro, accelerometer or pose are not measured; they are used nowhere",
    ),
    UNREADABLE: ("error", "unreadable", "messages cannot be decoded"),
}
FEWEST = 40  # samples in which two publishers would show
ALTERNATES = 2.0  # steps to the next sample against those to the one after it; 0.5 where values change steadily, 1 for noise
ALONE = 0.05  # share of commands that lie apart from both neighbours


def flag_samples(
    role: str,
    decoded: Decoded,
    rule: TopicRule,
    t: np.ndarray,
    plausible: np.ndarray,
    stamped: bool,
) -> np.ndarray:
    """(N,) uint16 flags of one topic's samples (bits of trial.py)."""
    flags = np.zeros(len(t), np.uint16)
    flags[~plausible] |= BAD_STAMP
    if stamped and decoded.stamp_ns is not None:
        first = np.unique(decoded.stamp_ns, return_index=True)[1]
        repeated = np.ones(len(t), bool)
        repeated[first] = False
        flags[repeated] |= DUPLICATE
    known = np.where(plausible, t, -np.inf)
    latest = np.concatenate([[-np.inf], np.maximum.accumulate(known)[:-1]])
    flags[plausible & (t < latest)] |= TIME_BACK
    for name, values in decoded.arrays.items():
        if name not in ROLES[role].optional:
            bad = ~np.isfinite(values).reshape(len(t), -1).all(axis=1)
            if NOT_MEASURED_ARRAY in decoded.arrays and name in ABSENT_COLUMNS:
                column = decoded.arrays[NOT_MEASURED_ARRAY][:, ABSENT_COLUMNS[name]]
                absent = column == 1
                flags[absent] |= NOT_MEASURED
                bad &= ~absent
            flags[bad] |= NOT_FINITE
    if rule.frame and decoded.frames is not None:
        flags[decoded.frames != rule.frame] |= WRONG_FRAME
    if ROLES[role].stream is Camera:
        flags[find_jumps(t, *(decoded.arrays[k] for k in ("x", "y", "psi")))] |= JUMP
    flags[decoded.unreadable] = UNREADABLE
    return flags


def check_stream(stream: Stream, rule: TopicRule, frames: np.ndarray | None) -> Iterator[Problem]:
    """Problems of one topic: flagged samples, frames (N,) of its messages if they have any, gaps."""
    for bit, (severity, kind, text) in FLAG_TEXTS.items():
        marked = stream.flags & bit > 0
        if bit == TIME_BACK:
            marked &= stream.flags & DUPLICATE == 0  # which is said already
        where = np.flatnonzero(marked)
        if len(where):
            what = f"{len(where)} of {len(stream)} {text}"
            yield Problem(
                severity, kind, stream.topic, what, len(where), float(stream.t_arrival[where[0]])
            )
    wrong = stream.flags & WRONG_FRAME > 0
    if frames is not None and wrong.any():
        other = ", ".join(map(repr, sorted(set(frames[wrong]))))
        text = f"{wrong.sum()} of {len(stream)} messages in frame {other}, expected {rule.frame!r}"
        yield Problem("error", "wrong_frame", stream.topic, text, int(wrong.sum()))
    yield from _gaps(stream)
    yield from _set_back(stream)


def check_joints(role: str, decoded: Decoded, rule: TopicRule) -> Iterator[Problem]:
    """Values of joints that no message has, as under other names."""
    severity = "error" if rule.required else "warning"
    for array, (joint, field) in JOINT_VALUES.get(role, {}).items():
        if not np.isfinite(decoded.arrays[array]).any():
            named = ", ".join(map(repr, decoded.joints[:8])) or "none"
            text = f"no message has a {field} of joint {joint!r}; joints that it names: {named}"
            yield Problem(severity, "joint", decoded.topic, text, len(decoded.arrival_ns))


def _gaps(stream: Stream) -> Iterator[Problem]:
    """Missing pieces of a topic that otherwise comes regularly."""
    t = np.sort(stream.t[stream.flags & (BAD_STAMP | DUPLICATE) == 0])
    if len(t) < 10:
        return
    step = np.diff(t)
    period = max(
        float(np.median(step)), float(step.mean()) / 3
    )  # the mean where messages come in bursts
    gaps = np.flatnonzero(step > GAP_PERIODS * period)
    if len(gaps):
        longest = float(step.max())
        lost = int(np.sum(np.round(step[gaps] / period) - 1))
        what = f"{len(gaps)} gaps, longest {longest:.3f} s"
        text = f"{what}, about {lost} messages at a period of {period * 1e3:.1f} ms"
        severity = "warning" if longest > LONG_GAP_S else "info"
        yield Problem(severity, "gap", stream.topic, text, len(gaps), float(t[gaps[0]]))


def _set_back(stream: Stream) -> Iterator[Problem]:
    """A clock that is set back: from then on messages arrive later after their stamps; single late messages pass."""
    delay = stream.t_arrival - stream.t
    kept = (stream.flags & UNREADABLE == 0) & (np.abs(delay) < DAY_S)
    arrival, delay = stream.t_arrival[kept], delay[kept]
    steps = np.diff(stream.t[kept])
    if not (steps < 0).any() or not (steps > 0).any():
        return
    period = float(np.median(steps[steps > 0]))
    found = []
    for first in (np.flatnonzero(steps < 0) + 1).tolist():
        start, end = np.searchsorted(arrival, arrival[first] + AROUND_S * np.array([-1, 1]))
        before = delay[max(min(start, first - AROUND), 0) : first]
        after = delay[first : max(end, first + AROUND)]
        later = min(np.median(after) - np.median(before), _shortest(after) - _shortest(before))
        if len(after) >= FEWEST_AFTER:
            found.append((float(min(later, period - steps[first - 1])), float(arrival[first])))
    by, at = max(found, default=(0.0, 0.0))
    if by > STEP_TOLD_S:
        severity = "error" if by > STEP_BACK_S else "warning"
        text = (
            f"the clock is set back by {by:.3f} s at {at:.2f} s; expected one that is never set back; "
            "let the time service slew it, and record again"
        )
        yield Problem(severity, "clock_back", stream.topic, text, t=at)


def _shortest(delay: np.ndarray) -> float:
    return float(np.quantile(delay, SHORTEST))


def missing(role: str, topic: str, required: bool) -> Iterator[Problem]:
    """A mapped topic that is not in the recording."""
    severity = "error" if required else OF_USE.get(role)
    if severity:
        yield Problem(
            severity, "missing_topic", topic, f"not in the recording; nothing known of {role}"
        )


def check_excitation(commands: Commands | None) -> Iterator[Problem]:
    """Commands that never change identify nothing."""
    if commands is None:
        return
    good = commands.flags & (NOT_FINITE | UNREADABLE) == 0
    for name, unit in (("rotor_speed", "rad/s"), ("rudder", "rad")):
        values = getattr(commands, name)[good]
        if len(values) and np.ptp(values) < CONSTANT:
            what = f"{name} is {values[0]:g} {unit} throughout"
            text = f"{what}: parameters that need it to vary cannot be determined"
            yield Problem(
                "warning" if name == "rotor_speed" else "info",
                "constant_command",
                commands.topic,
                text,
            )


def check_rotor_sign(commands: Commands | None, encoder: Encoder | None) -> Iterator[Problem]:
    """Encoder and command must turn the same way: a swapped sign means another robot or a wrong driver."""
    if commands is None or encoder is None:
        return
    c, e = commands.clean(), encoder.clean()
    if len(c) < 10 or len(e) < 10 or np.ptp(c.rotor_speed) < CONSTANT:
        return
    wanted = np.interp(e.t, c.t, c.rotor_speed)
    if np.std(wanted) and np.std(e.speed) and np.corrcoef(wanted, e.speed)[0, 1] < -0.5:
        yield Problem(
            "error",
            "rotor_sign",
            encoder.topic,
            "measured rotor speed runs against the command; expected the same sign",
        )


def check_clock(clock: ClockEstimate) -> Iterator[Problem]:
    """Clocks that were moved, and drift."""
    if clock.applied:
        text = (
            f"clock {clock.clock!r} stands {clock.offset_s:.6f} s (std {clock.offset_std_s:.1e}) and drifts "
            f"{clock.drift_ppm:.1f} ppm (std {clock.drift_std_ppm:.1f}) from the recorder's; times were moved"
        )
        yield Problem("info", "clock", "", text)
    elif clock.drift_is_significant and abs(clock.drift_ppm) > 20:
        drift = f"{clock.drift_ppm:.1f} ppm (std {clock.drift_std_ppm:.1f})"
        text = f"clock {clock.clock!r} drifts {drift}; not corrected"
        yield Problem("info", "clock", "", text)


def by_severity(problem: Problem) -> tuple[int, str]:
    """Sort key: errors first."""
    return -SEVERITIES.index(problem.severity), problem.topic


def check_publishers(stream: Stream) -> Iterator[Problem]:
    """A warning if the samples of a stream come from two sources."""
    usable = stream.take(np.flatnonzero(stream.flags & (NOT_FINITE | UNREADABLE) == 0))
    if len(usable) < FEWEST:
        return
    named = {
        field.name: getattr(usable, field.name)
        for field in fields(usable)
        if field.name not in ("t", "t_arrival", "flags", "covariance")
    }
    columns = {k: v for k, v in named.items() if isinstance(v, np.ndarray) and v.dtype.kind == "f"}
    jumping = [name for name, values in columns.items() if _jumps(values, name == "psi")]
    if isinstance(stream, Commands):
        jumping += [k for k, v in columns.items() if k not in jumping and _lies_alone(v)]
    if not jumping:
        return
    span = float(np.ptp(usable.t))
    rate = f"{(len(usable) - 1) / span:.0f} Hz" if span > 0 else "no rate"
    text = f"{', '.join(jumping)} jump between two sources at {rate}: do two nodes publish it?"
    yield Problem("warning", "two_publishers", stream.topic, text)


def _jumps(values: np.ndarray, angle: bool) -> bool:
    """Whether every other sample is of another source."""
    steps = [np.diff(values, axis=0), values[2:] - values[:-2]]
    if angle:
        steps = [np.mod(step + np.pi, 2 * np.pi) - np.pi for step in steps]
    near, far = (
        float(np.nanmean(np.abs(step))) if np.isfinite(step).any() else 0.0 for step in steps
    )
    return near > ALTERNATES * far and near > 0


def _lies_alone(values: np.ndarray) -> bool:
    """Whether single samples lie apart from neighbours that agree with each other."""
    middle, apart = 0.5 * (values[2:] + values[:-2]), np.abs(values[2:] - values[:-2])
    scale = 0.05 * float(np.nanstd(values))
    alone = np.abs(values[1:-1] - middle) > 5 * (apart + scale)
    return bool(np.mean(alone) > ALONE) and scale > 0
