# Copyright 2026 Robot fish maintainers
# SPDX-License-Identifier: Apache-2.0
"""A comparison in diagnosis.json, in a sentence, and as a robot."""

from __future__ import annotations

import math
from collections.abc import Mapping
from typing import Any

from fish_sim.robot import Robot
from fish_sysid.diagnosis.change.change import Change, Member, Named
from fish_sysid.diagnosis.next_experiment import next_experiment
from fish_sysid.diagnosis.symmetry.outcome import (
    nowhere,
    parameters_entry,
    stated,
    symmetry_entry,
    with_findings,
)
from fish_sysid.diagnosis.vocabulary import kind_of, separating
from fish_sysid.estimation.parametrization import effect_class

Entry = dict[str, Any]
SURE = 0.9  # probability from which one member of a family is named alone
LEAST_SAID = 0.001  # p-value
SURVIVES = 0.05  # p-value of a remainder above which it looks like exchanged trials


def answer(change: Change) -> Entry:
    """The dictionary written to diagnosis.json."""
    effects = [_effect(named) for named in change.named]
    shares = sum(named.gain for named in change.named) or 1.0
    for entry, named in zip(effects, change.named, strict=True):
        entry["share"] = named.gain / shares
    return {
        "verdict": verdict(change),
        "effects": effects,
        "symmetry": symmetry_entry(change.symmetry),
        "change": {
            "verdict": change.verdict,
            "reason": change.reason,
            "p_value": change.p_value,
            "look": change.look,
            "named": [named.name for named in change.named],
            "remainder_p_value": change.remainder_p_value,
            "survivors": [
                m.name
                for named in change.named
                for m in named.members
                if m.remainder_p_value > SURVIVES
            ],
            "suspects": list(change.suspects),
            "refused": list(change.refused),
        },
        "unexplained": {"share": math.nan, "where": {}, "description": remainder(change)},
        "next_experiment": _next_experiment(change),
        "sentence": sentence(change),
        "left_out": list(change.left_out),
    }


def verdict(change: Change) -> str:
    """no_mismatch, missing_physics, sensor_or_actuator or unexplained, of the change alone."""
    if change.verdict != "changed":
        return "no_mismatch" if change.verdict == "unchanged" else "unexplained"
    if not change.named:
        return "unexplained"
    kinds = {kind_of(named.name) for named in change.named}
    return "missing_physics" if "physics" in kinds else "sensor_or_actuator"


def chance(p_value: float) -> str:
    """A p-value in words; a few hundred exchanges with the tail of their null say no more than that it is below 0.001."""
    return f"p < {LEAST_SAID}" if p_value < LEAST_SAID else f"p = {p_value:.2g}"


def sentence(change: Change) -> str:
    """What changed, in words."""
    if change.verdict == "not_comparable":
        return f"NEW and OLD cannot be compared: {change.reason}"
    lacks = in_every_recording(change)
    if change.verdict == "unchanged":
        return (
            "Nothing changed that these recordings show: exchanged trials differ as much "
            f"({chance(change.p_value)}).{lacks}"
        )
    if not change.named:
        return f"The fish changed ({chance(change.p_value)}), and no name explains it: {remainder(change)}.{lacks}"
    parts = [_words(named) for named in change.named]
    return f"Since OLD the fish has {' and '.join(parts)} ({chance(change.p_value)}). {_left(change)}{lacks}"


def _left(change: Change) -> str:
    if change.suspects:
        return f"Something else changed too: {remainder(change)}."
    p_value = chance(change.remainder_p_value)
    if change.remainder_p_value > SURVIVES:
        return f"What is left looks like exchanged trials ({p_value})."
    return f"What is left is more than most exchanged trials show, and too little to be named ({p_value})."


def remainder(change: Change) -> str:
    """What of the change has no name."""
    if change.verdict == "not_comparable":
        return "not known: NEW and OLD cannot be compared"
    if not change.suspects:
        return "nothing of the change"
    return f"most alike are {', '.join(change.suspects)}, and none of them explains it"


def in_every_recording(change: Change) -> str:
    """What OLD shows already, by tests that need no model of the fish."""
    changed = {named.name for named in change.named}
    found = stated(change.symmetry)
    both = [f.statement for f in found if f.name not in changed]
    told = [f" OLD as well as NEW: {'; '.join(both)}."] if both else []
    old = [f.statement for f in found if f.name in changed]
    return "".join([*told, f" OLD had: {'; '.join(old)}." if old else ""])


def _words(named: Named) -> str:
    values = ", ".join(
        f"{key} {estimate}" for key, estimate in named.members[0].refitted.parameters.items()
    )
    text = f"{named.name} ({values or 'how much, the model cannot say'})"
    others = [m.name for m in named.members[1:]]
    if named.members[0].probability >= SURE:
        return text
    if not others:
        chance_of_it = f"probability {named.members[0].probability:.2f}"
        return f"{text} or something that has no name ({chance_of_it} for {named.name})"
    family = f" ({named.family})" if named.family else ""
    return f"{text} or, which these recordings cannot tell apart{family}, {', '.join(others)}"


def _effect(named: Named) -> Entry:
    first = named.members[0]
    return {
        "name": first.name,
        "kind": kind_of(first.name),
        "equation": effect_class(first.name).equation,
        "parameters": parameters_entry(first.refitted.parameters),
        "evidence": {
            "basis": "baseline",
            "log_likelihood_gain": math.nan,
            "left_out_gain": named.gain,
            "left_out_gain_std": named.gain_std,
            "p_value": math.nan,
            "probability": first.probability,
        },
        "share": math.nan,
        "rivals": [{"name": m.name, "probability": m.probability} for m in named.members[1:]],
        "family": {
            "name": named.family,
            "members": [
                {
                    "name": m.name,
                    "probability": m.probability,
                    "parameters": parameters_entry(m.refitted.parameters),
                    "remainder_p_value": m.remainder_p_value,
                }
                for m in named.members
            ],
        },
        "where": nowhere(),
    }


def _next_experiment(change: Change) -> Entry:
    """The manoeuvre that separates the members of the first family; none where the days cannot be compared."""
    if change.verdict == "not_comparable":
        return {"program": [], "why": change.reason}
    apart = separating([[m.name for m in named.members] for named in change.named])
    return apart or next_experiment([named.name for named in change.named], [])


def changed_robot(change: Change) -> Robot:
    """OLD's best model with the change, and with what symmetry tests find in OLD.

    Raises ValueError where OLD was not fitted.
    """
    if change.robot is None:
        raise ValueError("got a comparison without a model of OLD; expected one that was made")
    robot = with_findings(change.robot, change.symmetry)
    if change.camera_delay > 0.0:
        robot = robot.with_effect("camera_latency", delay=change.camera_delay)
    for named in change.named:
        if named.members[0].refitted.parameters:
            robot = with_change(robot, named.members[0])
    return robot


def with_change(robot: Robot, member: Member) -> Robot:
    """The robot with one more effect; an effect that it has already is changed by as much."""
    effect = effect_class(member.name, robot.table)
    had: Mapping[str, float] = {**robot.effects, **robot.sensors}.get(member.name, {})
    values = {}
    for key, parameter in effect.parameters.items():
        found = member.refitted.parameters.get(key)
        change = 0.0 if found is None else found.value - parameter.value
        value = had.get(key, parameter.value) + change
        values[key] = float(min(max(value, parameter.lowest), parameter.highest))
    return robot.with_effect(member.name, **values)
