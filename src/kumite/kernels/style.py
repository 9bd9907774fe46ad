"""Columns of a fighter's style as the kernels take it: a row of float64 [COLUMNS].

:mod:`kumite.control.styles` fills it and says what each weight does.
"""

FACING = 0  # w_θ
DISTANCE = 1  # w_r
PREFERRED_FACING = 2  # θ_d, rad
PREFERRED_DISTANCE = 3  # r_d, m
GIVEN_SHORT = 4  # w_D⁺ of short-range attacks
GIVEN_LONG = 5  # w_D⁺ of the others
TAKEN = 6  # w_D⁻
SUITABILITY = 7  # w_S
HEADING = 8  # w_γ
PREFERRED_HEADING = 9  # γ_d, rad; 0 where there is none, and w_γ is 0 there
PLACE = 10  # w_p
REQUIREMENT = 11  # w_a
COLUMNS = 12
