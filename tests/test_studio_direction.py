"""Fighters directed from the page: what is pressed and drawn there is what they go by."""

from __future__ import annotations

import numpy as np
import pytest
import viser

from kumite.control import CheckPoint, Route
from kumite.graph import Layer
from kumite.scene import SceneSettings, World, load_scene
from kumite.scene.events import CheckPointReached, Decision
from kumite.studio import Studio
from kumite.studio.paths import Path, Sketch, on_floor, sketched
from kumite.studio.ring import FOV
from kumite.studio.viewer import DIGIT
from tests import browser
from tests.browser import viewer_of
from tests.stranger import wait
from tests.test_studio_actions import _pick, _text


def fight(fighters: Layer, pairs: int = 1) -> World:
    """Boxing at depth 1, of so many pairs side by side."""
    settings = load_scene("boxing").model_dump(exclude_none=True)
    out = []
    for pair in range(pairs):
        for fighter in settings["fighter"]:
            name, against = (f"{fighter[key]}{pair or ''}" for key in ("name", "against"))
            x, z = fighter["position"]
            more = {"name": name, "against": against, "position": (x + 3.0 * pair, z), "depth": 1}
            out.append(fighter | more)
    return World(SceneSettings.model_validate(settings | {"fighter": out}), fighters, seed=1)


def test_where_a_ray_meets_the_floor():
    assert on_floor(np.array([1.0, 2.0, 3.0]), np.array([0.5, -1.0, 0.0])) == (2.0, 3.0)
    assert on_floor(np.array([1.0, 2.0, 3.0]), np.array([0.5, 0.1, 0.0])) is None


def test_a_sketch_is_seen_before_it_is_a_route():
    sketch = Sketch()
    assert sketched(sketch) == []
    sketch.begin(1)
    sketch.places += [(0.0, 0.0), (3.0, 0.0)]
    (path,) = sketched(sketch)
    assert path.who == 1 and path.route.places.tolist() == [[0.0, 0.0], [3.0, 0.0]]
    sketch.end()
    assert sketched(sketch) == []


def test_one_fighters_controls_are_shown_however_many_there_are(fighters: Layer):
    for pairs in (1, 4):
        stage = fight(fighters, pairs)
        studio = Studio(stage, port=0)
        try:
            sliders = viewer_of(studio).panel._sliders
            assert sliders is not None
            shown = {t.who for t in (sliders.tunables[name] for name in sliders.handles)}
            assert shown == {"", "red"} and len(sliders.handles) == 21
        finally:
            studio.close()


def test_routes_of_the_scene_are_on_the_floor_and_follow_what_is_told(fighters: Layer):
    stage = fight(fighters)
    stage.set_route("blue", Route((CheckPoint((0, 3)), CheckPoint((2, 3)))))
    studio = Studio(stage, port=0)
    try:
        shown, handles = studio._paths._shown, studio._paths._handles
        progress = stage.progress[1]
        assert progress is not None
        assert shown == {1: Path(1, progress.route, 0)} and len(handles[1]) == 2
        studio.direct(lambda: stage.set_route("red", Route((CheckPoint((0, 0)),))))
        studio.direct(lambda: stage.move_check_point("blue", 1, (4.0, 4.0)))
        studio._draw(studio._look(), 0.0)
        assert sorted(shown) == [0, 1] and len(handles[0]) == 1
        discs = handles[1][0]
        assert isinstance(discs, viser.BatchedMeshHandle)
        assert np.allclose(discs.batched_positions[1, [0, 2]], (4.0, 4.0))
        studio.direct(lambda: stage.set_route("blue", None))
        studio._draw(studio._look(), 0.0)
        assert sorted(shown) == sorted(handles) == [0]
    finally:
        studio.close()


