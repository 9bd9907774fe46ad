"""A short slice of the fuzzing that ``make fuzz`` does for minutes."""

from __future__ import annotations

import pytest

from tests.fuzz.run import run
from tests.fuzz.targets import TARGETS

FEW = {"library": 15, "policy": 6, "performance": 30, "recording": 30}
FEW |= {f"{kind}-commands": few for kind, few in zip(FEW, (12, 3, 6, 20))}  # others: 80


@pytest.mark.parametrize("target", TARGETS)
def test_every_case_ends_in_a_result_or_one_error(target, tmp_path):
    result = run(target, FEW.get(target, 80), folder=tmp_path, deep=False)
    assert not result.finds, "\n".join(result.finds)
    assert result.refused or target.startswith("policy")  # a damaged policy is solved again
    assert result.read
