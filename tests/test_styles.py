"""Styles: the paper's numbers, changes, what is refused."""

from __future__ import annotations

from dataclasses import asdict, replace
from pathlib import Path

import numpy as np
import pytest

from kumite.annotate import DIRECTIONS, KINDS, NO_LIMB, Actions
from kumite.annotate.vocabulary import DIRECTIONS_OF
from kumite.control.styles import NAMES, STYLES, Style, short_range, style
from kumite.errors import KumiteError
from kumite.kernels import style as columns
from tests.test_docs import blocks

# Typed from the paper: w_θ, w_r, θ_d [°], r_d [m], w_D⁺ short, long, w_D⁻, w_S (Table III), then
# w_γ, w_p, w_a (Table IV; styles that are not in it do without).
PAPER = """
boxer               10  10  0  0.8  1e5 1e5  1e5  1e2   0  0   0
infighter           10  10  0  0.5  1e5 1e1  1e5  1e2   0  0   0
outboxer            10  10  0  2.0  1e1 1e5  1e5  1e2   0  0   0
boxer_path          10  10  0  0.8  1e5 1e5  1e5  1e2   0  10  1e6
sword_fighter       10  10  0  1.5  1e5 1e5  1e5  1e2   0  0   0
sword_fighter_path  10  10  0  1.5  1e5 1e5  1e5  1e2   0  10  1e6
chaser              10  10  0  0.1  1e5 1e5  0    0     0  0   0
runaway             10  10  0  3.0  0   0    1e5  0     0  0   0
chaser_path         10  10  0  0.1  1e5 1e5  0    0     0  10  0
runaway_path        10  10  0  3.0  0   0    1e5  0     0  10  0
"""
ROWS = {row.split()[0]: [float(x) for x in row.split()[1:]] for row in PAPER.strip().split("\n")}
ORDER = (
    *("facing", "distance", "preferred_facing", "preferred_distance"),
    *("given_short", "given_long", "taken", "suitability", "heading", "place", "requirement"),
)


@pytest.mark.parametrize("name", ROWS)
def test_presets_are_the_papers(name: str):
    found = asdict(STYLES[name])
    assert [found[weight] for weight in ORDER] == ROWS[name]  # θ_d is 0 in any unit
    assert found["preferred_heading"] is None


def test_there_are_no_others():
    assert set(STYLES) == set(ROWS)
    assert set(NAMES) == {*ORDER, "preferred_heading"}


def test_every_weight_has_a_column_of_its_own():
    numbers = {n: v for n, v in vars(columns).items() if n.isupper() and n != "COLUMNS"}
    assert set(numbers) == {name.upper() for name in NAMES}
    assert sorted(numbers.values()) == list(range(columns.COLUMNS))
    each = Style(**{name: 1.0 + k for k, name in enumerate(NAMES)})
    row = each.as_array()
    assert row.dtype == np.float64 and row.shape == (columns.COLUMNS,)
    for k, name in enumerate(NAMES):
        assert row[numbers[name.upper()]] == 1.0 + k
    assert STYLES["boxer"].as_array()[columns.PREFERRED_HEADING] == 0.0


def test_orders_are_counted_in_solid_blows_of_the_style():
    place, asked = columns.PLACE, columns.REQUIREMENT
    for name in ("boxer_path", "chaser_path", "runaway_path", "outboxer"):  # 5 m/s to the head: 10⁶
        assert STYLES[name].in_play()[[place, asked]].tolist() == [1e6, 1e8]
    mild = STYLES["boxer_path"].changed(given_short=10.0, given_long=10.0, taken=0.0, place=1.0)
    assert mild.in_play()[[place, asked]].tolist() == [10.0, 1e4]  # a tenth of 100
    peaceful = STYLES["boxer"].changed(given_short=0.0, given_long=0.0, taken=0.0)
    assert peaceful.in_play()[place] == peaceful.suitability
    others = [c for c in range(columns.COLUMNS) if c not in (place, asked)]
    assert np.array_equal(mild.in_play()[others], mild.as_array()[others])


