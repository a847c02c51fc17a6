# Copyright 2026 Robot fish maintainers
# SPDX-License-Identifier: Apache-2.0
"""What a viewer draws of an SVG document: the visible shapes with their place on the page."""

from __future__ import annotations

import re
import xml.etree.ElementTree as ElementTree
from collections.abc import Iterator
from dataclasses import dataclass, field, replace
from pathlib import Path
from xml.etree.ElementTree import Element

import numpy as np
from numpy.typing import NDArray

from fish_control.paths.svg.coordinates import pixels, place, transform, viewbox_transform
from fish_control.paths.svg.outline import SHAPES, Viewport, outlines
from fish_control.paths.svg.part import NO_LINE, Clip, Part, read_clip
from fish_control.paths.svg.style import (
    INITIAL,
    Rule,
    Style,
    check_dashes,
    computed,
    local_name,
    painted,
    read_rules,
    removed,
)
from fish_control.reference_path import PathError

SVG = "http://www.w3.org/2000/svg"
GROUPS = ("g", "a", "svg", "switch", "use")
MOVING = ("animate", "animateTransform", "animateMotion", "set")
DEEPEST = 100  # nested elements
MOST_ELEMENTS = 100_000  # drawn, those of <use> counted each time
_HREF = ("href", "{http://www.w3.org/1999/xlink}href")


@dataclass(frozen=True)
class _Context:
    """What an element takes over from those around it."""

    matrix: NDArray[np.float64]
    viewport: Viewport
    style: Style = field(default_factory=lambda: dict(INITIAL))
    ids: tuple[str, ...] = ()
    clips: tuple[Clip, ...] = ()
    used: tuple[str, ...] = ()  # references being followed
    depth: int = 0


class _Document:
    """The tree of a file, its ids and its style sheets."""

    def __init__(self, file: Path, root: Element) -> None:
        self.where = str(file)
        self.rules: list[Rule] = read_rules(root, self.where)
        self.by_id: dict[str, Element] = {}
        self.drawn = 0
        for element in root.iter():
            self.by_id.setdefault(element.get("id", ""), element)

    def parts(self, element: Element, context: _Context) -> Iterator[Part]:
        """The visible shapes of an element and all in it, in the order in which they are painted."""
        tag = local_name(element)
        if (
            tag not in (*GROUPS, *SHAPES, *NO_LINE)
            or not _is_svg(element)
            or not _holds(element, self.where)
        ):
            return
        self.drawn += 1
        if context.depth > DEEPEST or self.drawn > MOST_ELEMENTS:
            raise PathError(
                f"{self.where}: more than {DEEPEST} nested or {MOST_ELEMENTS} drawn elements"
            )
        where = f"{self.where}: {_name(element)}"
        style = computed(element, context.style, self.rules, where)
        if removed(style, where):
            return
        if any(local_name(child) in MOVING for child in element):
            raise PathError(f"{where} is animated; draw one still line")
        inner = self._inner(element, replace(context, style=style, depth=context.depth + 1), where)
        if not np.linalg.det(inner.matrix):  # scaled to nothing
            return
        if tag in GROUPS:
            yield from self._children(element, inner, where)
        elif painted(style, where, self.by_id) and _has_content(element, inner.viewport, where):
            part = Part(
                element, inner.ids, _name(element), inner.matrix, inner.viewport, inner.clips, where
            )
            check_dashes(style, part.lengths(), where)
            yield part

    def _inner(self, element: Element, context: _Context, where: str) -> _Context:
        """The context with the element's own transform, id and clip path."""
        matrix = context.matrix @ transform(context.style.get("transform") or "", where)
        clips = context.clips
        for hides in ("mask", "filter"):
            if context.style.get(hides, "none").lower() not in ("none", ""):
                raise PathError(
                    f"{where} has a {hides}, whose look is not known here; remove it in the drawing program"
                )
        reference = context.style.get("clip-path", "none")
        if reference.lower() not in ("none", ""):
            clips += (read_clip(reference, self.by_id, matrix, context.viewport, where),)
        own = (element.get("id"),) if element.get("id") else ()
        return replace(
            context, matrix=matrix, clips=clips, ids=context.ids + tuple(filter(None, own))
        )

    def _children(self, element: Element, context: _Context, where: str) -> Iterator[Part]:
        tag = local_name(element)
        if tag == "use":
            yield from self._used(element, context, where)
            return
        if tag == "svg" and context.depth > 1:
            context = nested_viewport(element, element, context, where)
        children = list(element)
        if tag == "switch":  # the first child whose conditions hold
            children = [c for c in children if _is_svg(c) and _holds(c, self.where)][:1]
        for child in children:
            yield from self.parts(child, context)

    def _used(self, element: Element, context: _Context, where: str) -> Iterator[Part]:
        """What a <use> element shows: another element, moved by its x and y."""
        reference = next((element.get(key, "") for key in _HREF if element.get(key)), "")
        target = self.by_id.get(reference[1:]) if reference.startswith("#") else None
        if target is None or not reference[1:]:
            raise PathError(f"{where} shows {reference!r}, which is not in the drawing")
        if reference in context.used:
            raise PathError(f"{where} shows itself ({reference})")
        x = pixels(element.get("x") or "0", f"{where}: x", context.viewport[0])
        y = pixels(element.get("y") or "0", f"{where}: y", context.viewport[1])
        moved = context.matrix @ np.array([[1.0, 0.0, x], [0.0, 1.0, y], [0.0, 0.0, 1.0]])
        context = replace(context, matrix=moved, used=(*context.used, reference))
        if local_name(target) not in ("symbol", "svg"):
            yield from self.parts(target, context)
            return
        style = computed(target, context.style, self.rules, where)
        if removed(style, where):
            return
        context = replace(context, style=style, depth=context.depth + 1)
        context = nested_viewport(target, element, self._inner(target, context, where), where)
        for child in target:
            yield from self.parts(child, context)


