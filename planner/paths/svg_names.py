"""Names that readers of drawings know, the page's too: of elements, attributes, properties, transforms and units.

`unread` are attributes and properties that move, scale or hide, with the values that do nothing. `lengths` belong
to a view's width (0), height (1) or diagonal (2). `transforms` take numbers (1), lengths (x) and angles (a);
`units` are those of each, `pixels` the sizes of units.
"""

from __future__ import annotations

from typing import Any

NAMES: dict[str, Any] = {
  "shapes": ["path", "line", "polyline", "polygon", "rect", "circle", "ellipse"],
  "groups": ["svg", "g", "a", "switch", "use", "symbol"],
  "undrawn": ["defs", "clipPath", "mask", "marker", "pattern", "linearGradient", "radialGradient", "meshgradient",
    "hatch", "solidcolor", "solidColor", "filter", "text", "image", "foreignObject", "style", "script", "metadata",
    "title", "desc", "view", "cursor", "color-profile", "font", "font-face", "flowRoot"],
  "lengths": {"x": 0, "y": 1, "width": 0, "height": 1, "cx": 0, "cy": 1, "r": 2, "rx": 0, "ry": 1, "x1": 0,
    "y1": 1, "x2": 0, "y2": 1},
  "read": ["display", "visibility", "opacity", "overflow", "transform", "clip-path", "d"],
  "unread": {
    "transform-origin": ["0", "0 0", "0px 0px", "left top", "top left"], "transform-box": ["view-box"],
    "-webkit-transform": ["none"], "translate": ["none"], "rotate": ["none"], "scale": ["none"],
    "zoom": ["1", "100%", "normal"], "perspective": ["none"], "offset": ["none"], "offset-path": ["none"],
    "animation": ["none"], "animation-name": ["none"], "vector-effect": ["none", "non-scaling-stroke"],
    "mask": ["none"], "mask-image": ["none"], "-webkit-mask": ["none"], "-webkit-mask-image": ["none"],
    "-webkit-clip-path": ["none"], "clip": ["auto"], "filter": ["none"], "content-visibility": ["visible", "auto"],
    "max-width": ["none", "100%"], "max-height": ["none", "100%"], "min-width": ["0", "auto"],
    "min-height": ["0", "auto"], "aspect-ratio": ["auto"], "systemLanguage": [], "refX": ["0"], "refY": ["0"]
  },
  "transforms": {
    "matrix": ["111111"], "translate": ["x", "xx"], "translatex": ["x"], "translatey": ["x"], "scale": ["1", "11"],
    "scalex": ["1"], "scaley": ["1"], "rotate": ["a", "axx"], "skew": ["a", "aa"], "skewx": ["a"], "skewy": ["a"]
  },
  "units": {
    "1": {"": 1}, "x": {"": 1, "px": 1},
    "a": {"": 1, "deg": 1, "grad": 0.9, "rad": 57.29577951308232, "turn": 360}
  },
  "pixels": {"": 1, "px": 1, "pt": 1.3333333333333333, "pc": 16, "in": 96, "cm": 37.79527559055118,
    "mm": 3.7795275590551185, "q": 0.9448818897637796}
}  # fmt: skip