def test_a_preset_with_some_weights_changed():
    assert style("outboxer") is not None and style("outboxer") == STYLES["outboxer"]
    bold = style({"preset": "outboxer", "taken": 10, "given_short": 1e5})
    assert bold == replace(STYLES["outboxer"], taken=10.0, given_short=1e5)
    assert isinstance(bold.taken, float)
    assert style({"preferred_distance": 1.1}) == STYLES["boxer"].changed(preferred_distance=1.1)
    assert style(bold) is bold
    turned = style({"preset": "boxer_path", "heading": 5, "preferred_heading": -1.5})
    assert turned.as_array()[columns.PREFERRED_HEADING] == -1.5


@pytest.mark.parametrize(
    ("wanted", "message"),
    [
        ("infigther", "unknown style 'infigther'; did you mean 'infighter'"),
        ({"preset": "chasr"}, "did you mean 'chaser'"),
        ({"preset": 3}, "unknown style '3'"),
        ({"prefered_distance": 1.0}, "unknown weight of a style 'prefered_distance'; did you mean"),
        ({"taken": -1.0}, "taken: -1; expected 0 or more"),
        ({"taken": float("nan")}, "taken: nan; expected a finite number"),
        ({"preferred_facing": float("inf")}, "preferred_facing: inf"),
        ({"place": "10"}, "place: '10'; expected a number"),
        ({"place": True}, "place: True; expected a number"),
        ({"distance": None}, "distance: None; expected a number"),
        ({"heading": 1.0}, "expected a preferred_heading"),
    ],
)
def test_what_is_no_style_is_refused(wanted, message: str):
    with pytest.raises(KumiteError) as error:
        style(wanted)
    assert message in str(error.value)


def test_every_wrong_weight_is_named_at_once():
    with pytest.raises(KumiteError) as error:
        Style(taken=-1.0, place=float("nan"))
    assert len(str(error.value).split("\n")) == 2


def test_hooks_and_uppercuts_are_short_range():
    ways = [(kind, way) for kind in KINDS for way in DIRECTIONS_OF[kind]]
    n = len(ways)
    actions = Actions(
        np.arange(n) * 10,
        np.arange(n) * 10 + 10,
        np.array([KINDS.index(kind) for kind, _ in ways]),
        np.full(n, NO_LIMB),
        np.array([DIRECTIONS.index(way) for _, way in ways]),
        tuple(way for _, way in ways),
        np.array([0, 10 * n]),
    )
    short = {way for (_, way), found in zip(ways, short_range(actions)) if found}
    assert short == {"hook", "uppercut"}
    given = dict(zip(ways, STYLES["infighter"].given(actions)))
    assert given["attack", "hook"] == given["attack", "uppercut"] == 1e5
    assert {given["attack", way] for way in ("straight", "kick", "slash", "thrust")} == {10.0}
    assert all(w == 0.0 for (kind, _), w in given.items() if kind != "attack")


# The document ------------------------------------------------------------------------------------

DOCUMENT = "docs/styles.md"


def test_the_document_has_the_same_numbers():
    rows = {}
    for line in (Path(__file__).parents[1] / DOCUMENT).read_text("utf-8").split("\n"):
        cells = [c.strip() for c in line.strip("|").split("|")]
        if cells[0] in STYLES:
            given = cells[5].split(" / ")
            cells[5:6] = given if len(given) == 2 else given * 2
            ten = {"10⁶": "1e6", "10⁵": "1e5", "10²": "1e2"}
            rows[cells[0]] = [float(ten.get(c, c.removesuffix(" m"))) for c in cells[1:]]
    assert rows == ROWS


def test_the_documents_python_runs(capsys: pytest.CaptureFixture[str]):
    for block in blocks("python", DOCUMENT):
        exec(block, {})
    assert capsys.readouterr().out.startswith("(3.0, 2.0) ()")
