# Copyright 2026 Robot fish maintainers
# SPDX-License-Identifier: Apache-2.0
"""SVG drawings: what a viewer shows is read, where it shows it; what cannot be judged is refused."""

import math

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from svg_renderer import arc, bezier, distance, matrix, placed

from fish_control.paths.svg import read_svg
from fish_control.reference_path import PathError

MM = 1e-3
LINE = 'd="m 40,60 h 60 v 30 h -40 v 40"'
CORNERS = np.array([[40, -60], [100, -60], [100, -90], [60, -90], [60, -130]]) * MM
PAGE = 'width="210mm" height="297mm" viewBox="0 0 210 297"'


def read(folder, body, page=PAGE, chosen=None):
    file = folder / "drawing.svg"
    file.write_text(
        f'<svg xmlns="http://www.w3.org/2000/svg" xmlns:xlink="http://www.w3.org/1999/xlink" {page}>{body}</svg>'
    )
    return read_svg(file, chosen)


def test_millimetres_are_true_and_y_points_up(tmp_path):
    np.testing.assert_allclose(read(tmp_path, f"<path {LINE}/>").points, CORNERS, atol=1e-9)


@pytest.mark.parametrize(
    ("page", "unit"),
    [
        ('width="96" height="96"', 25.4 / 96),
        ('width="2in" height="2in" viewBox="0 0 100 100"', 0.508),
        ('width="10cm" viewBox="0 0 100 200"', 1.0),
        ('height="10cm" viewBox="0 0 100 200"', 0.5),
        ('width="72pt" height="72pt" viewBox="0 0 4 4"', 6.35),
        ('width="100mm" height="200mm" viewBox="0 0 10 10" preserveAspectRatio="xMinYMin"', 10.0),
        ("", 25.4 / 96),
    ],
)
def test_the_pages_units_give_the_scale(tmp_path, page, unit):
    drawing = read(tmp_path, '<path d="M0 0 H3"/>', page)
    assert drawing.has_size
    assert np.ptp(drawing.points[:, 0]) == pytest.approx(3 * unit * MM, rel=1e-9)


def test_an_uneven_viewbox_is_stretched_as_it_says(tmp_path):
    page = 'width="100mm" height="300mm" viewBox="10 20 10 10" preserveAspectRatio="none"'
    points = read(tmp_path, '<path d="M10 20 L20 30"/>', page).points
    np.testing.assert_allclose(points, [[0, 0], [0.1, -0.3]], atol=1e-12)


