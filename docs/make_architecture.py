"""Draws docs/architecture.svg: how a sample travels, and where a machine meets the inference.

python docs/make_architecture.py
"""

from __future__ import annotations

from pathlib import Path

PAGE = Path(__file__).with_name("architecture.svg")
WIDTH, HEIGHT = 1120, 570
MACHINE, INFERENCE, ROAD = "#fdf0d5", "#dbe9f6", "#e9efe6"
# name: (x, y, width, height, fill, title, lines below it)
BOXES = {
    "log": (20, 40, 150, 70, ROAD, "log file, CAN bus", "any format, .gz"),
    "can": (210, 40, 150, 70, ROAD, "can/", "frames as columns"),
    "reading": (400, 40, 150, 70, ROAD, "reading/", "DBC, vehicle file"),
    "estimate": (590, 40, 150, 70, ROAD, "estimate/", "timeline and filter"),
    "record": (950, 40, 150, 70, ROAD, "record/, cli/", "Rerun, Parquet, reports"),
    "monitor": (780, 40, 130, 70, ROAD, "monitor/", "live, from the bus"),
    "machine": (20, 250, 340, 300, MACHINE, "models/: a machine", ""),
    "inference": (590, 250, 510, 300, INFERENCE, "what knows no machine", ""),
    "contract": (
        400,
        350,
        150,
        100,
        "#ffffff",
        "Machine",
        "models/machine.py;frozen; checked",
    ),
    "vehicle": (400, 160, 150, 60, ROAD, "vehicle/", "numbers of one vehicle"),
    "generator": (20, 160, 150, 60, ROAD, "generator/", "an independent truth"),
}
PIECES = (
    "equations, regimes",
    "states, inputs, sensors, columns",
    "error terms, covariates",
    "effects/  one file each",
    "faults/  one file each",
    "procedures, delay relations, pictures",
    "wear, event, compared pair, words",
)
ROOMS = (
    ("compute/", "equations lowered to compiled kernels"),
    ("inference/", "linearisation, noise model, MAP fit, score test"),
    ("identify/", "runs procedures: parameters, noise, delays"),
    ("discovery/", "candidates → search → verdict → hold-out"),
    ("diagnosis/", "streams, blocks, thresholds, isolation, codes"),
)
ARROWS = (
    ("log", "can"),
    ("can", "reading"),
    ("reading", "estimate"),
    ("estimate", "monitor"),
    ("monitor", "record"),
)


def page() -> str:
    """The picture as SVG."""
    parts = [
        f'<svg xmlns="http://www.w3.org/2000/svg" viewBox="0 0 {WIDTH} {HEIGHT}" '
        'font-family="sans-serif" font-size="13">',
        '<defs><marker id="tip" markerWidth="8" markerHeight="8" refX="7" refY="4" '
        'orient="auto"><path d="M0,0 L8,4 L0,8 z"/></marker></defs>',
        f'<rect width="{WIDTH}" height="{HEIGHT}" fill="white"/>',
        *(_box(*box) for box in BOXES.values()),
        *(_arrow(*_between(a, b)) for a, b in ARROWS),
        *(_text(40, 310 + 32 * i, "• " + piece) for i, piece in enumerate(PIECES)),
    ]
    for i, (room, what) in enumerate(ROOMS):
        parts.append(_text(610, 315 + 45 * i, room, weight="bold"))
        parts.append(_text(710, 315 + 45 * i, what))
    parts += [
        _arrow(360, 400, 398, 400),
        _arrow(552, 400, 588, 400),
        _arrow(475, 220, 475, 348),
        _arrow(475, 160, 475, 112),
        _arrow(665, 250, 665, 112),
        _arrow(845, 250, 845, 112),
        _arrow(1025, 250, 1025, 112),
        _arrow(95, 160, 95, 112),
    ]
    return "\n".join([*parts, "</svg>", ""])


def _box(x: int, y: int, width: int, height: int, fill: str, title: str, below: str) -> str:
    middle = x + width / 2
    lines = [
        f'<rect x="{x}" y="{y}" width="{width}" height="{height}" rx="8" fill="{fill}" '
        'stroke="#444"/>',
        _text(middle, y + 26, title, weight="bold", anchor="middle"),
    ]
    for i, line in enumerate(below.split(";")):
        lines.append(_text(middle, y + 48 + 18 * i, line, anchor="middle", size=12))
    return "\n".join(lines)


def _text(
    x: float, y: float, words: str, weight: str = "normal", anchor: str = "start", size: int = 13
) -> str:
    return (
        f'<text x="{x}" y="{y}" font-weight="{weight}" text-anchor="{anchor}" '
        f'font-size="{size}">{words}</text>'
    )


def _arrow(x1: float, y1: float, x2: float, y2: float) -> str:
    return f'<path d="M{x1},{y1} L{x2},{y2}" stroke="#222" marker-end="url(#tip)" fill="none"/>'


def _between(a: str, b: str) -> tuple[float, float, float, float]:
    x, y, width, height, *_ = BOXES[a]
    return x + width, y + height / 2, BOXES[b][0] - 2, BOXES[b][1] + BOXES[b][3] / 2


if __name__ == "__main__":
    PAGE.write_text(page(), encoding="utf-8")
