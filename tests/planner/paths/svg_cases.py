# ruff: noqa: E501
"""Drawings in pairs that show the same, and drawings of which something is not read, one a line."""

from __future__ import annotations

import numpy as np

_NS = 'xmlns="http://www.w3.org/2000/svg" xmlns:xlink="http://www.w3.org/1999/xlink"'
_L = '<path d="M 0 0 h 600 v 300"/>'
_CM60 = 'width="1200mm" height="600mm" viewBox="0 0 1200 600"'
_PX = 'viewBox="0 0 600 400"'
_ROCK = '<rect x="250" y="50" width="100" height="100"/>'
_TURNED = '<rect x="250" y="50" width="100" height="100" transform="rotate(45)"/>'
_LINE = '<path d="M 0 0 L 30 40"/>'
_HIDDEN = '<path d="M 0 0 L 9 9"/>'


def svg(body: str, root: str = _PX, before: str = "") -> str:
    """Write a drawing."""
    return f"{before}<svg {_NS} {root}>{body}</svg>"


# What is drawn, and how it can be drawn without what is tried
ALIKE = [
    *[(svg(_L, root), svg(_L, _CM60)) for root in (
        'width="1200mm" viewBox="0 0 1200 600"', 'width="1200mm" height="100%" viewBox="0 0 1200 600"',
        'height="600mm" viewBox="0 0 1200 600"', 'width="100%" height="60cm" viewBox="0 0 1200 600"',
        'width="auto" height="60cm" viewBox="0 0 1200 600"', 'style="width:1200mm" viewBox="0 0 1200 600"',
        'width="1200mm" height="600mm" viewBox="0,0,1200,600" x="5cm" y="7"',
        'width="4800Q" height="60.0cm" viewBox="0 0 1200 600"', 'width="1.2e3mm" viewBox="0 0 1.2e3 6e2"',
        'width="1200mm" height="900mm" viewBox="0 0 1200 600" preserveAspectRatio="xMinYMin"',
        'width="1200mm" height="300mm" viewBox="0 0 1200 600" preserveAspectRatio="xMinYMin slice"',
        'width="1200mm" height="600mm" viewBox="0 0 1200 600" preserveAspectRatio="none"',
    )],
    (svg(_L, 'width="600" height="300"'), svg(_L, 'width="100%" height="100%"')),
    (svg(_L, 'width="100%" viewBox="0 0 1200 600"'), svg(_L, "")),
    (svg('<path d="M 0 0 h 12 v 6"/>', 'width="72pt" viewBox="0 0 12 6"'), svg('<path d="M 0 0 h 96 v 48"/>', 'width="1in"')),
    (svg('<circle r="3cm"/>', ""), svg('<circle r="30mm"/>', 'width="9cm" height="9cm"')),
    (svg('<ellipse rx="5"/>'), svg('<circle r="5"/>')),
    (svg('<rect width="9" height="6" ry="1"/>'), svg('<rect width="9" height="6" rx="1"/>')),
    (svg('<path d="M 0. 0. L 10. 5. 1.e1-5"/>'), svg('<path d="M 0 0 L 10 5 10 -5"/>')),
    # moved
    (svg(_TURNED.replace("/>", ' style="transform: rotate( 90deg )"/>')), svg(_ROCK.replace("/>", ' transform="rotate(90)"/>'))),
    (svg(f"<style>.r {{ transform: translate(10px, 20px) scale(2) }}</style><g class='a r'>{_LINE}</g>"),
     svg('<path d="M 10 20 l 60 80"/>')),
    (svg("<style>/* c */ path, #n { transform: scale(2) } #p { transform: scale(3) } .q { transform: none }</style>"
         '<path id="p" class="q" d="M 0 0 L 10 20"/>'), svg('<path d="M 0 0 L 30 60"/>')),
    (svg(f'<g transform="translateX(5)translateY(6),scaleX(2) scaleY(3)">{_LINE}</g>'), svg('<path d="M 5 6 l 60 120"/>')),
    (svg(f'<g transform="rotate(0.25turn) skewX(.0rad)">{_LINE}</g>'), svg('<path d="M 0 0 L -40 30"/>')),
    (svg('<g transform-origin="9 9"><path transform-origin="0 0" d="M 0 0 L 3 4" transform="scale(2)"/></g>'),
     svg('<path d="M 0 0 L 6 8"/>')),
    (svg(_LINE, f'transform="scale(2)" {_PX}'), svg('<path d="M 0 0 L 60 80"/>')),
    (svg(f'<defs><g id="g" transform="scale(2)">{_LINE}</g></defs><use xlink:href="#g" x="1" y="2" transform="scale(3)"/>'),
     svg('<path d="M 3 6 l 180 240"/>')),
    # hidden
    *[(svg(body), svg(_LINE)) for body in (
        f'{_LINE}<g visibility="hidden">{_HIDDEN}</g>', f'<g visibility="collapse">{_HIDDEN}<g style="visibility:visible">{_LINE}</g></g>',
        f'{_LINE}<symbol id="s">{_HIDDEN}</symbol><marker id="m">{_HIDDEN}</marker><mask id="k">{_HIDDEN}</mask>',
        f'{_LINE}<pattern id="p">{_HIDDEN}</pattern><clipPath id="c">{_HIDDEN}</clipPath><defs>{_HIDDEN}</defs>',
        f'<style>.a{{display:none}}</style>{_LINE}<g class="a">{_HIDDEN}</g>',
        f'<style><![CDATA[ g.a > text {{ fill: red }} @font-face {{ src: x }} .a {{ DISPLAY : none ; }}]]></style>{_LINE}<g class="b a">{_HIDDEN}</g>',
        f'<style>.a{{visibility:hidden}}</style>{_LINE}<use href="#p" class="a"/><defs><path id="p" d="M 0 0 L 1 1"/></defs>',
        f'{_LINE}<g opacity="0">{_HIDDEN}</g><g style="display:none !important">{_HIDDEN}</g>',
        f'{_LINE}<rect width="9"/><rect width="0" height="9"/><circle/><ellipse rx="0" ry="3"/><polyline points=""/>',
        f'<switch><foreignObject>{_HIDDEN}</foreignObject><text>t</text></switch><foo/>{_LINE}',
        f'<a href="x">{_LINE}</a><title>t</title><text mask="url(#m)" transform="x">t</text>',
        '<clipPath id="c"><path d="M0 0h99v99H0z"/></clipPath><path style="clip-path:none" d="M 0 0 L 30 40" filter="none"/>',
        f'<g xmlns:i="urn:i" i:groupmode="layer" style="display:inline;opacity:0.5">{_LINE}</g><i:path xmlns:i="urn:i" d="M 0 0 L 1 1"/>',
    )],
    (svg(_LINE, '&size;', '<!DOCTYPE svg [<!ENTITY size "x">]>').replace("&size;", 'class="&size;"'), svg(_LINE)),
]  # fmt: skip