@pytest.mark.parametrize(
    "hidden",
    [
        '<g style="display:none"><path d="M0 0 L5 5"/></g>',
        '<g display="none"><path d="M0 0 L5 5" style="display:inline"/></g>',
        '<path d="M0 0 L5 5" visibility="hidden"/>',
        '<g visibility="hidden"><path d="M0 0 L5 5"/></g>',
        '<g style="opacity:0"><g opacity="1"><path d="M0 0 L5 5" opacity="1"/></g></g>',
        '<path d="M0 0 L5 5" style="opacity:0%"/>',
        '<path d="M0 0 L5 5" fill="none"/>',
        '<path d="M0 0 L5 5" fill="none" stroke="black" stroke-width="0"/>',
        '<path d="M0 0 L5 5" fill="none" stroke="red" stroke-opacity="0"/>',
        '<path d="M0 0 L5 5" fill="transparent"/>',
        '<path d="M0 0 L5 5" fill="none" stroke="url(#absent)"/>',
        '<path d="M0 0 L5 5" fill="url(#absent) none" stroke="url(#absent) transparent"/>',
        '<path d="M0 0 L5 5" fill="rgba(0,0,0,0)" stroke="#12345600"/>',
        '<path d="M0 0 L5 5" fill="rgb(0 0 0 / 0)"/>',
        '<defs><path id="d" d="M0 0 L5 5"/></defs>',
        '<symbol><path d="M0 0 L5 5"/></symbol>',
        '<marker><path d="M0 0 L5 5"/></marker>',
        '<clipPath id="c"><path d="M0 0 L5 5"/></clipPath>',
        '<mask id="m"><path d="M0 0 L5 5"/></mask>',
        '<pattern><path d="M0 0 L5 5"/></pattern>',
        '<style>.a{display:none}</style><path class="a" d="M0 0 L5 5"/>',
        '<path class="b a" d="M0 0 L5 5"/><style>/* x */ .a , .z { display : none !important }</style>',
        '<style>#h{visibility:hidden} path{visibility:visible}</style><path id="h" d="M0 0 L5 5"/>',
        '<other xmlns="http://x"><path d="M0 0 L5 5"/></other>',
        '<g transform="scale(0)"><path d="M0 0 L5 5"/></g>',
        '<path transform="matrix(1 2 2 4 0 0)" d="M0 0 L5 5"/>',
        '<path d=""/>',
        '<path d="M5 5 Z"/>',
        "<text> </text>",
        '<g requiredExtensions="http://ns.adobe.com/x"><path d="M0 0 L5 5"/></g>',
        "<title>a</title><metadata><path d='M0 0 L5 5'/></metadata>",
    ],
)
def test_what_no_viewer_shows_is_not_swum(tmp_path, hidden):
    for body in (f"{hidden}<path {LINE}/>", f"<path {LINE}/>{hidden}"):
        np.testing.assert_allclose(read(tmp_path, body).points, CORNERS, atol=1e-9)
    with pytest.raises(PathError, match="no visible line"):
        read(tmp_path, hidden)


@pytest.mark.parametrize(
    "outside",
    ['<path d="M-20 5 L-10 200"/>', '<g transform="translate(0 300)"><path d="M5 5 L50 50"/></g>'],
)
def test_a_shape_outside_the_page_is_swum_only_if_none_is_on_the_page(tmp_path, outside):
    for body in (f"{outside}<path {LINE}/>", f"<path {LINE}/>{outside}"):
        np.testing.assert_allclose(read(tmp_path, body).points, CORNERS, atol=1e-9)
    assert len(read(tmp_path, outside).points) == 2


def test_the_pages_edge_cuts_nothing(tmp_path):
    points = read(tmp_path, '<path d="M-5 10 L5 20 L-5 30"/>').points
    np.testing.assert_allclose(points, np.array([[-5, -10], [5, -20], [-5, -30]]) * MM, atol=1e-9)


@pytest.mark.parametrize(
    "shown",
    [
        f'<g visibility="hidden"><path {LINE} visibility="visible"/></g>',
        f'<g fill="none" stroke="none"><path {LINE} style="stroke:#f00"/></g>',
        f'<style>path{{display:none}} .s{{display:inline}}</style><path class="s" {LINE}/>',
        f'<style>.s{{display:none}}</style><path class="s" style="display:inline" {LINE}/>',
        f'<defs><path id="p" {LINE}/></defs><use xlink:href="#p"/>',
        '<defs><path id="p" d="m 30,50 h 60 v 30 h -40 v 40"/></defs><use href="#p" x="10" y="10"/>',
        f'<symbol id="s"><path {LINE}/></symbol><use href="#s"/>',
        f'<symbol id="s" viewBox="0 0 105 148.5"><path transform="scale(.5)" {LINE}/></symbol><use href="#s"/>',
        f'<switch><foreignObject requiredExtensions="http://a"/><g><path {LINE}/></g><path d="M0 0H9"/></switch>',
        f'<svg x="0" y="0"><path {LINE}/></svg>',
        '<svg x="30" y="50" width="100" height="100"><path d="m 10,10 h 60 v 30 h -40 v 40"/></svg>',
        '<polyline points="40,60 100,60,100,90 60,90 60 130"/>',
        '<polyline transform="translate(100-10)" points="-60,70,0+70,0,100-40,100-40 140"/>',
        f'<linearGradient id="l"/><path {LINE} fill="none" stroke="url(#l)"/>',
        f'<path {LINE} fill="url(#absent) oklch(0.5 0.1 20)"/>',
        f'<path {LINE} marker-end="url(#a)" clip-path="none"/>',
        f'<clipPath id="c"><rect x="0" y="0" width="210" height="297"/></clipPath><g clip-path="url(#c)"><path {LINE}/></g>',
        f'<path {LINE} fill="none" stroke="red" style="stroke-dasharray:4,2"/>',
        f'<g stroke="red" stroke-dasharray="1"><path {LINE} fill="none"/></g>',
        f'<path {LINE} fill="none" stroke="red" stroke-dasharray="0 0"/>',
        f'<path {LINE} stroke-dasharray="0 900"/>',
        f'<a><path {LINE} stroke="currentColor" fill="none" color="blue"/></a>',
    ],
)
def test_what_a_viewer_shows_is_swum(tmp_path, shown):
    np.testing.assert_allclose(read(tmp_path, shown).points, CORNERS, atol=1e-9)


