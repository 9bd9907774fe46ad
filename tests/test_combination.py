"""The action combination table: the paper's numbers, annotations from motion, the file."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from kumite.annotate import DIRECTIONS, KINDS, NO_LIMB, Actions, find_contacts, find_strikes
from kumite.clip import LIMBS, concatenate
from kumite.control.combination import (
    HIT_DIRECTIONS,
    POSITIONS,
    Annotations,
    CombinationTable,
    Entry,
    annotate_actions,
    build_table,
    suitability,
)
from kumite.control.combination_file import read_table, write_table
from kumite.errors import KumiteError
from kumite.graph import ActionTable, Layer
from kumite.performer import perform
from kumite.performer.boxing import BOXING
from kumite.performer.moves import Style
from kumite.performer.sword import SWORD
from kumite.performer.take import as_written, perform_take
from tests.test_docs import blocks

HEAD, UPPER, LOWER = POSITIONS
FRONT, HORIZONTAL, UPWARDS = HIT_DIRECTIONS


def annotated(*rows: tuple[tuple[str, ...], tuple[str, ...]]) -> Annotations:
    return Annotations(
        np.array([[p in row[0] for p in POSITIONS] for row in rows]),
        np.array([[d in row[1] for d in HIT_DIRECTIONS] for row in rows]),
    )


# The paper ---------------------------------------------------------------------------------------


def test_the_papers_tables_1_and_2():
    attacks = annotated(((HEAD, UPPER), (FRONT,)), ((UPPER, LOWER), (UPWARDS,)))
    defences = annotated(
        ((HEAD, UPPER), (FRONT, HORIZONTAL)), ((UPPER, LOWER), (HORIZONTAL, UPWARDS))
    )
    found = suitability(defences, attacks)  # duck, jump back; right jab, upwards kick
    assert found.tolist() == [[0.75, 0.25], [0.25, 0.75]]


def test_a_defence_against_nothing_suits_nothing():
    none = annotated(((), ()))
    assert suitability(none, annotated(((HEAD,), (FRONT,)))).tolist() == [[0.0]]


subsets = st.tuples(st.sets(st.sampled_from(POSITIONS)), st.sets(st.sampled_from(HIT_DIRECTIONS)))


@given(subsets, subsets)
def test_suitability_is_a_share_of_the_defence(defence, attack):
    found = suitability(annotated(defence), annotated(attack))[0, 0]
    both = len(defence[0] & attack[0]) + len(defence[1] & attack[1])
    count = len(defence[0]) + len(defence[1])
    assert found == (both / count if count else 0.0)


# From motion -------------------------------------------------------------------------------------

ATTACKS = {  # move: kind of blow, band of its aim, direction
    "jab": ("straight", HEAD, FRONT),
    "cross": ("straight", HEAD, FRONT),
    "jab_low": ("straight", UPPER, FRONT),
    "left_hook": ("hook", HEAD, HORIZONTAL),
    "right_hook": ("hook", HEAD, HORIZONTAL),
    "left_uppercut": ("uppercut", UPPER, UPWARDS),
}
DEFENCES = {
    "duck": ("duck", {HEAD, UPPER}, {FRONT, HORIZONTAL}),
    "slip_left": ("slip", {HEAD}, {FRONT}),
    "slip_right": ("slip", {HEAD}, {FRONT}),
    "sway_back": ("sway", {HEAD}, {HORIZONTAL, UPWARDS}),
    "block_high_left": ("block", {HEAD, UPPER}, {FRONT, HORIZONTAL}),
    "jump_back": ("jump back", {UPPER, LOWER}, {HORIZONTAL, UPWARDS}),
}
CUTS = {
    "cut_down": ("slash", HEAD, FRONT),
    "cut_left": ("slash", UPPER, HORIZONTAL),
    "cut_right": ("slash", UPPER, HORIZONTAL),
    "cut_up": ("slash", UPPER, UPWARDS),
    "thrust": ("thrust", UPPER, FRONT),
}


_ONE = np.zeros(1, np.int32)
TABLE = ActionTable(  # a graph of one action: annotations do not look at it
    np.array([3]),
    np.array([0, 1]),
    _ONE,
    np.zeros(1, np.float32),
    np.array([1]),
    np.array([3]),
    _ONE,
    np.zeros((1, 3)),
)


def performed(style: Style, ways: dict) -> tuple[Layer, Actions]:
    """Moves one after the other, with their true actions."""
    score = [as_written(style.find(label)) for label in ways]
    clip, truth = perform_take("take", score, style, rng=np.random.default_rng(0))
    clips = concatenate([clip])
    own = [a for a in truth.actions if a.label in ways]
    limbs = {
        a.label: LIMBS.index(s.limb)
        for a in own
        for s in truth.strikes
        if a.start <= s.frame < a.stop
    }
    actions = Actions(
        np.array([a.start for a in own]),
        np.array([a.stop for a in own]),
        np.array([KINDS.index(a.kind) for a in own]),
        np.array([limbs.get(a.label, NO_LIMB) for a in own]),
        np.array([DIRECTIONS.index(ways[a.label][0]) for a in own]),
        tuple(a.label for a in own),
        clips.clip_start,
    )
    return Layer(clips, find_contacts(clips), find_strikes(clips), TABLE), actions


@pytest.fixture(scope="module")
def boxing() -> tuple[Layer, Actions]:
    return performed(BOXING, {**ATTACKS, **DEFENCES})


def said(found: Annotations, k: int) -> tuple[set[str], set[str]]:
    return (
        {p for p, has in zip(POSITIONS, found.positions[k]) if has},
        {d for d, has in zip(HIT_DIRECTIONS, found.directions[k]) if has},
    )


def test_attacks_hit_what_they_are_aimed_at(boxing):
    library, actions = boxing
    found = annotate_actions(library, actions)
    for k, label in enumerate(actions.label):
        if label in ATTACKS:
            positions, directions = said(found, k)
            assert ATTACKS[label][1] in positions and directions == {ATTACKS[label][2]}, label
            assert len(positions) <= 2, label


def test_defences_protect_what_leaves_or_is_covered(boxing):
    library, actions = boxing
    found = annotate_actions(library, actions)
    for k, label in enumerate(actions.label):
        if label in DEFENCES:
            assert said(found, k) == DEFENCES[label][1:], label


def test_slashes_and_thrusts():
    found = annotate_actions(*performed(SWORD, CUTS))
    for k, (label, (_, position, direction)) in enumerate(CUTS.items()):
        positions, directions = said(found, k)
        assert position in positions and directions == {direction}, label


@pytest.mark.slow
@pytest.mark.parametrize(("style", "most"), [("boxing", 1.7), ("sword", 2.3)])
def test_every_authored_blow_is_annotated_where_it_lands(style: str, most: float):
    made = perform(style, mirrored=False)
    clips = concatenate(made.clips)
    blows = [
        (int(first) + s.frame, s.limb, s.tip[1])
        for first, truth in zip(clips.clip_start, made.truth)
        for s in truth.strikes
    ]
    strikes = find_strikes(clips)
    pick = [int(np.abs(strikes.frame - frame).argmin()) for frame, _, _ in blows]
    assert len(set(pick)) == len(blows)
    actions = Actions(
        strikes.start[pick],
        strikes.stop[pick],
        np.zeros(len(blows)),
        np.array([LIMBS.index(limb) for _, limb, _ in blows]),
        np.zeros(len(blows)),
        ("blow",) * len(blows),
        clips.clip_start,
    )
    library = Layer(clips, find_contacts(clips), strikes, TABLE)
    found = annotate_actions(library, actions).positions
    rest = clips.world[0][:, [clips.skeleton.joint(role) for role in ("head", "pelvis")], 1]
    top, bottom = np.median(rest, axis=0)
    height = np.array([y for _, _, y in blows])
    band = np.where(
        height > top - 0.05 * (top - bottom), 0, np.where(height > (top + bottom) / 2, 1, 2)
    )
    assert found[np.arange(len(blows)), band].all()
    assert found.sum(axis=1).mean() < most


def test_what_a_person_has_corrected_counts(boxing):
    """A way that was mistaken is put right in actions.txt: its directions follow."""
    library, actions = boxing
    jab, duck = actions.label.index("jab"), actions.label.index("duck")
    direction = actions.direction.copy()
    direction[[jab, duck]] = DIRECTIONS.index("uppercut"), DIRECTIONS.index("sway")
    found = annotate_actions(library, replace(actions, direction=direction))
    assert said(found, jab)[1] == {UPWARDS}
    assert said(found, duck)[1] == {HORIZONTAL, UPWARDS}


def test_an_attack_without_a_found_blow_is_told_by_its_fastest_limb(boxing):
    library, actions = boxing
    strikes = library.strikes
    none = replace(
        strikes,
        **{name: getattr(strikes, name)[:0] for name in ("frame", "start", "stop", "limb")},
        velocity=strikes.velocity[:0],
    )
    blind = replace(library, strikes=none)
    for limbs in (actions.limb, np.full(len(actions), NO_LIMB)):
        found = annotate_actions(blind, replace(actions, limb=limbs))
        jab = actions.label.index("jab")
        assert HEAD in said(found, jab)[0] and said(found, jab)[1] == {FRONT}


def test_actions_of_other_clips_are_refused(boxing):
    library, actions = boxing
    with pytest.raises(KumiteError, match="other clips"):
        annotate_actions(library, replace(actions, clip_start=actions.clip_start * 2))


# The table ---------------------------------------------------------------------------------------


def test_all_attacks_are_paired_with_all_defences(boxing):
    library, actions = boxing
    table = build_table(library, actions)
    found = annotate_actions(library, actions)
    assert np.array_equal(table.annotations.positions, found.positions)
    assert np.array_equal(table.annotations.directions, found.directions)
    s = dict(zip(actions.label, table.suitability))
    jab, hook, upper = (actions.label.index(x) for x in ("jab", "left_hook", "left_uppercut"))
    assert s["slip_left"][jab] == 1.0  # made for just that
    assert s["sway_back"][hook] > s["slip_left"][hook]  # the paper: sways against hooks and
    assert s["sway_back"][upper] > s["slip_left"][upper]  # uppercuts, slips against straights
    assert s["slip_left"][jab] > s["sway_back"][jab]
    attack = actions.kind == KINDS.index("attack")
    assert not table.suitability[attack].any() and not table.suitability[:, ~attack].any()
    assert table.suitability.shape == (len(actions), len(actions))
    assert not table.suitability.flags.writeable


def some(*pairs) -> CombinationTable:
    """Two jabs of one label, to head and body, a duck and a step."""
    table = CombinationTable(
        ("jab", "jab", "duck", "step"),
        ("a:0", "a:20", "b:0", "b:30"),
        ("attack", "attack", "defence", "transition"),
        (
            Entry("attack", "jab", (HEAD,), (FRONT,)),
            Entry("attack", "jab@a:20", (LOWER,), (FRONT,)),
            Entry("defence", "duck", (HEAD, UPPER), (FRONT, HORIZONTAL)),
        ),
    )
    for pair in pairs:
        table = table.with_pair(*pair)
    return table


def test_one_action_may_differ_from_its_label():
    assert some().suitability[2].tolist() == [0.5, 0.25, 0.0, 0.0]
    edited = some().with_entry(Entry("attack", "jab", (HEAD, UPPER), (FRONT,)))
    assert edited.suitability[2].tolist() == [0.75, 0.25, 0.0, 0.0]
    assert [e.by_hand for e in edited.entries] == [True, False, False]


def test_a_pair_goes_before_annotations_and_may_discourage():
    assert some(("duck", "jab", -0.5)).suitability[2].tolist() == [-0.5, -0.5, 0.0, 0.0]
    table = some(("duck", "jab", -0.5), ("duck", "jab@a:20", 2), ("jab", "step", 1.0))
    assert table.suitability.tolist() == [
        [0, 0, 0, 1],
        [0, 0, 0, 1],
        [-0.5, 2, 0, 0],
        [0, 0, 0, 0],
    ]
    again = table.with_pair("duck", "jab@a:20", 0.25)
    assert len(again.pairs) == 3 and again.suitability[2, 1] == 0.25


@pytest.mark.parametrize(
    ("pair", "message"),
    [
        (("dukc", "jab", 1.0), "unknown action 'dukc'; did you mean 'duck'"),
        (("duck", "jab@a:2", 1.0), "unknown place of action 'jab': 'a:2'; did you mean 'a:20'"),
        (("duck", "jab", float("nan")), "expected a number"),
    ],
)
def test_pairs_that_cannot_be_are_refused(pair: tuple, message: str):
    with pytest.raises(KumiteError) as error:
        some(pair)
    assert message in str(error.value)


def test_an_entry_is_of_an_attack_or_a_defence():
    with pytest.raises(KumiteError, match="unknown attack 'duck'"):
        some().with_entry(Entry("attack", "duck", (), ()))
    with pytest.raises(KumiteError, match="unknown position 'haed'; did you mean 'head'"):
        Entry("attack", "jab", ("haed",), ())
    with pytest.raises(KumiteError, match="unknown kind"):
        Entry("transition", "step", (), ())


# The file ----------------------------------------------------------------------------------------


@pytest.fixture
def file(tmp_path: Path) -> Path:
    return tmp_path / "combinations.toml"


def edit(path: Path, *changes: tuple[str, str]) -> None:
    source = path.read_text()
    for old, new in changes:
        assert source.count(old) == 1, (old, source)
        source = source.replace(old, new)
    path.write_text(source)


def same(a: CombinationTable, b: CombinationTable) -> bool:
    return (a.entries, a.pairs) == (b.entries, b.pairs)


def test_what_is_written_is_read(boxing, file: Path):
    library, actions = boxing
    table = build_table(library, actions).with_pair("duck", "jab", -0.25)
    write_table(file, table)
    source = file.read_text()
    found = read_table(file, library, actions)
    assert same(found, table)
    assert np.array_equal(found.suitability, table.suitability)
    for again in (found, table, build_table(library, actions)):
        write_table(file, again)
        assert file.read_text() == source


def test_edits_survive(boxing, file: Path):
    library, actions = boxing
    table = build_table(library, actions)
    write_table(file, table)
    line = next(x for x in file.read_text().split("\n") if x.startswith("slip_left"))
    edit(
        file,
        (line, '# he leans\nslip_left = { positions = ["head"], directions = ["upwards"] } # so'),
        ("[defence]", "# all of them\n[defence]"),
    )
    pair = '\n# too risky\n[[pair]]\naction = "duck"\nopponent = "jab"  # his\nsuitability = -1\n'
    with file.open("a") as out:
        out.write(pair + "# the end\n")
    found = read_table(file, library, actions)
    duck, slip, jab = (actions.label.index(x) for x in ("duck", "slip_left", "jab"))
    assert found.suitability[duck, jab] == -1.0
    assert said(found.annotations, slip) == ({HEAD}, {UPWARDS})
    write_table(file, table)  # a new analysis
    again = read_table(file, library, actions)
    assert same(again, found)
    source = file.read_text()
    for comment in ("# he leans\n# so\nslip_left =", "# all of them\n[defence]", "# the end"):
        assert comment in source
    assert "# too risky\n# his\n[[pair]]" in source
    write_table(file, again)
    assert file.read_text() == source
    write_table(file, table, keep=False)
    assert "pair]]\naction" not in file.read_text()


def test_a_label_by_hand_rules_its_actions_but_those_with_a_line(boxing, file: Path):
    """Deleting the line of a single action puts it back under its label's, for good."""
    library, actions = boxing
    label = tuple("punch" if x in ("jab", "cross", "jab_low") else x for x in actions.label)
    actions = replace(actions, label=label)
    write_table(file, build_table(library, actions))
    lines = file.read_text().split("\n")
    single = [x for x in lines if x.startswith('"punch@')]
    assert len(single) >= 1  # the low one differs
    whole = next(x for x in lines if x.startswith("punch ="))
    edit(file, (whole, 'punch = { positions = ["lower torso"], directions = [] }'))
    edit(file, *((x + "\n", "") for x in single))
    write_table(file, build_table(library, actions))
    assert '"punch@' not in file.read_text()
    found = read_table(file, library, actions)
    assert all(said(found.annotations, k) == ({LOWER}, set()) for k in found.find("punch"))