BROKEN = [
    "<svg", "", "no xml", "<svg><g></svg>", "<svg></svg><svg/>", "<svg b='1' b='2'/>", "<svg b=1/>", "<svg b='&x;'/>",
]  # fmt: skip
_USES = "".join(f"<g id='g{i + 1}'>" + f"<use href='#g{i}'/>" * 10 + "</g>" for i in range(7))
_CURVES = " ".join(
    f"C {a} {b} {c} {d} {e} {f}" for a, b, c, d, e, f in np.random.default_rng(1).random((2_000, 6))
)
_OWN_GROUP = "a <use> shows a group that it belongs to"

# What is drawn, and the words of the refusal
REFUSED = [
    *[(svg(body), words) for body, words in (
        (_TURNED.replace("/>", ' transform-origin="300 0"/>'), "transform-origin is not read"),
        (_TURNED.replace("/>", ' style="transform-origin: center"/>'), "transform-origin is not read"),
        (f'<style>rect {{ transform-box: fill-box; transform: scale(2) }}</style>{_ROCK}', "transform-box is not read"),
        (_ROCK.replace("/>", ' style="rotate: 45deg"/>'), "rotate is not read"),
        (_ROCK.replace("/>", ' style="scale: 2"/>'), "scale is not read"),
        (f'<g style="translate: 5px">{_ROCK}</g>', "translate is not read"),
        (f'<g style="zoom: 2">{_ROCK}</g>', "zoom is not read"),
        (f'<g style="offset-path: path(\'M0 0h9\')">{_ROCK}</g>', "offset-path is not read"),
        (f'<g style="animation: a 1s">{_ROCK}</g>', "animation is not read"),
        (f'<g transform="translate(1cm)">{_ROCK}</g>', "transform='translate(1cm)' is not read"),
        (f'<g transform="translate(10%, 5)">{_ROCK}</g>', "transform='translate(10%, 5)' is not read"),
        (f'<g transform="rotate(10 5)">{_ROCK}</g>', "is not read"),
        (f'<g style="transform: rotate3d(1,1,1,45deg)">{_ROCK}</g>', "transform='rotate3d(1,1,1,45deg)' is not read"),
        (f'<g transform="scale(calc(2*3))">{_ROCK}</g>', "is not read"),
        (f'<mask id="m">{_HIDDEN}</mask><g mask="url(#m)">{_ROCK}</g>', "mask is not read"),
        (f'<g style="filter:url(#f)">{_ROCK}</g>', "filter is not read"),
        (f'<clipPath id="c">{_HIDDEN}</clipPath><g clip-path="url(#c)">{_ROCK}</g>', "clip-path is not read"),
        (f'<g style="clip-path: circle(5px)">{_ROCK}</g>', "clip-path is not read"),
        (f'<svg x="10">{_ROCK}</svg>', "an <svg> in another is not read"),
        (f'<defs><svg id="s">{_ROCK}</svg></defs><use href="#s"/>', "an <svg> in another is not read"),
        (f'<symbol id="s">{_ROCK}</symbol><use href="#s"/>', "a <use> shows '#s', which is no shape or group"),
        (f'<switch><g requiredExtensions="x">{_HIDDEN}</g>{_LINE}</switch>', "<switch> is not read"),
        (f'<g requiredExtensions="x">{_HIDDEN}</g>', "requiredExtensions is not read"),
        ('<line x2="50%"/>', "x2='50%' is not read"), ('<circle r="-5"/>', "r='-5' is below 0"),
        ('<rect width="9" height="9"><animateTransform attributeName="transform"/></rect>', "<animateTransform> is not read"),
        (f'<animate attributeName="x"/>{_ROCK}', "<animate> is not read"), (f'<foo>{_ROCK}</foo>', "<foo> is not read"),
        (f'<constructor>{_ROCK}</constructor>', "<constructor> is not read"),
        (f'<g transform="constructor(1)">{_ROCK}</g>', "is not read"), ('<circle r="1constructor"/>', "is not read"),
        ('<use href="b.svg#a"/>', "a <use> shows 'b.svg#a'"), ('<use href="#b"/>', "a <use> shows '#b'"),
        (f'<g systemLanguage="de">{_ROCK}</g>', "systemLanguage is not read"),
        (f'<style>g > rect {{ display: none }}</style>{_ROCK}', "<style> sets display of 'g > rect'"),
        (f'<style>rect:hover {{ transform: scale(2) }}</style>{_ROCK}', "<style> sets transform of 'rect:hover'"),
        (f'<style>rect {{ display: none !important }}</style>{_ROCK}', "<style> sets display of 'rect'"),
        (f'<style>@media print {{ rect {{ display: none }} }}</style>{_ROCK}', "<style> is not read from '@media print {"),
        (f'<style>@import "a.css";</style>{_ROCK}', "<style> is not read from '@import"),
        ('<rect width="5em" height="3"/>', "width='5em' is not read"), ('<circle r="calc(1px)"/>', "r='calc(1px)' is not read"),
        ('<circle r="3cm"/>', "r='3cm' in a drawing without a size"), ('<rect width="1,5" height="3"/>', "width='1,5' is not read"),
        ('<polyline points="0,0 1"/>', "odd number"), ('<polyline points="0,0 1,a"/>', "points='0,0 1,a' is not read"),
        *[(f'<path d="{data}"/>', "the data of a path are not read") for data in (
            "M 0 0 L 1 1 bad", "nonsense", "L 1 1", "M 0 0 L 1", "M 0 0 C 1 1 2 2", "M 0 0 h", "M 0 0 V z", "M 0 0 A 1 1 0 2 0 5 5",
            "M 0 0 A", "M 0 0 z 5", "5 5 M 0 0", "M 0 0 L 1;5 2", "none")],
    )],
    (svg(_LINE, before='<?xml-stylesheet href="a.css"?>'), "<?xml-stylesheet> is not read"),
    (svg(_LINE, 'width="10em" viewBox="0 0 9 9"'), "width='10em' is not read"),
    (svg(_LINE, 'width="-5" viewBox="0 0 9 9"'), "below 0"),
    (svg(_LINE, 'style="max-width: 5cm" viewBox="0 0 9 9"'), "max-width is not read"),
    (svg(_LINE, 'viewBox="0 0 5"'), "viewBox='0 0 5' is not read"),
    (svg(_LINE, 'viewBox="0 0 0 5"'), "viewBox='0 0 0 5' is not read"),
    (svg(_LINE, 'width="0" height="5"'), "the width or height of the <svg> is 0"),
    (svg(_LINE, 'viewBox="0 0 5 5" preserveAspectRatio="middle"'), "preserveAspectRatio='middle' is not read"),
    (f"<html>{_LINE}</html>", "is not SVG: it begins with <html>"),
    *[(svg(body), "no path") for body in ("", '<path d="M 0 0"/>', "<text>hi</text>")],
    (svg('<path d="M 0 0 L 0 0"/>'), "same"),
    # what would take minutes
    (svg(f'<defs><g id="g0"><path d="M 0 0 L 1 1"/></g>{_USES}</defs><use href="#g7"/>'), "more than 50000 shapes"),
    (svg('<g id="a"><use href="#a"/></g>'), _OWN_GROUP),
    (svg('<g id="a"><use href="#b"/></g><g id="b"><use href="#a"/></g>'), _OWN_GROUP),
    (svg("<g>" * 120 + "</g>" * 120), "more than 100 levels"),
    (svg(f'<path d="M 0 0 {_CURVES}"/>'), "more than 200000 points"),
    (svg(f'<path d="M 0 0{" L 1 2" * 30_000}"/>'), "more than 50000 shapes and coordinates"),
]  # fmt: skip