@pytest.mark.slow
def test_a_path_is_drawn_dragged_and_cleared_with_the_mouse(fighters: Layer):
    stage = fight(fighters)
    studio = Studio(stage, port=0)
    studio.toggle()
    with browser.watching(studio) as (page, client):
        middle = stage.root_position.mean(axis=0) * [1, 0, 1]
        away = middle - (viewer_of(studio).on_stage(client.camera.position) * [1, 0, 1])
        away /= np.linalg.norm(away)
        aside = np.array([away[2], 0.0, -away[0]])
        places = [middle - 0.5 * away + s * aside for s in (-0.8, 0.0, 0.8)]  # before their feet

        def route() -> Route:
            assert stage.routes[0] is not None
            return stage.routes[0]

        def pixel(place: np.ndarray) -> tuple[float, float]:
            return browser.project(viewer_of(studio).seen_at(place), client.camera, page)

        def redness() -> np.ndarray:
            """Of each place, as it is seen."""
            image = browser.picture(page).astype(float)
            patches = [browser.around(image, pixel(p), 2) for p in places]
            return np.array([(x[..., 0] - x[..., 2]).mean() for x in patches])

        page.get_by_role("button", name="Finish").click()
        browser.wait_until(page, lambda: "no path is being drawn" in _text(page), "a refusal")
        browser.close_notes(page)
        page.get_by_label("Seconds", exact=True).fill("6")
        page.get_by_role("button", name="Draw path").click()
        browser.wait_until(page, lambda: "click on the floor" in _text(page), "drawing")
        plain = redness()
        for k, place in enumerate(places):
            page.mouse.click(*pixel(place))
            assert wait(lambda k=k: len(viewer_of(studio).own.sketch.places) == k + 1)
        assert stage.routes[0] is None  # not yet: it is being drawn
        page.get_by_role("button", name="Finish").click()
        assert wait(lambda: stage.routes[0] is not None)
        assert np.allclose(route().places, np.array(places)[:, [0, 2]], atol=0.03)
        times = [p.time or 0.0 for p in route().points]
        assert times == sorted(times) and times[-1] == pytest.approx(6.0)
        browser.wait_until(page, lambda: "3 check points, next 1" in _text(page), "the path")
        browser.wait_until(page, lambda: bool(np.all(redness() > plain + 40)), "red discs")

        goal = places[1] + 0.3 * aside + 0.1 * away
        browser.drag(page, pixel(places[1]), pixel(goal))
        assert wait(lambda: np.allclose(route().places[1], goal[[0, 2]], atol=0.1))
        progress = stage.progress[0]
        assert progress is not None and np.allclose(progress.route.places, route().places)
        assert wait(lambda: not studio._paths.held(client.client_id))
        assert [p.time for p in route().points] == times

        studio.set_speed(4.0)
        studio.toggle()
        browser.wait_until(
            page,
            lambda: any(
                isinstance(e, CheckPointReached) and e.character == "red" for e in stage.events
            ),
            "a check point",
            60,
        )
        page.get_by_role("button", name="Clear").click()
        assert wait(lambda: stage.routes[0] is None and stage.progress[0] is None)
        browser.wait_until(page, lambda: "no path" in _text(page), "no path")


