"""Who wears what, by name: one set of colours for the studio, GLB files and contact sheets."""

from __future__ import annotations

import colorsys
import re
from collections.abc import Mapping, Sequence
from zlib import crc32

from kumite.checked import checked

RGB = tuple[int, int, int]  # sRGB, 0..255
Palette = Mapping[str, RGB]  # role -> colour

COLOURS: dict[str, RGB] = {
    "red": (214, 48, 49),
    "blue": (38, 108, 224),
    "gold": (236, 172, 32),
    "green": (32, 158, 98),
    "violet": (148, 78, 212),
    "orange": (232, 112, 34),
    "teal": (24, 170, 184),
    "pink": (222, 84, 150),
    "amber": (240, 180, 24),
    "black": (44, 44, 50),
    "brown": (130, 82, 46),
    "grey": (130, 134, 142),
    "purple": (128, 60, 176),
    "white": (226, 226, 222),
    "yellow": (238, 208, 44),
}
"""A character whose name holds one of these words has that colour."""
_FREE = tuple(COLOURS.values())[:8]  # for the others: colours that nobody mixes up
_ALIKE = 50.0  # nearer than that, amber and gold are one colour to the eye
_OTHER_WORDS = {"gray": "grey"}
_SKINS: tuple[RGB, ...] = ((214, 160, 122), (150, 98, 66), (232, 184, 148), (108, 70, 48))
_HAIRS: tuple[RGB, ...] = ((46, 34, 28), (24, 20, 20), (112, 76, 40), (60, 46, 36))
_LIGHT: RGB = (232, 232, 228)
_STEPS = (0.61803398875, 0.7548776662, 0.5698402910)  # of hue, saturation, value: none come back


@checked
def mix(a: RGB, b: RGB, t: float) -> RGB:
    """From ``a`` at t = 0 to ``b`` at t = 1."""
    r, g, b_ = (round(x + (y - x) * t) for x, y in zip(a, b))
    return r, g, b_


@checked
def main_colours(names: Sequence[str]) -> list[RGB]:
    """The colour that each character is known by.

    A character named after a colour ("red", "blue 2") has it. Every other gets one that no one
    else has: by the number at the end of its name, else by the name itself, so that it looks the
    same in every scene where that colour is free.
    """
    out: list[RGB | None] = [_named(name) for name in names]
    named = {colour for colour in out if colour is not None}
    taken = set(named)
    step: dict[int, int] = {}  # where to go on looking, from each first choice
    for k, name in enumerate(names):
        if out[k] is None:
            first = _first_choice(name)
            slot = step.get(first, first)
            while (colour := _colour(slot)) in taken or any(_alike(colour, n) for n in named):
                slot += 1
            step[first] = slot + 1
            out[k] = colour
            taken.add(colour)
    return [colour for colour in out if colour is not None]


@checked
def palettes(names: Sequence[str]) -> list[Palette]:
    """A colour for every role of ``ROLES``, for each character."""
    return [_outfit(name, main) for name, main in zip(names, main_colours(names))]


def _named(name: str) -> RGB | None:
    words = re.findall(r"[a-z]+", name.lower())
    return next((COLOURS[w] for v in words if (w := _OTHER_WORDS.get(v, v)) in COLOURS), None)


def _alike(a: RGB, b: RGB) -> bool:
    return sum((x - y) ** 2 for x, y in zip(a, b)) < _ALIKE**2


def _first_choice(name: str) -> int:
    number = re.search(r"(\d{1,6})$", name)
    return max(int(number[1]) - 1, 0) if number else crc32(name.encode()) % len(_FREE)


def _colour(slot: int) -> RGB:
    if slot < len(_FREE):
        return _FREE[slot]
    hue, saturation, value = ((slot * step) % 1.0 for step in _STEPS)
    r, g, b = colorsys.hsv_to_rgb(hue, 0.55 + 0.35 * saturation, 0.62 + 0.33 * value)
    return round(r * 255), round(g * 255), round(b * 255)


def _outfit(name: str, main: RGB) -> Palette:
    # Skin and hair go by the name, so that nobody changes from one scene to the next.
    looks = crc32(name.encode())
    return {
        "skin": _SKINS[looks % len(_SKINS)],
        "hair": _HAIRS[looks // len(_SKINS) % len(_HAIRS)],
        "gloves": main,
        "shirt": mix(main, (30, 32, 38), 0.25),
        "shorts": mix(main, (24, 26, 32), 0.68),
        "shoes": _LIGHT,
        "soles": _LIGHT,
        "trim": _LIGHT,
    }
