# Copyright 2026 Robot fish maintainers
# SPDX-License-Identifier: Apache-2.0
"""The verdict in one sentence: on the terminal, at the head of the page and in model.yaml."""

from __future__ import annotations

from typing import Any

from fish_sysid.diagnosis.vocabulary import candidates

Content = dict[str, Any]

NOTHING_BETTER = "model.yaml is the refitted nominal model: nothing that was found predicts held-out positions better."
MOST_NUMBERS = 4  # of an effect, each stated


def sentence(content: Content) -> str:
    """The verdict in one sentence, and in further ones whether trials were held out and the tail needed more links."""
    links = content["fit"]["tail_links"]
    symmetry = [e["statement"] for e in content["effects"] if by_symmetry(e)]
    aside = f"{'; '.join(symmetry)}; beside that " if symmetry else ""
    parts = [f"{aside[:1].upper()}{aside[1:]}{_verdict(content)}"]
    if not content["fit"]["held_out_trials"]:
        parts.append(
            "With fewer than three trials nothing could be held out: errors are of the trials that were fitted."
        )
    if links["given"] != links["used"]:
        parts.append(
            f"The tail is modelled with {links['used']} links instead of {links['given']}."
        )
    parts += _not_written(content)
    return " ".join(parts)


def _not_written(content: Content) -> list[str]:
    """What was found and is not in model.yaml, and why."""
    fit = content["fit"]
    if "holds" not in fit:
        return []
    tried = (fit.get("with_symmetry") or {"effects": []})["effects"]
    absent = [e for e in content["effects"] if e["name"] not in fit["holds"]]
    unknown = [e["name"] for e in absent if by_symmetry(e) and e["name"] not in tried]
    worse = [e["name"] for e in absent if e["name"] not in unknown]
    said = []
    if fit["written"] == "refitted" and content["verdict"] != "no_mismatch":
        worse, said = [], [NOTHING_BETTER]
    them, their = "them" if len(worse) > 1 else "it", "their" if len(unknown) > 1 else "its"
    parts = [f"{' and '.join(worse)}: with {them} positions are predicted worse"] if worse else []
    if unknown:
        parts.append(f"{' and '.join(unknown)}: not all of {their} numbers are known")
    return said + ([f"model.yaml is without {'; and without '.join(parts)}."] if parts else [])


def by_symmetry(effect: Content) -> bool:
    """Whether only a symmetry test finds an effect, and no fit of a model."""
    return bool(effect["evidence"].get("basis") == "symmetry")


def by_prediction(effect: Content) -> bool:
    """Whether predictions of trials left out ask for an effect."""
    return bool(effect["evidence"].get("basis") == "prediction")


def _verdict(content: Content) -> str:
    found = [e for e in content["effects"] if not by_symmetry(e)]
    if content["verdict"] != "unexplained" and found:
        return f"{content['verdict']}: the model lacks {' and '.join(_effect(e) for e in found)}."
    if content["verdict"] == "unexplained":
        nearest = ", ".join(content["unexplained"]["nearest"])
        aside = f" Without explaining most of it, {nearest} would help." if nearest else ""
        return (
            f"unexplained: {content['unexplained']['description']}.{aside}{_by_prediction(content)}"
        )
    return f"no_mismatch: {_nothing_found([entry['name'] for entry in content['ranking']])}"


def _by_prediction(content: Content) -> str:
    """What predictions of trials left out ask for; "" where nothing was judged by them."""
    named = [e for e in content["effects"] if by_prediction(e)]
    entries = named or content["unexplained"].get("by_prediction", [])
    if not entries:
        return ""
    said = f" Predictions of trials left out ask for {' and '.join(_asked(e) for e in entries)}"
    if named:
        return f"{said}; what is left after them has no name."
    return f"{said}; something else that the model lacks may stand behind that."


def _asked(effect: Content) -> str:
    rivals = "".join(f"; or {r['name']}" for r in effect.get("rivals", ()))
    cost = f"cost x {effect['evidence']['cost_ratio']:.2f}"
    return f"{effect['name']} ({_parameters(effect)}; {cost}{rivals})"


def _nothing_found(tried: list[str]) -> str:
    """Only where every name competed may it be said that nothing is missing: one that did not may be what is needed."""
    everything = len(set(tried) | set(candidates()))
    if len(tried) == everything:
        return "with refitted parameters the model explains these recordings; nothing is missing."
    if len(tried) == 1:
        needed = f"{tried[0]}, the one candidate tried (of {everything}), is not needed"
    else:
        needed = f"none of the {len(tried)} candidates tried (of {everything}) is needed"
    return f"with refitted parameters {needed}; of the others nothing is known."


def _effect(effect: Content) -> str:
    rivals = "".join(f"; or {r['name']}, {r['probability']:.2f}" for r in effect["rivals"])
    return f"{effect['name']} ({_parameters(effect)}; probability {effect['evidence']['probability']:.2f}{rivals})"


def _parameters(effect: Content) -> str:
    """All of them, or of many those that differ most surely from zero."""
    rows = [(k, p["value"], p["std"], p["unit"]) for k, p in effect["parameters"].items()]
    few = len(rows) <= MOST_NUMBERS
    parts = rows if few else sorted(rows, key=lambda row: -abs(row[1]) / row[2])[: MOST_NUMBERS - 1]
    text = ", ".join(f"{k} {value:.4g} ± {std:.2g} {unit}" for k, value, std, unit in parts)
    return text if few else f"{len(rows)} numbers, surest {text}"