def nested_viewport(element: Element, sized: Element, context: _Context, where: str) -> _Context:
    """The context in an inner <svg> or a <symbol>, whose width and height `sized` may give."""
    own = sized is element
    x, y = (
        pixels(element.get(key) or "0", f"{where}: {key}", context.viewport[i]) if own else 0.0
        for i, key in enumerate(("x", "y"))
    )
    width, height = (
        pixels(sized.get(key) or element.get(key) or "100%", f"{where}: {key}", context.viewport[i])
        for i, key in enumerate(("width", "height"))
    )
    matrix = context.matrix @ np.array([[1.0, 0.0, x], [0.0, 1.0, y], [0.0, 0.0, 1.0]])
    corners = place(matrix, np.array([[0.0, 0.0], [width, 0.0], [width, height], [0.0, height]]))
    shown = context.style.get("overflow", "hidden").lower() == "visible"
    inner, viewport = viewbox_transform(element, (width, height), where)
    clips = context.clips if shown else (*context.clips, Clip((corners,), "the frame around it"))
    return replace(context, matrix=matrix @ inner, viewport=viewport, clips=clips)


def read_parts(file: Path) -> tuple[list[Part], bool]:
    """The visible parts of a file, placed on its page [px, y down], and whether the page has a size.

    Raises:
        PathError: no SVG drawing, or one whose look cannot be judged here.

    """
    try:
        root = ElementTree.parse(file).getroot()
    except (
        ElementTree.ParseError,
        LookupError,
        ValueError,
    ) as error:  # the last two: an unknown encoding
        raise PathError(f"{file}: not an SVG drawing ({error})") from error
    if b"<?xml-stylesheet" in file.read_bytes():
        raise PathError(
            f"{file}: its style sheet stands in another file, which is not read; use style attributes"
        )
    if local_name(root) != "svg" or not _is_svg(root):
        raise PathError(
            f"{file}: not an SVG drawing (its first element is {root.tag!r}, expected svg)"
        )
    size, has_size = _page(root, str(file))
    matrix, viewport = viewbox_transform(root, size, str(file))
    parts = list(_Document(file, root).parts(root, _Context(matrix, viewport)))
    on_page = [part for part in parts if not part.is_outside(size)]
    return on_page or parts, has_size


def _page(root: Element, where: str) -> tuple[Viewport, bool]:
    """Width and height of the page [px], and whether they are the drawing's true size.

    A page with a viewBox but neither width nor height fills whatever window shows it: it has no size.
    """
    given = {
        key: pixels(text, f"{where}: {key} of the page")
        for key in ("width", "height")
        if (text := root.get(key, "").strip()) not in ("", "auto") and not text.endswith("%")
    }
    box = re.split(r"[\s,]+", root.get("viewBox", "").strip())
    if len(box) != 4:
        return (given.get("width", 0.0), given.get("height", 0.0)), True
    across, down = pixels(box[2], f"{where}: viewBox"), pixels(box[3], f"{where}: viewBox")
    if min(across, down, *given.values()) <= 0.0:
        raise PathError(f"{where}: the page has no width or no height, so nothing of it is shown")
    if not given:
        return (across, down), False
    width = given.get("width", given.get("height", 0.0) * across / down)
    return (width, given.get("height", width * down / across)), True


def _is_svg(element: Element) -> bool:
    """Whether it is of SVG's namespace, or of none."""
    return isinstance(element.tag, str) and element.tag in (
        local_name(element),
        f"{{{SVG}}}{local_name(element)}",
    )


def _holds(element: Element, where: str) -> bool:
    """Whether a viewer without extensions draws the element."""
    for condition in ("systemLanguage", "requiredFeatures"):
        if element.get(condition):
            raise PathError(
                f"{where}: {_name(element)} is shown by some viewers only; remove {condition}"
            )
    return not element.get("requiredExtensions", "").strip()


def _has_content(element: Element, viewport: Viewport, where: str) -> bool:
    """Whether a visible element has anything to show; a path without points has not."""
    tag = local_name(element)
    if tag == "text":
        return bool("".join(element.itertext()).strip())
    if tag == "path" and not element.get("d", "").strip():
        return False
    return tag in NO_LINE or bool(outlines(element, viewport, where))


def _name(element: Element) -> str:
    return (
        f"{local_name(element)} {element.get('id')!r}"
        if element.get("id")
        else f"{local_name(element)} without id"
    )