@pytest.mark.slow
def test_weights_and_actions_are_told_on_the_page(fighters: Layer):
    stage = fight(fighters)
    red, blue = stage.players
    studio = Studio(stage, port=0)
    studio.toggle()
    with browser.watching(studio) as (page, _):
        for folder in ("Parameters", "Game tree · red", "Actions"):
            page.get_by_text(folder, exact=True).click()
        fields = [t.field for t in stage.tunables if t.who == "red"]

        def slider(field: str):
            return page.get_by_role("slider").nth(1 + fields.index(field))  # the first is Speed

        def nudge(field: str, key: str = "ArrowRight") -> None:
            slider(field).focus()
            page.keyboard.press(key)

        nudge("depth")
        assert wait(lambda: red.depth == 2) and blue.depth == 1
        nudge("taken", "ArrowLeft")
        assert wait(lambda: 8e4 < red.style.taken < 1e5)
        nudge("restlessness")
        assert wait(lambda: 15.0 < red.restlessness < 20.0)
        nudge("preferred_heading")
        assert wait(lambda: red.style.preferred_heading == pytest.approx(np.radians(1.8)))
        assert red.style.heading == 10.0
        browser.wait_until(page, lambda: "heading: 10 points/rad²" in _text(page), "its weight")

        for name in ("attack", "defence", "idle"):
            _pick(page, "A⁻ unwanted", name)
            assert wait(lambda name=name: name in red.unwanted)
        _pick(page, "A⁻ unwanted", "transition")
        browser.wait_until(page, lambda: "A⁻ holds every action" in _text(page), "a refusal")
        assert red.unwanted == ("attack", "defence", "idle")
        _pick(page, "A⁻ unwanted", "✓ defence")
        assert wait(lambda: red.unwanted == ("attack", "idle"))
        _pick(page, "A⁺ wanted", "transition")
        assert wait(lambda: red.wanted == ("transition",))
        _pick(page, "May do", "transition")
        assert wait(lambda: red.only == ("transition",))

        _pick(page, "Character", "blue")
        page.get_by_text("Game tree · blue", exact=True).click()
        browser.wait_until(
            page, lambda: slider("depth").get_attribute("aria-valuenow") == "1", "blue's depth"
        )
        assert page.get_by_label("May do", exact=True).first.input_value() == "—"
        nudge("depth")
        assert wait(lambda: blue.depth == 2) and red.depth == 2

        count = len(stage.events)
        studio.set_speed(4.0)
        studio.toggle()

        def decided() -> list:
            return [e for e in stage.events[count:] if isinstance(e, Decision)]

        browser.wait_until(
            page, lambda: sum(e.character == "red" for e in decided()) >= 5, "decisions", 60
        )
        for e in decided():
            if e.character == "red":
                inside = stage.tree.kinds[e.stretch] == "transition"
                assert inside != e.outside_set


@pytest.mark.slow
def test_what_a_page_draws_and_follows_is_its_own(fighters: Layer):
    """One page draws a path and goes away; the other one follows on, and never saw it."""
    stage = fight(fighters)
    studio = Studio(stage, port=0)
    studio.set_speed(0.5)
    with browser.watching(studio) as (page, client):
        mine = studio.viewers[client.client_id]
        with browser.open_page(studio.url + browser.HALF) as (other, _):
            assert wait(lambda: len(studio.viewers) == 2)
            hers = next(v for v in studio.viewers.values() if v is not mine)
            other.wait_for_selector("canvas")
            browser.let_draw(other)
            browser.close_notes(other)
            other.get_by_role("button", name="Draw path").click()
            browser.wait_until(other, lambda: hers.own.sketch.who == 0, "drawing")
            held = hers.own.follow.centre.copy()
            box = other.locator("canvas").first.bounding_box()
            assert box is not None
            for k in range(4):
                other.mouse.click(box["x"] + 150 + 60 * k, box["y"] + 0.85 * box["height"])
                browser.wait_until(
                    other, lambda k=k: len(hers.own.sketch.places) > k, f"click {k + 1}"
                )
            x, z = np.array(hers.own.sketch.places).T
            assert np.ptp(np.sign(np.diff(x) + np.diff(z))) == 0  # from left to right
            assert mine.own.sketch.who is None and np.array_equal(hers.own.follow.centre, held)
            assert not page.get_by_text("click on the floor; 4").count()
        assert wait(lambda: len(studio.viewers) == 1)
        before = mine.own.follow.centre.copy()
        studio.direct(lambda: stage.cast.anchor.__iadd__([2.0, 0.0, 0.0]))
        browser.wait_until(
            page, lambda: bool(mine.own.follow.centre[0] > before[0] + 1.0), "the picture to follow"
        )
        # The page says which picture it shows: of those that were sent, a late one.
        told = round((client.camera.fov - FOV) / DIGIT)
        assert told in {seen.number for seen in mine._pictures}