@pytest.mark.parametrize(
    ("body", "said"),
    [
        (
            f'<path id="one" {LINE}/><path id="two" d="M150 200 L160 220"/>',
            r"2 visible parts \(path 'one', path 'two'\)",
        ),
        (f'<path {LINE}/><text id="t">R</text>', r"2 visible parts \(path without id, text 't'\)"),
        (f'<path {LINE}/><image href="a.png"/>', "2 visible parts"),
        ("<text>R</text>", "text has no line to swim; turn it into a path"),
        ('<path d="M0 0 L1 1 M2 2 L3 3"/>', "2 parts; a fish cannot lift off"),
        ('<path d="M0 0 L1 0 L1 1 Z M5 5 L6 6"/>', "2 parts"),
        ('<path d="M0 0 L1 0 L1 1 z l2 2"/>', "2 parts"),
        ('<path d="M0 0 L1"/>', "command 'L' has 1 numbers and then 'the end', expected 2"),
        ('<path d="M0 0 L1 0 L1 1 Z 5 5"/>', "'5' in the outline, expected one of M L"),
        ('<path d="M0 0 B1 1"/>', "'B1' in the outline"),
        ('<path d="M0 0 A1 1 0 2 0 2 2"/>', "command 'A' has 3 numbers and then '2'"),
        ('<path d="M0 0 V"/>', "command 'V' has 0 numbers and then 'the end'"),
        ('<path d="Z"/>', "begins with 'Z', expected M"),
        ('<path d="L1 1 L2 2"/>', "begins with 'L1 1 L2 2', expected M"),
        (
            '<path d="M0 0 L10% 0"/>',
            "command 'L' has 1 numbers and then '%', expected 2 numbers",
        ),
        ('<path d="M0 0 L1e999 0"/>', "coordinate 1e999 is not finite"),
        ('<path transform="scale(1e9)" d="M0 0 H1e300 V1e300"/>', "coordinates that are too large"),
        ('<polyline points="0,0 10px,0"/>', "'10px' among them, expected pairs of numbers"),
        ('<polyline points="0,0 10,0 3"/>', "points have 5 numbers, expected pairs"),
        ('<polyline points=""/>', "0 points; 2 are needed"),
        ('<rect width="2em" height="1"/>', "width is '2em', expected a number in px, mm"),
        (f'<path transform="rotate(a)" {LINE}/>', "transform 'rotate\\(a\\)' is not one of matrix"),
        (f'<path transform="turn(90)" {LINE}/>', "'turn\\(90\\)'"),
        (f'<path transform="scale(1 2 3)" {LINE}/>', "'scale\\(1 2 3\\)'"),
        (f'<path transform="translate(10mm, 5)" {LINE}/>', "translate"),
        (f'<path style="transform-origin: 5px" {LINE}/>', "'transform-origin' is not supported"),
        (f'<path mask="url(#m)" {LINE}/>', "has a mask"),
        (f'<path style="filter:url(#f)" {LINE}/>', "has a filter"),
        (f'<path {LINE}><animate attributeName="d"/></path>', "is animated"),
        (
            f"<style>g > path{{display:none}}</style><path {LINE}/>",
            "selector 'g > path' is not supported",
        ),
        (f"<style>g path{{stroke:none;fill:none}}</style><path {LINE}/>", "selector 'g path'"),
        (f"<style>@media print{{path{{display:none}}}}</style><path {LINE}/>", "@ rules"),
        (f'<style>.a{{d:path("M0 0")}}</style><path class="a" {LINE}/>', "'d' is not supported"),
        ('<use href="#none"/>', "'#none', which is not in the drawing"),
        ('<use href="other.svg#a"/>', "not in the drawing"),
        ('<g id="g"><use href="#g"/></g>', "shows itself"),
        (
            f'<clipPath id="c"><rect width="50" height="297"/></clipPath><path clip-path="url(#c)" {LINE}/>',
            "cut off by the clip path",
        ),
        (
            f'<clipPath id="c"><path d="M0 0H50V80H60V0H200V200H0Z"/></clipPath><path clip-path="url(#c)" {LINE}/>',
            "cut off by the clip path",
        ),
        (f'<svg width="50" height="50"><path {LINE}/></svg>', "cut off by the frame"),
        (f'<path {LINE} stroke="red" stroke-dasharray="5 90"/>', "gaps longer than a tenth"),
        (f'<path {LINE} stroke="red" pathLength="1" stroke-dasharray=".4"/>', "gaps longer"),
        (f'<path {LINE} stroke="red" stroke-dasharray="0 5"/>', "draw it without dashes"),
        (f'<path fill="none" stroke="context-stroke" {LINE}/>', "'context-stroke' is no colour"),
        (f'<switch><path requiredFeatures="x" d="M0 0H1"/><path {LINE}/></switch>', "some viewers"),
        (f'<path clip-path="circle(3px)" {LINE}/>', "not supported; release the clip"),
        (f'<path systemLanguage="de" {LINE}/>', "systemLanguage"),
        ('<path opacity="much" d="M0 0H1"/>', "opacity is 'much'"),
    ],
)
def test_what_cannot_be_swum_or_judged_is_refused(tmp_path, body, said):
    with pytest.raises(PathError, match=said):
        read(tmp_path, body)