def test_lines_of_actions_that_are_no_more(boxing, file: Path):
    """One that a program wrote goes; one of a person's is told, and nothing is written."""
    library, actions = boxing
    write_table(file, build_table(library, actions))
    fewer = replace(actions, label=tuple("dip" if x == "duck" else x for x in actions.label))
    assert read_table(file, library, fewer).find("dip").tolist() == [actions.label.index("duck")]
    line = next(x for x in file.read_text().split("\n") if x.startswith("duck"))
    edit(file, (line, line.replace('"head", ', "")))
    source = file.read_text()
    for write in (False, True):
        with pytest.raises(KumiteError) as error:
            if write:
                write_table(file, build_table(library, fewer))
            else:
                read_table(file, library, fewer)
        number = next(n for n, x in enumerate(source.split("\n"), 1) if x.startswith("duck"))
        assert str(error.value).startswith(f"{file}:{number}: unknown defence 'duck'")
    assert file.read_text() == source


@pytest.mark.parametrize(
    ("text", "line", "message"),
    [
        ("[defence]\nduk = { positions = [], directions = [] }", 2, "did you mean 'duck'"),
        ("[attack]\nduck = { positions = [], directions = [] }", 2, "unknown attack 'duck'"),
        ('[defence]\nduck = { positions = ["knee"], directions = [] }', 2, "'head'"),
        ("[defence]\nduck = { position = [], directions = [] }", 2, "unknown key"),
        ("[parry]\n", 1, "unknown key 'parry'; expected one of attack, defence, pair"),
        ('[[pair]]\naction = "duck"\nopponent = "jba"\nsuitability = 1', 3, "did you mean 'jab'"),
        ('[[pair]]\naction = "duck"\nopponent = "jab"\nsuitability = nan', 4, "finite"),
        ('[[pair]]\naction = "duck"\nopponent = "jab"', 1, "missing"),
        (
            '[[pair]]\naction="duck"\nopponent="jab"\nsuitability=1\n' * 2,
            5,
            "for the second time",
        ),
        ("[defence\n", 1, "not TOML"),
    ],
)
def test_what_is_wrong_is_told_with_its_line(boxing, file: Path, text: str, line: int, message):
    file.write_text(text)
    with pytest.raises(KumiteError) as error:
        read_table(file, *boxing)
    assert message in str(error.value)
    assert str(error.value).startswith(f"{file}:{line}: ")


