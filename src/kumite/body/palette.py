"""Colours for a body's roles: the red corner, the blue corner, and more for a crowd."""

from __future__ import annotations

from collections.abc import Mapping

Colour = tuple[float, float, float]  # sRGB, 0..1
Palette = Mapping[str, Colour]  # role -> colour

_LIGHT, _TAN, _BROWN, _DARK = (
    (0.91, 0.74, 0.63),
    (0.80, 0.60, 0.46),
    (0.62, 0.43, 0.31),
    (0.42, 0.28, 0.20),
)
_WHITE = (0.93, 0.93, 0.91)


def _corner(main: Colour, deep: Colour, skin: Colour, hair: Colour, trim: Colour) -> Palette:
    return {
        "skin": skin,
        "hair": hair,
        "shirt": main,
        "shorts": deep,
        "gloves": main,
        "shoes": deep,
        "soles": _WHITE,
        "trim": trim,
    }


PALETTES: tuple[Palette, ...] = (
    _corner((0.78, 0.13, 0.13), (0.42, 0.07, 0.09), _LIGHT, (0.16, 0.11, 0.08), _WHITE),
    _corner((0.13, 0.34, 0.74), (0.08, 0.17, 0.40), _TAN, (0.09, 0.07, 0.06), _WHITE),
    _corner((0.90, 0.62, 0.10), (0.25, 0.25, 0.27), _DARK, (0.06, 0.05, 0.05), (0.9, 0.62, 0.1)),
    _corner((0.16, 0.54, 0.34), (0.08, 0.27, 0.18), _BROWN, (0.08, 0.06, 0.05), _WHITE),
    _corner((0.48, 0.25, 0.62), (0.24, 0.13, 0.33), _LIGHT, (0.45, 0.30, 0.16), _WHITE),
    _corner((0.86, 0.86, 0.84), (0.20, 0.22, 0.26), _TAN, (0.12, 0.09, 0.07), (0.75, 0.12, 0.12)),
)
"""Red and blue come first; every palette gives every role of ``ROLES`` a colour."""


def palette(character: int) -> Palette:
    """The palette of a character by its number; they repeat after the last."""
    return PALETTES[character % len(PALETTES)]