@pytest.mark.parametrize(
    ("content", "said"),
    [
        ("not xml", "not an SVG drawing"),
        ('<?xml version="1.0" encoding="mine"?><svg/>', "not an SVG drawing"),
        ('<?xml-stylesheet href="a.css"?><svg/>', "style sheet stands in another file"),
        ("<html><svg/></html>", "its first element is 'html'"),
        ('<svg width="0" height="5" viewBox="0 0 1 1"/>', "no width or no height"),
        (
            '<svg width="5" height="5" viewBox="0 0 1"/>',
            "viewBox is '0 0 1', expected four numbers",
        ),
        ('<svg width="wide" height="5"/>', "width of the page is 'wide'"),
    ],
)
def test_a_file_that_is_no_drawing_is_refused(tmp_path, content, said):
    file = tmp_path / "x.svg"
    file.write_text(content)
    with pytest.raises(PathError, match=said):
        read_svg(file)


def test_a_part_is_chosen_by_its_id_or_its_groups(tmp_path):
    body = f'<g id="layer1"><path id="line" {LINE}/></g><g id="layer2"><path d="M0 0H9"/><path d="M0 5H9"/></g>'
    for chosen in ("line", "layer1"):
        np.testing.assert_allclose(read(tmp_path, body, chosen=chosen).points, CORNERS, atol=1e-9)
    with pytest.raises(PathError, match="2 visible parts"):
        read(tmp_path, body, chosen="layer2")
    with pytest.raises(PathError, match="no visible part with id 'layer3'; visible: path 'line'"):
        read(tmp_path, body, chosen="layer3")


