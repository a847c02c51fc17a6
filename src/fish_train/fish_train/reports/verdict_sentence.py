"""The verdict in one sentence: on the terminal, at the head of the page and in model.yaml."""

from __future__ import annotations

from typing import Any

Content = dict[str, Any]

MOST_NUMBERS = 4  # of an effect, told one by one


def sentence(content: Content) -> str:
    """The verdict in one sentence, and in a second one whether the tail needed more links."""
    links = content["fit"]["tail_links"]
    if links["given"] == links["used"]:
        return _verdict(content)
    return f"{_verdict(content)} The tail is modelled with {links['used']} links instead of {links['given']}."


def _verdict(content: Content) -> str:
    found = content["effects"]
    if found:
        return f"{content['verdict']}: the model lacks {' and '.join(_effect(e) for e in found)}."
    if content["verdict"] == "unexplained":
        nearest = ", ".join(content["unexplained"]["nearest"])
        aside = f" Without explaining the most of it, {nearest} would help." if nearest else ""
        return f"unexplained: {content['unexplained']['description']}.{aside}"
    return "no_mismatch: with refitted parameters the model explains these recordings; nothing is missing."


def _effect(effect: Content) -> str:
    rivals = "".join(f"; or {r['name']}, {r['probability']:.2f}" for r in effect["rivals"])
    return f"{effect['name']} ({_parameters(effect)}; probability {effect['evidence']['probability']:.2f}{rivals})"


def _parameters(effect: Content) -> str:
    """All of them, or of many those that differ most surely from zero."""
    rows = [(k, p["value"], p["std"], p["unit"]) for k, p in effect["parameters"].items()]
    few = len(rows) <= MOST_NUMBERS
    told = rows if few else sorted(rows, key=lambda row: -abs(row[1]) / row[2])[: MOST_NUMBERS - 1]
    text = ", ".join(f"{k} {value:.4g} ± {std:.2g} {unit}" for k, value, std, unit in told)
    return text if few else f"{len(rows)} numbers, surest {text}"
