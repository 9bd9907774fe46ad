"""What runs for every number of a motion capture file: text to floats, angles to quaternions."""

from __future__ import annotations

import numpy as np

from kumite.kernels.jit import kernel

NO_BYTE = -1  # no such byte
MOST_DIGITS = 18  # of a mantissa that fits in an int64
EXACT_MANTISSA = 1 << 53  # up to here a float64 holds every integer
EXACT_POWER = 22  # the highest power of ten that a float64 holds exactly
POWERS_OF_TEN = 10.0 ** np.arange(EXACT_POWER + 1)

LINE_END, SPACE, PLUS, MINUS, DOT = 10, 32, 43, 45, 46
DIGIT_0, DIGIT_9, UPPER_E, LOWER_E = 48, 57, 69, 101


@kernel
def parse_number(data, start, end):
    """One decimal number in ``data[start:end]``: value, is a number, is the value exact.

    The value is exact (the nearest float64) when mantissa and power of ten are both exact, since
    then only one rounding happens. Otherwise the caller parses the token again.
    """
    i = start
    negative = False
    if data[i] == MINUS or data[i] == PLUS:
        negative = data[i] == MINUS
        i += 1
    mantissa, digits, kept, power = 0, 0, 0, 0
    after_dot, too_long = False, False
    while i < end:
        c = int(data[i])
        if c >= DIGIT_0 and c <= DIGIT_9:
            digits += 1
            if kept < MOST_DIGITS:
                mantissa = mantissa * 10 + (c - DIGIT_0)
                if mantissa > 0:
                    kept += 1
                if after_dot:
                    power -= 1
            else:  # too long for an int64, but a number only if the rest is one
                too_long = True
        elif c == DOT and not after_dot:
            after_dot = True
        else:
            break
        i += 1
    if digits == 0:
        return 0.0, False, False
    if i < end:
        if data[i] != LOWER_E and data[i] != UPPER_E:
            return 0.0, False, False
        i += 1
        down = False
        if i < end and (data[i] == MINUS or data[i] == PLUS):
            down = data[i] == MINUS
            i += 1
        if i == end:
            return 0.0, False, False
        exponent = 0
        while i < end:
            c = int(data[i])
            if c < DIGIT_0 or c > DIGIT_9:
                return 0.0, False, False
            exponent = min(exponent * 10 + (c - DIGIT_0), 100000)
            i += 1
        power += -exponent if down else exponent
    if too_long:
        return 0.0, True, False
    if mantissa == 0:
        return (-0.0 if negative else 0.0), True, True
    if mantissa > EXACT_MANTISSA or power < -EXACT_POWER or power > EXACT_POWER:
        return 0.0, True, False
    value = float(mantissa)
    value = value * POWERS_OF_TEN[power] if power >= 0 else value / POWERS_OF_TEN[-power]
    return (-value if negative else value), True, True


@kernel
def parse_table(data, words, word_start, column_word, out, inexact):
    """A table of words and numbers, a period of ``len(column_word)`` tokens after another.

    ``column_word[c]`` is the word that must stand in column c, or below 0 for a number; word k is
    ``words[word_start[k]:word_start[k + 1]]``. Numbers go to ``out`` in order; of those that need
    the slow parser, ``inexact`` [.., 3] takes (index in out, first byte, end).

    Returns tokens, numbers, inexact numbers, first byte of the token refused, byte of the first
    line end within a period (NO_BYTE each, if there is none).
    """
    columns = column_word.shape[0]
    size = data.shape[0]
    tokens, numbers, hard, column = 0, 0, 0, 0
    broken = NO_BYTE
    i = 0
    while True:
        while i < size and data[i] <= SPACE:
            if data[i] == LINE_END and column > 0 and broken == NO_BYTE:
                broken = i
            i += 1
        if i >= size:
            return tokens, numbers, hard, NO_BYTE, broken
        start = i
        while i < size and data[i] > SPACE:
            i += 1
        word = column_word[column]
        if word >= 0:
            a, b = word_start[word], word_start[word + 1]
            same = b - a == i - start
            k = 0
            while same and k < b - a:
                same = words[a + k] == data[start + k]
                k += 1
            if not same:
                return tokens, numbers, hard, start, broken
        else:
            value, is_number, exact = parse_number(data, start, i)
            if not is_number:
                return tokens, numbers, hard, start, broken
            out[numbers] = value
            if not exact:
                if hard == inexact.shape[0]:
                    return tokens, numbers, hard, start, broken
                inexact[hard, 0] = numbers
                inexact[hard, 1] = start
                inexact[hard, 2] = i
                hard += 1
            numbers += 1
        tokens += 1
        column = column + 1 if column + 1 < columns else 0


@kernel
def euler_to_wxyz(values, start, column, axis, radians_per_unit, out):
    """Turns about axes (0 x, 1 y, 2 z), each in the axes that the turns before it left.

    Joint j's turns are ``start[j]:start[j + 1]``; turn r reads ``values[:, column[r]]`` and goes
    about ``axis[r]``. ``out`` [F, J, 4].
    """
    for f in range(values.shape[0]):
        for j in range(start.shape[0] - 1):
            w, x, y, z = 1.0, 0.0, 0.0, 0.0
            for r in range(start[j], start[j + 1]):
                half = 0.5 * radians_per_unit * values[f, column[r]]
                c, s = np.cos(half), np.sin(half)
                if axis[r] == 0:
                    w, x, y, z = w * c - x * s, x * c + w * s, y * c + z * s, z * c - y * s
                elif axis[r] == 1:
                    w, x, y, z = w * c - y * s, x * c - z * s, y * c + w * s, z * c + x * s
                else:
                    w, x, y, z = w * c - z * s, x * c + y * s, y * c - x * s, z * c + w * s
            out[f, j, 0] = w
            out[f, j, 1] = x
            out[f, j, 2] = y
            out[f, j, 3] = z