def test_every_wrong_line_is_told_at_once(boxing, file: Path):
    file.write_text(
        "[defence]\nduk = { positions = [], directions = [] }\n"
        '[[pair]]\naction = "slip"\nopponent = "hook"\nsuitability = 1\n'
    )
    with pytest.raises(KumiteError) as error:
        read_table(file, *boxing)
    assert [x.split(":")[1] for x in str(error.value).split("\n")] == ["2", "4", "5"]


words = st.text(st.characters(exclude_categories=["Cs", "Cc"]), min_size=1, max_size=8)


@given(words, words, st.floats(allow_nan=False, allow_infinity=False))
@settings(max_examples=60, deadline=None)
def test_any_label_and_number_comes_back(boxing, tmp_path_factory, one: str, two: str, value):
    library, actions = boxing
    label = list(actions.label)
    label[actions.label.index("duck")], label[actions.label.index("jab")] = one, two
    actions = replace(actions, label=tuple(label))
    table = build_table(library, actions).with_pair(one, two, value)
    path = tmp_path_factory.mktemp("any") / "table.toml"
    write_table(path, table)
    found = read_table(path, library, actions)
    assert same(found, table)
    source = path.read_text("utf-8")
    write_table(path, found)
    assert path.read_text("utf-8") == source


def test_the_documents_example_is_a_table(boxing, file: Path):
    """docs/styles.md shows a file; it is read as it stands there."""
    [example] = blocks("toml", "docs/styles.md")
    library, actions = boxing
    straight = {"jab": "left_hand_straight", "left_uppercut": "left_hand_uppercut"}
    actions = replace(actions, label=tuple(straight.get(x, x) for x in actions.label))
    file.write_text(example)
    table = read_table(file, library, actions)
    duck, jab = table.find("duck")[0], table.find("left_hand_straight")[0]
    assert table.suitability[duck, jab] == 0.75
    assert table.suitability[duck, table.find("left_hand_uppercut")[0]] == -0.5
    assert sorted(e.action for e in table.entries if e.by_hand) == ["duck"]
