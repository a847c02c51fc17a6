# Copyright 2026 Robot fish maintainers
# SPDX-License-Identifier: Apache-2.0
"""Which properties an element has: presentation attributes, style sheets and the style attribute (CSS cascade)."""

from __future__ import annotations

import re
from collections.abc import Collection
from dataclasses import dataclass
from xml.etree.ElementTree import Element

import svgelements

from fish_control.paths.svg.coordinates import pixels, ratio
from fish_control.reference_path import PathError

Style = dict[str, str]

INHERITED = (
    "visibility",
    "fill",
    "stroke",
    "fill-opacity",
    "stroke-opacity",
    "stroke-width",
    "stroke-dasharray",
    "color",
)
OWN = ("display", "opacity", "transform", "clip-path", "mask", "filter", "overflow")
GEOMETRY = ("d", "x", "y", "cx", "cy", "r", "rx", "ry", "width", "height")
UNREAD = (
    *GEOMETRY,
    *("transform-origin", "transform-box", "translate", "rotate", "scale", "offset-path", "zoom"),
    *("clip", "content-visibility", "all", "animation", "animation-name", "mask-image"),
)  # CSS that moves, shapes or hides what is drawn and that is not understood here
INITIAL: Style = {"fill": "black", "stroke": "none", "visibility": "visible", "color": "black"}

LONGEST_GAP = 0.1  # of a dashed line, of its length

_SELECTOR = re.compile(r"(\*|[\w-]+)?((?:[#.][\w-]+)*)")
_RULE = re.compile(r"([^{}]*)\{([^{}]*)\}")
_SERVER = re.compile(r"url\(\s*['\"]?#(.+?)['\"]?\s*\)\s*(.*)")
_ABSENT = ("none", "")
_BLACK = 0x000000FF
# colours with numbers; those of CSS Color 4, which svgelements does not know, have their transparency after a slash
_COLOURS = ("#", "rgb", "hsl", "hwb(", "lab(", "lch(", "oklab(", "oklch(", "color(")


@dataclass(frozen=True)
class Rule:
    """One selector of a style sheet with its declarations."""

    tag: str
    marks: tuple[str, ...]  # '#id' and '.class', all of which an element must have
    declared: Style
    weight: tuple[int, int, int, int]  # ids, classes, tag, place in the sheet: CSS's specificity

    def applies(self, element: Element) -> bool:
        """Whether the element is one that the selector means."""
        own = {"#" + element.get("id", "")}
        own |= {"." + name for name in element.get("class", "").split()}
        return self.tag in ("", "*", local_name(element)) and own.issuperset(self.marks)


def local_name(element: Element) -> str:
    """The tag without its namespace; empty for comments and processing instructions."""
    return element.tag.rsplit("}", 1)[-1] if isinstance(element.tag, str) else ""


def read_rules(root: Element, where: str) -> list[Rule]:
    """The rules of all style sheets, weakest first.

    Raises:
        PathError: a selector that is not understood, where it could hide or move something.

    """
    rules: list[Rule] = []
    for sheet in root.iter():
        if local_name(sheet) != "style" or sheet.get("type", "text/css").strip() != "text/css":
            continue
        text = re.sub(r"/\*.*?\*/|<!--|-->", " ", "".join(sheet.itertext()), flags=re.DOTALL)
        text = re.sub(r"@(charset|namespace)[^;]*;|@font-face\s*\{[^{}]*\}", " ", text)
        if "@" in text or sheet.get("media", "all").strip() not in ("all", "screen", ""):
            raise PathError(
                f"{where}: a style sheet with @ rules or media is not supported; use style attributes"
            )
        for selectors, body in _RULE.findall(text):
            declared = _declarations(body)
            for selector in selectors.split(","):
                rules += _rule(selector.strip(), declared, len(rules), where)
    return sorted(rules, key=lambda rule: rule.weight)


def _rule(selector: str, declared: Style, order: int, where: str) -> list[Rule]:
    match = _SELECTOR.fullmatch(selector)
    if not match or not selector:
        if set(declared) & {*INHERITED, *OWN, *UNREAD}:
            raise PathError(
                f"{where}: style sheet selector {selector!r} is not supported; use style attributes or classes"
            )
        return []
    marks = tuple(re.findall(r"[#.][\w-]+", match[2]))
    ids = sum(mark[0] == "#" for mark in marks)
    typed = int(match[1] not in (None, "*"))
    return [Rule(match[1] or "", marks, declared, (ids, len(marks) - ids, typed, order))]


def _declarations(text: str) -> Style:
    """Property and value; `!important` stays in the value."""
    pairs = (item.split(":", 1) for item in text.split(";") if ":" in item)
    return {key.strip().lower(): value.strip() for key, value in pairs}


