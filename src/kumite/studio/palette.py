"""Who wears what: a colour for each part of the outfit, in the colours of each corner."""

from __future__ import annotations

import colorsys

RGB = tuple[int, int, int]

CORNERS: tuple[RGB, ...] = (
    (214, 48, 49),  # red
    (38, 108, 224),  # blue
    (236, 172, 32),  # gold
    (32, 158, 98),  # green
    (148, 78, 212),  # violet
    (232, 112, 34),  # orange
    (24, 170, 184),  # teal
    (222, 84, 150),  # pink
)
SKINS: tuple[RGB, ...] = ((214, 160, 122), (150, 98, 66), (232, 184, 148), (108, 70, 48))
HAIRS: tuple[RGB, ...] = ((46, 34, 28), (24, 20, 20), (112, 76, 40), (60, 46, 36))


def corner(character: int) -> RGB:
    """The colour a character is known by: red, blue, then six more, then round the wheel."""
    if character < len(CORNERS):
        return CORNERS[character]
    # Steps of the golden ratio never come back to a hue already used.
    r, g, b = colorsys.hsv_to_rgb((character * 0.61803398875) % 1.0, 0.72, 0.86)
    return round(r * 255), round(g * 255), round(b * 255)


def mix(a: RGB, b: RGB, t: float) -> RGB:
    """From ``a`` at t = 0 to ``b`` at t = 1."""
    r, g, b_ = (round(x + (y - x) * t) for x, y in zip(a, b))
    return r, g, b_


def css(colour: RGB) -> str:
    """``#rrggbb``."""
    return "#{:02x}{:02x}{:02x}".format(*colour)


def outfit(character: int) -> dict[str, RGB]:
    """The colour of every role of a body's skin. Roles of one colour are drawn as one."""
    main = corner(character)
    light = (232, 232, 228)
    return {
        "skin": SKINS[character % len(SKINS)],
        "hair": HAIRS[character % len(HAIRS)],
        "gloves": main,
        "shirt": mix(main, (30, 32, 38), 0.35),
        "shorts": mix(main, (24, 26, 32), 0.72),
        "shoes": light,
        "soles": light,
        "trim": light,
    }