def test_a_hidden_part_cannot_be_chosen(tmp_path):
    with pytest.raises(PathError, match="no visible part with id 'h'"):
        read(tmp_path, f'<path id="h" display="none" d="M0 0H1"/><path {LINE}/>', chosen="h")


@pytest.mark.parametrize(
    ("body", "closed", "length"),
    [
        ('<path d="M0 0 H10 V10 z z"/>', True, 20 + 10 * math.sqrt(2)),
        ('<polygon points="0,0 10,0 10,10"/>', True, 20 + 10 * math.sqrt(2)),
        ('<line x1="1" y1="1" x2="4" y2="5" stroke="black"/>', False, 5.0),
        ('<rect x="1" y="2" width="10" height="5"/>', True, 30.0),
        ('<rect width="10" height="6" rx="2"/>', True, 32 - 16 + 4 * math.pi),
        ('<rect width="50%" height="10%"/>', True, 2 * (105 + 29.7)),
        ('<circle cx="5" cy="5" r="4"/>', True, 8 * math.pi),
        ('<ellipse cx="5" cy="5" rx="4" ry="4"/>', True, 8 * math.pi),
        ('<path d="M0 0 A 0 5 0 0 0 3 4"/>', False, 5.0),
        ('<path d="M0,0a4 4 0 108 0"/>', False, 4 * math.pi),
    ],
)
def test_every_shape_is_as_long_as_it_is(tmp_path, body, closed, length):
    drawing = read(tmp_path, body)
    points = np.vstack([drawing.points, drawing.points[:1]]) if closed else drawing.points
    assert drawing.closed == closed
    drawn = np.hypot(*np.diff(points, axis=0).T).sum()
    assert drawn == pytest.approx(length * MM, rel=2e-5)


def test_commands_absolute_and_relative_draw_the_same(tmp_path):
    absolute = read(
        tmp_path,
        '<path d="M1 2 L4 2 H6 V5 C7 6 8 6 9 5 S11 4 12 5 Q13 7 14 5 T16 5 A2 1 30 0 1 18 6"/>',
    )
    relative = read(
        tmp_path, '<path d="m1,2 3,0 h2 v3 c1 1 2 1 3 0 s2-1 3 0 q1 2 2 0 t2 0 a2 1 30 0 1 2 1"/>'
    )
    np.testing.assert_allclose(absolute.points, relative.points, atol=1e-12)


def test_smooth_commands_mirror_only_a_curve_of_their_kind(tmp_path):
    t = np.linspace(0.0, 1.0, 101)
    smooth = read(
        tmp_path, '<path d="M0 0 C0 20 10 20 10 0 S20 -20 20 0 Q25 9 30 0 S 35 5 40 0 T 50 0"/>', ""
    ).points
    truth = np.vstack(
        [
            bezier([(0, 0), (0, 20), (10, 20), (10, 0)], t),
            bezier([(10, 0), (10, -20), (20, -20), (20, 0)], t),
            bezier([(20, 0), (25, 9), (30, 0)], t),
            bezier(
                [(30, 0), (30, 0), (35, 5), (40, 0)], t
            ),  # no cubic before: its own start is the control point
            bezier([(40, 0), (40, 0), (50, 0)], t),
        ]
    ) * [25.4 / 96 * MM, -25.4 / 96 * MM]
    assert distance(truth, smooth) < 1e-6