def computed(element: Element, parent: Style, rules: list[Rule], where: str) -> Style:
    """The properties of an element, those inherited from `parent` included.

    Raises:
        PathError: CSS that moves, shapes or hides in a way that is not understood.

    """
    own = {key: element.get(key, "").strip() for key in (*INHERITED, *OWN) if key in element.attrib}
    sheets = [rule.declared for rule in rules if rule.applies(element)]
    sheets.append(_declarations(re.sub(r"/\*.*?\*/", " ", element.get("style", ""))))
    for important in (False, True):
        for declared in sheets:
            own |= {
                key: value.split("!")[0].strip()
                for key, value in declared.items()
                if ("!important" in value.replace(" ", "").lower()) == important
            }
    strange = sorted(set(own) & set(UNREAD)) + [
        key for key in (*INHERITED, *OWN) if "var(" in own.get(key, "")
    ]
    if strange or element.get("transform-origin"):
        named = strange[0] if strange else "transform-origin"
        raise PathError(
            f"{where}: the style property {named!r} is not supported; apply it in the drawing program"
        )
    style = {key: parent[key] for key in INHERITED if key in parent}
    for key in (*INHERITED, *OWN):
        value = own.get(key, "")
        if value == "inherit" and key in OWN:
            style[key] = parent.get(key, "")
        elif value and value not in ("inherit", "unset"):
            style[key] = INITIAL.get(key, "") if value == "initial" else value
    return style


def removed(style: Style, where: str) -> bool:
    """Whether neither the element nor anything in it is drawn."""
    if style.get("display", "").lower() == "none":
        return True
    return bool(style.get("opacity")) and ratio(style["opacity"], f"{where}: opacity") <= 0.0


def painted(style: Style, where: str, known: Collection[str]) -> bool:
    """Whether the element itself leaves a mark: visible, and filled or stroked with something not transparent.

    Args:
        known: ids of the drawing, for gradients and patterns.

    """
    if style.get("visibility", "visible").lower() in ("hidden", "collapse"):
        return False
    width = style.get("stroke-width") or "1"
    return _opaque("fill", style, where, known) or (
        _opaque("stroke", style, where, known)
        and pixels(width, f"{where}: stroke-width", 100.0) > 0.0
    )


def check_dashes(style: Style, lengths: list[float], where: str) -> None:
    """Take a dashed line for the line along its dashes; `lengths` are those of the outlines in the element's units.

    Raises:
        PathError: gaps that are longer than a part of the line, so that a viewer shows pieces or nothing.

    """
    given = style.get("stroke-dasharray", "none").lower()
    numbers = [part for part in re.split(r"[\s,]+", given) if part]
    if given in ("none", "") or style.get("stroke", "none").lower() == "none" or not lengths:
        return
    dashes = [pixels(number, f"{where}: stroke-dasharray", max(lengths)) for number in numbers]
    dashes *= 1 + len(dashes) % 2  # an odd number of them is repeated
    if not any(dashes) or min(dashes) < 0.0:  # then a viewer draws without dashes
        return
    if not any(dashes[::2]) or max(dashes[1::2]) > LONGEST_GAP * max(lengths):
        raise PathError(
            f"{where} has dashes {given!r} with gaps longer than a tenth of the line; draw it without dashes"
        )


def _opaque(paint: str, style: Style, where: str, known: Collection[str]) -> bool:
    opacity = style.get(f"{paint}-opacity") or "1"
    colour = style.get(paint, INITIAL[paint])
    if server := _SERVER.fullmatch(colour):  # without its gradient, what follows it is shown
        colour = "black" if server[1] in known else server[2] or "none"
    if colour.lower() == "currentcolor":
        colour = style.get("color", "black")
    if colour.lower() in _ABSENT or ratio(opacity, f"{where}: {paint}-opacity") <= 0.0:
        return False
    if alpha := re.search(r"/\s*([\d.]+%?)\s*\)$", colour):
        return ratio(alpha[1], f"{where}: {paint}") > 0.0
    return _alpha(colour, f"{where}: {paint}") > 0


def _alpha(colour: str, where: str) -> int:
    """Opacity of a colour, 0 to 255."""
    found = svgelements.Color(colour)
    unknown = found.value == _BLACK and colour.lower() != "black"  # svgelements takes it for black
    if unknown and not colour.lower().startswith(_COLOURS):
        raise PathError(
            f"{where} {colour[:40]!r} is no colour, so that nobody knows whether it is seen; give it a colour"
        )
    return 0 if found.alpha is None else int(found.alpha)