NUMBERS = st.integers(-400, 400).map(lambda k: k / 10.0)
SIZES = st.integers(2, 30).map(lambda k: k / 10.0)
TRANSFORMS = st.one_of(
    st.tuples(
        st.just("matrix"),
        st.tuples(
            SIZES,
            NUMBERS.map(lambda v: v / 100),
            NUMBERS.map(lambda v: v / 100),
            SIZES,
            NUMBERS,
            NUMBERS,
        ),
    ),
    st.tuples(st.just("translate"), st.tuples(NUMBERS, NUMBERS)),
    st.tuples(st.just("scale"), st.tuples(SIZES, SIZES.map(lambda v: -v))),
    st.tuples(st.just("rotate"), st.tuples(NUMBERS)),
    st.tuples(st.just("rotate"), st.tuples(NUMBERS, NUMBERS, NUMBERS)),
    st.tuples(st.just("skewX"), st.tuples(NUMBERS)),
    st.tuples(st.just("skewY"), st.tuples(NUMBERS)),
)
POINT = st.tuples(NUMBERS, NUMBERS)
CURVES = st.one_of(
    st.tuples(st.just("L"), POINT),
    st.tuples(st.just("Q"), POINT, POINT),
    st.tuples(st.just("C"), POINT, POINT, POINT),
    st.tuples(st.just("A"), st.tuples(SIZES, SIZES), NUMBERS, st.booleans(), st.booleans(), POINT),
)


def drawn(start, curves):
    """The d attribute and dense true points of random curves."""
    t = np.linspace(0.0, 1.0, 61)
    d, points, here = f"M {start[0]},{start[1]}", [np.array([start], float)], start
    for kind, *values in curves:
        if kind == "A":
            radii, turned, large, sweep, end = values
            d += f" A {radii[0]} {radii[1]} {turned} {int(large)}{int(sweep)} {end[0]},{end[1]}"
            points.append(
                arc(here, radii, turned, large, sweep, end, t) if end != here else np.array([end])
            )
        else:
            d += f" {kind} " + " ".join(f"{x},{y}" for x, y in values)
            points.append(bezier([here, *values], t))
        here = values[-1]
    return d, np.vstack(points)


@pytest.fixture(scope="module")
def folder(tmp_path_factory):
    return tmp_path_factory.mktemp("drawings")


@settings(max_examples=150, deadline=None, derandomize=True)
@given(
    start=POINT,
    curves=st.lists(CURVES, min_size=1, max_size=4),
    groups=st.lists(st.lists(TRANSFORMS, max_size=3), max_size=3),
    margins=st.tuples(SIZES, SIZES, SIZES, SIZES),
)
def test_random_transforms_agree_with_an_independent_renderer(
    folder, start, curves, groups, margins
):
    d, points = drawn(start, curves)
    body = f'<path d="{d}"/>'
    for calls in reversed(groups):
        text = " ".join(f"{name}({' '.join(map(str, values))})" for name, values in calls)
        body = f'<g transform="{text}">{body}</g>'
    calls = [matrix(*call) for calls in groups for call in calls]
    inside = placed(calls, points)
    x, y = (inside.min(axis=0) - margins[:2]).tolist()
    width, height = (inside.max(axis=0) + margins[2:] - [x, y]).tolist()
    page = f'width="100mm" height="100mm" viewBox="{x} {y} {width} {height}" preserveAspectRatio="none"'
    scale = matrix("scale", (100 * MM / width, 100 * MM / height))
    matrices = [matrix("scale", (1.0, -1.0)), scale, matrix("translate", (-x, -y))]
    truth = placed([*matrices, *calls], points)
    size = np.ptp(truth, axis=0).max()
    if size < 1e-12:
        with pytest.raises(PathError, match="no visible line"):
            read(folder, body, page)
        return
    read_points = read(folder, body, page).points
    assert distance(truth, read_points) <= 1e-4 * size + 1e-9
    np.testing.assert_allclose(read_points[[0, -1]], truth[[0, -1]], atol=1e-6 * size + 1e-9)


@settings(max_examples=150, deadline=None, derandomize=True)
@given(d=st.text(alphabet="MmLlHhVvCcSsQqTtAaZz0123456789.,-+eE %", max_size=40))
def test_any_outline_is_finite_points_or_refused(folder, d):
    try:
        points = read(folder, f'<path d="M{d}"/>').points
    except PathError:
        return
    assert np.isfinite(points).all()
