"""The page under touch and keys and with companion restarts: Chromium at the size of a phone."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

from companion.flight.dashboard.background_picture import BackgroundPicture
from companion.flight.landing.situation import Reply
from slz import Drawn, PointState
from tests.e2e.chromium import Chromium
from tests.e2e.shown import Shown, report
from tests.unit.companion.flight.dashboard.test_background_picture import FRAME, small
from tests.unit.companion.flight.dashboard.test_map_blocks import tile

pytestmark = pytest.mark.browser

CENTRE = "[slz.bird.centre[0], slz.bird.centre[1], slz.bird.scale]"
ZONE = (
    "(z => { const [x, y] = slz.bird.place(z.best[0], z.best[1]),"
    " b = slz.bird.canvas.getBoundingClientRect(), r = devicePixelRatio;"
    " return [b.x + x / r, b.y + y / r]; })(slz.model.near()[0])"
)
# Of the outline of any zone on a grey, by its line or by the halo around it, which covers 0.55 (WCAG 2.1).
LEAST_CONTRAST = (
    "(async (grey) => { const { STYLE } = await import('/static/zones.js');"
    " const light = (c) => { const [r, g, b] = c.map((v) => v / 255)"
    ".map((v) => (v <= 0.04045 ? v / 12.92 : ((v + 0.055) / 1.055) ** 2.4));"
    " return 0.2126 * r + 0.7152 * g + 0.0722 * b + 0.05; };"
    " const under = light([grey, grey, grey]);"
    " const rgb = (hex) => [1, 3, 5].map((at) => parseInt(hex.slice(at, at + 2), 16));"
    " const ratio = (c) => Math.max(light(c) / under, under / light(c));"
    " return Math.min(...Object.values(STYLE).map(({ line, halo }) =>"
    " Math.max(ratio(rgb(line)), ratio(rgb(halo).map((v) => 0.55 * v + 0.45 * grey))))); })"
)
MIDDLE = (195.0, 320.0)  # of the map on a phone


@pytest.fixture
def phone(chromium: Path) -> Iterator[Chromium]:
    with Chromium(chromium, 390, 844, phone=True) as made:
        yield made
        assert made.errors == []


@pytest.fixture
def shown() -> Iterator[Shown]:
    with Shown() as made:
        made.board.set_report(report(), 12.0)
        yield made


def opened(browser: Chromium, shown: Shown) -> None:
    browser.open(shown.url)
    browser.until(
        "slz.model.near().length && slz.model.state && slz.bird._fitted"
        " && document.getElementById('answer').dataset.hint !== undefined"  # its line moves the map
    )


def test_a_finger_moves_the_map_by_as_much_as_itself(phone: Chromium, shown: Shown) -> None:
    opened(phone, shown)
    before = phone.script(CENTRE)
    phone.drag([MIDDLE], [(MIDDLE[0] + 60, MIDDLE[1] - 40)])
    east, north, scale = phone.script(CENTRE)
    assert east == pytest.approx(before[0] - 60 / scale, abs=0.05)
    assert north == pytest.approx(before[1] - 40 / scale, abs=0.05)
    assert scale == before[2]
    assert phone.script("slz.bird.follow") is False
    assert phone.script("slz.model.picked") is None


def test_the_background_picture_lies_where_it_is_dimmed_and_can_be_switched_off(
    phone: Chromium, tmp_path: Path
) -> None:
    """White, 64 m by 64 m, north-east of the origin; what is drawn over it keeps a contrast of 3:1."""
    shown = Shown()
    shown.front.background = BackgroundPicture(small(tmp_path / "aerial.tif", [255, 255, 255]))
    shown.board.set_report(replace(report(), frame=FRAME), 12.0)
    with shown:
        opened(phone, shown)
        shade = (
            "((e, n) => slz.bird.canvas.getContext('2d', { willReadFrequently: true })"
            ".getImageData(...slz.bird.place(e, n).map(Math.round), 1, 1).data[0])"
        )
        phone.script("slz.bird.follow = false, slz.bird.centre = [32, 32], slz.bird.scale = 4")
        phone.until(f"{shade}(50, 50) > 60")
        within, beyond = ((60, 4), (60, 60), (4, 60)), ((-4, 40), (40, -4), (69, 40), (40, 69))
        assert [phone.script(f"{shade}{place} > 60") for place in within] == [True] * 3
        assert [phone.script(f"{shade}{place} < 30") for place in beyond] == [True] * 4
        assert phone.script(f"{LEAST_CONTRAST}({shade}(50, 50))") >= 3
        phone.click_on("#picture")
        phone.until(f"{shade}(50, 50) < 30")
        assert phone.script("document.getElementById('elsewhere').hidden")
        phone.click_on("#picture")
        shown.state = {**shown.state, "east_m": 200.0}
        phone.until("!document.getElementById('elsewhere').hidden")
        assert "aerial.tif lies elsewhere" in phone.script("document.getElementById('elsewhere').innerText")
        legend = phone.script("document.getElementById('legend').textContent")
        assert "picture: aerial.tif, of unknown date" in legend


def test_two_fingers_zoom_about_what_is_between_them(phone: Chromium, shown: Shown) -> None:
    opened(phone, shown)
    x, y = MIDDLE
    at = (
        f"(b => slz.bird.unplace(({x} - b.x) * devicePixelRatio, ({y} - b.y) * devicePixelRatio))"
        "(slz.bird.canvas.getBoundingClientRect())"
    )
    between, scale = phone.script(at), phone.script(CENTRE)[2]
    phone.drag([(x - 40, y), (x + 40, y)], [(x - 80, y), (x + 80, y)])
    assert phone.script(CENTRE)[2] == pytest.approx(2 * scale, rel=0.02)
    assert phone.script(at) == pytest.approx(between, abs=0.3)
    phone.drag([(x - 80, y), (x + 80, y)], [(x - 40, y), (x + 40, y)])
    assert phone.script(CENTRE)[2] == pytest.approx(scale, rel=0.04)
    assert phone.script("slz.model.picked") is None


def test_a_tap_picks_a_zone_also_after_a_pinch_that_the_system_took_away(
    phone: Chromium, shown: Shown
) -> None:
    opened(phone, shown)
    x, y = MIDDLE
    phone.touch("touchStart", [(x - 40, y), (x + 40, y)])
    phone.touch("touchCancel", [])
    phone.tap(*phone.script(ZONE))
    phone.until("slz.model.picked?.zone?.id === 1 && !document.getElementById('select').disabled")
    phone.tap_on("#select")
    phone.until("document.getElementById('answer').textContent.includes('selected')")
    assert shown.clerk.done() == ["select_zone"]


def test_a_finger_turns_the_pilots_view_and_two_bring_it_nearer(phone: Chromium, shown: Shown) -> None:
    opened(phone, shown)
    phone.tap_on("[data-show=pilot]")
    phone.until("slz.pilot.frames > 2")
    phone.drag([MIDDLE], [(MIDDLE[0] + 60, MIDDLE[1])])
    yaw = phone.script("slz.pilot.look.yaw")
    assert yaw == pytest.approx(21, abs=0.5)
    x, y = MIDDLE
    phone.drag([(x - 40, y), (x + 40, y)], [(x - 80, y), (x + 80, y)])
    assert phone.script("slz.pilot.look.zoom") == pytest.approx(0.5, rel=0.02)
    assert phone.script("slz.pilot.look.yaw") == yaw


def test_abort_is_one_tap_away_whatever_is_open(phone: Chromium, shown: Shown) -> None:
    opened(phone, shown)
    phone.tap_on("#legend summary")
    phone.until("document.getElementById('legend').open")
    phone.tap_on("#abort")
    phone.until("document.getElementById('answer').textContent === 'noted'")
    for view in ("pilot", "more", "map"):
        phone.tap_on(f"[data-show={view}]")
        phone.tap_on("#abort")
    phone.script(
        "slz.link.order({ do: 'facts', east_m: 0, north_m: 0 })"
    )  # answered after what was sent before
    assert shown.clerk.done() == ["abort"] * 4


def test_what_begins_a_landing_is_held_by_finger_mouse_or_key(phone: Chromium, shown: Shown) -> None:
    """A tap, a click and a key that is pressed once begin nothing; the hold says so."""
    shown.board.set_report(report(selected=True), 12.0)
    shown.state |= {"emergency": {"zone": 1, "seconds": 22, "within_battery": True}}
    opened(phone, shown)
    phone.until("[...document.querySelectorAll('.hold')].every((button) => !button.disabled)")
    ways = [("#confirm", "finger"), ("#confirm", "mouse"), ("#best", "Enter"), ("#now", " ")]
    for selector, by in ways:
        phone.press_on(selector, by)
        timing = f"document.querySelector('{selector}').getAnimations()[0].effect.getTiming()"
        assert phone.script(timing)["duration"] >= 800
        phone.let_go(by)
        phone.until("document.getElementById('answer').textContent === 'hold it until it is full'")
    phone.script("slz.link.order({ do: 'facts', east_m: 0, north_m: 0 })")  # answered after what was sent
    assert shown.clerk.done() == []
    for selector, by in ways:
        phone.hold(selector, by)
        phone.until("document.getElementById('answer').textContent === 'noted'")
    assert shown.clerk.done() == ["confirm", "confirm", "land_best", "land_now"]


def test_all_alarms_at_once_leave_abort_on_the_screen(phone: Chromium, shown: Shown) -> None:
    opened(phone, shown)
    shown.board.set_report(report(selected=True, state=PointState.UNSAFE), 12.0)
    shown.state = {
        **shown.state, "lidar_ok": False, "east_m": None, "battery_low": True, "pipeline_failed": True,
        "blocked": True, "heard": False, "gps": "lost", "blind": "GPS lost", "past": {"verdict": 0.4},
    }  # fmt: skip
    phone.until("document.querySelectorAll('.alarm').length === 2")  # the gravest, in one line each
    phone.tap_on("#alarms .more")
    phone.until("document.querySelectorAll('.alarm').length === 7")
    assert phone.script("document.getElementById('soonest').textContent") == "not now: GPS lost"
    assert phone.script("['confirm', 'best', 'now'].every((id) => document.getElementById(id).disabled)")
    phone.tap_on("#abort")
    phone.until("document.getElementById('answer').textContent === 'noted'")
    assert shown.clerk.done() == ["abort"]


LANDING = {"lat": 47.1, "lon": 8.2, "zone": 1, "off_point_m": 0.12}


@pytest.mark.parametrize("next_is", ["a tap", "a flight"])
def test_a_landing_is_summed_up_until_the_next_flight_or_a_tap(
    phone: Chromium, shown: Shown, next_is: str
) -> None:
    """Where, how far off, what was refused or broken off since the landing before, and the recording."""
    for severity, text in ((4, "abort: LiDAR lost"), (5, "landed, 0.30 m off the point"), (6, "surveying")):
        shown.board.add_text(f"SLZ: {text}", severity)
    for severity, text in ((4, "abort: point unsafe"), (5, "landed, 0.12 m off the point")):
        shown.board.add_text(f"SLZ: {text}", severity)
    opened(phone, shown)
    shown.clerk.reply = Reply(False, "no zone 1")
    phone.hold("#best", "finger")
    phone.until("document.getElementById('answer').textContent === 'no zone 1'")
    flying = dict(shown.state)
    shown.board.health = {"landing": LANDING, "recording": {"name": "flight.mcap", "ended": ""}}
    shown.state |= {"phase": "landed", "on_ground": True, "armed": False}
    phone.until("document.getElementById('controls') !== null")
    words = phone.script("document.getElementById('choice').innerText")
    for said in ("Landed · zone 1", "0.12 m off the point", "47.100000, 8.200000", "flight.mcap"):
        assert said in words
    assert "abort: point unsafe" in words
    assert "refused: no zone 1" in words
    assert "LiDAR lost" not in words  # that was the flight before
    offered = (
        "[...document.querySelectorAll('#acts button')]"
        ".filter((each) => each.getBoundingClientRect().width > 0).map((each) => each.id)"
    )
    assert phone.script(offered) == ["abort"]
    if next_is == "a tap":
        phone.tap_on("#controls")
    else:
        shown.state = flying
    phone.until(f"{offered}.length === 5 && document.getElementById('controls') === null")


# Phone, the same with a keyboard, tablet, 200 % of zoom, small and large screens.
SIZES = [
    *((320, 480), (390, 844), (390, 430), (844, 390), (820, 1180)),
    *((720, 430), (1024, 600), (1440, 860), (2560, 1440)),
]
AXE = (Path(__file__).parent / "axe_core" / "axe.min.js").read_text("utf-8")  # of npm's axe-core 4.14.1
AUDITED = [(390, 844), (1440, 860)]
SERIOUS = (
    "axe.run().then(({violations}) => violations.filter((one) =>"
    " ['serious', 'critical'].includes(one.impact))"
    ".map((one) => [one.id, one.nodes.map((node) => node.target.join(' '))]))"
)
IN_SIGHT = (
    "(() => { const h = innerHeight, w = innerWidth, seen = {};"
    " for (const [name, at] of [['abort', '#abort'], ['phase', '#phase'], ['badge', '#choice .badge']]) {"
    " const b = document.querySelector(at).getBoundingClientRect();"
    " const [x, y] = [b.x + b.width / 2, b.y + b.height / 2];"
    " const top = document.elementFromPoint(x, y);"
    " seen[name] = b.top >= 0 && b.left >= 0 && b.bottom <= h + 0.5 && b.right <= w + 0.5 && b.width > 20"
    " && Boolean(top?.closest(at)); }"
    " seen.numbers = [...document.querySelectorAll('#numbers > div')].every((each, i) => i === 0"
    " || each.scrollWidth <= each.clientWidth + 1);"
    " const c = document.getElementById('map').getBoundingClientRect();"
    " seen.map = document.body.dataset.view !== 'map' || (c.width >= 120 && c.height >= 40);"
    " return Object.entries(seen).filter(([, yes]) => !yes).map(([name]) => name); })()"
)


@pytest.mark.parametrize("trouble", ["none", "alarms", "all alarms open", "landed"])
def test_abort_phase_and_point_are_in_sight_at_every_size(chromium: Path, shown: Shown, trouble: str) -> None:
    """What stops the landing, what it does and where it goes to: not covered, not below the edge."""
    shown.board.set_report(report(selected=True, state=PointState.UNSAFE), 12.0)
    if trouble == "landed":
        shown.state |= {"phase": "landed", "on_ground": True, "armed": False}
        shown.board.health = {
            "landing": LANDING,
            "recording": {"name": "flight.mcap", "size_mb": 1, "ended": ""},
        }
    if "alarms" in trouble:
        shown.board.add_text("SLZ: LiDAR lost: take over", 2)
        shown.state |= {"heard": False, "battery_low": True, "pipeline_failed": True, "blocked": True}
    with Chromium(chromium, 1440, 860) as browser:
        opened(browser, shown)
        if trouble == "all alarms open":
            browser.until("document.querySelector('#alarms .more') !== null")
            browser.click_on("#alarms .more")
        if trouble == "landed":
            browser.until("document.body.classList.contains('landed')")
        browser.script(f"{AXE}; 0")
        out, serious = {}, {}
        for theme, sizes in (("light", AUDITED), ("dark", SIZES)):  # on which a layout does not depend
            browser.theme(theme)
            browser.until(f"document.documentElement.dataset.theme === '{theme}'")
            for width, height in sizes:
                browser.size(width, height, phone=width < 900)
                frames = browser.script("slz.bird.frames")
                browser.until(
                    f"innerWidth === {width} && slz.bird.frames > {frames} + 2"
                )  # it knows its size
                out[width, height, theme] = browser.script(IN_SIGHT)
                if (width, height) in AUDITED:
                    serious[width, theme] = browser.script(SERIOUS)
        covered = {"map"} if trouble == "all alarms open" else set()  # once opened, they cover the map
        out = {size: {*hidden} - covered for size, hidden in out.items()}
        assert not {size: hidden for size, hidden in out.items() if hidden}
        assert serious == {size: [] for size in serious}
        assert browser.errors == []


@pytest.mark.parametrize("field", ["#abort", "#filter", "[data-name=survey_s]", "[data-name=mode]"])
def test_the_abort_key_works_wherever_no_letters_are_written(
    phone: Chromium, shown: Shown, field: str
) -> None:
    opened(phone, shown)
    phone.tap_on("[data-show=more]")
    phone.tap_on("[data-sheet=params]")
    phone.script(f"document.querySelector('{field}')?.focus()")
    phone.press("A" if field == "[data-name=survey_s]" else "a")  # with caps lock on
    phone.press("Tab")
    if field == "#filter":
        assert phone.script("document.querySelector('#filter').value") == "a"
    else:
        phone.until("document.getElementById('answer').textContent === 'noted'")
    assert shown.clerk.done() == ([] if field == "#filter" else ["abort"])


def test_a_page_that_stayed_open_believes_nothing_of_the_run_before(phone: Chromium) -> None:
    """The companion is started anew: its messages and maps are numbered from one again."""
    with Shown() as first:
        for number in range(5):
            first.board.add_text(f"SLZ: old {number}", 2)
        opened_on = first.front.address.port
        phone.open(first.url)
        phone.until("document.querySelector('.alarm button') !== null")
        phone.tap_on(".alarm button")
        phone.until("!document.querySelector('.alarm button')")
    phone.until("slz.link.stale")
    with Shown(opened_on) as second:
        second.board.add_text("SLZ: new and grave", 2)
        phone.until("document.querySelector('.alarm.said')?.textContent.includes('new and grave')")
        assert phone.script("slz.model.texts.length") == 1
    phone.errors[:] = [text for text in phone.errors if "ERR_CONNECTION" not in text]


def test_a_companion_that_hangs_is_shown_as_silent(phone: Chromium, shown: Shown) -> None:
    opened(phone, shown)
    phone.tap(*phone.script(ZONE))
    phone.until("!document.getElementById('select').disabled")
    shown.hang()
    phone.until("!document.getElementById('stale').hidden && document.getElementById('select').disabled")
    assert phone.script("document.getElementById('abort').disabled") is False


def test_the_legend_names_all_that_the_map_may_show_and_remembers_a_tap(
    phone: Chromium, shown: Shown
) -> None:
    opened(phone, shown)
    is_open = "document.getElementById('legend').open"
    assert phone.script(is_open) is False  # the map of a phone is small
    phone.tap_on("#legend summary")
    phone.until(is_open)
    named = phone.script("[...document.querySelectorAll('#legend div div')].map((each) => each.innerText)")
    assert {
        "largest zone", "less certain", "uncertain", "zone of the far map", "zone not judged now",
        "safe when surveyed", "ground", "far ground", "unknown: never seen", "landing point",
        "landing point unsafe", "moving, in 2 s", "wire", "fence", "obstacle", "way in blocked",
    } <= {*named}  # fmt: skip
    phone.reload()
    opened(phone, shown)
    assert phone.script(is_open) is True


CONTRASTS = Path(__file__).with_name("contrasts.js").read_text("utf-8")


def test_words_zones_and_outlines_stand_out_in_both_themes_and_the_switch_is_remembered(
    chromium: Path, shown: Shown
) -> None:
    """4.5:1 for words, 3:1 for zones and outlines on ground in any light (WCAG 2.2, 1.4.3 and 1.4.11)."""
    shown.board.set_report(report(selected=True), 12.0)
    shown.board.add_text("SLZ: LiDAR lost: take over", 2)
    shown.state |= {"heard": False, "battery_low": True}
    shown.board.health = {"recording": None}
    with Chromium(chromium, 1440, 860) as browser:
        for theme in ("light", "dark"):
            browser.theme(theme)
            opened(browser, shown)
            assert browser.script("document.documentElement.dataset.theme") == theme
            for sheet in ("log", "health", "params", "zones"):
                browser.click_on(f"[data-sheet={sheet}]")
                least = browser.script(CONTRASTS)
                assert len(least) > 40
                weak = {k: v for k, v in least.items() if v < (4.5 if k.startswith("text") else 3.0)}
                assert not weak, (theme, sheet)
        browser.click_on("#theme")
        browser.reload()
        opened(browser, shown)
        assert (
            browser.script("document.documentElement.dataset.theme") == "light"
        )  # whatever the system wants
        assert browser.errors == []


PLATES = """(() => {
  const pen = slz.bird.canvas.getContext('2d');
  const [round, fill] = [pen.roundRect.bind(pen), pen.fillText.bind(pen)];
  window.plates = [], window.words = {};
  pen.roundRect = (...box) => { window.plates.push(box); round(...box); };
  pen.fillText = (text, x, y) => { window.words[text] = [x, y]; fill(text, x, y); };
})()"""


def test_labels_leave_the_vehicle_and_the_wind_free(chromium: Path, shown: Shown) -> None:
    with Chromium(chromium, 1440, 860) as browser:
        opened(browser, shown)
        for at in ((10.0, 10.0), (10.0, 13.0), (13.0, 10.0)):
            shown.state |= {"east_m": at[0], "north_m": at[1]}
            browser.until(
                f"Math.hypot(slz.model.pose().east - {at[0]}, slz.model.pose().north - {at[1]}) < 0.01"
            )
            browser.script(PLATES)
            browser.until("window.plates.length > 1")
            west, north, width, height = browser.script("window.plates.at(-1).slice(0, 4)")
            x, y = browser.script(f"slz.bird.place({at[0]}, {at[1]})")
            assert not (west < x < west + width and north < y < north + height)
        shown.board.set_report(report(selected=True), 12.0)
        shown.state |= {"wind": {"from_deg": 0, "speed_ms": 6.0, "gust_ms": 8.0, "source": "autopilot"}}
        browser.until("slz.model.selected() && slz.model.state.wind")
        browser.script(PLATES)
        clear = "Object.entries(window.words).find(([text]) => text.startsWith('clear'))"
        browser.until(clear)
        _, (x, y) = browser.script(clear)
        east, north = browser.script("slz.bird.place(10, 10)")
        assert abs(x - east) > 20 or y > north  # not upwind, where the arrow is
        assert browser.errors == []


def test_far_ground_looks_different_and_is_left_out_where_the_near_map_knows_it(
    chromium: Path, shown: Shown
) -> None:
    pixel = (
        "(([x, y]) => [...slz.bird.canvas.getContext('2d').getImageData(x - 12, y - 12, 24, 24).data])"
        "(slz.bird.place({}, {}).map(Math.round))"
    )
    level = tile().layers | {"height_m": np.full((64, 64), 5.0, np.float32)}
    maps = [
        ("near", Drawn(1, -50.0, -60.0, 0.2, (replace(tile(), layers=level),), (), 0)),
        ("far", Drawn(2, -50.0, -60.0, 0.8, (replace(tile(), layers=level),), (), 0)),
    ]
    with Chromium(chromium, 1440, 860) as browser:
        opened(browser, shown)
        browser.script("slz.bird.follow = false, slz.bird.centre = [-35, -45], slz.bird.scale = 10")
        seen = []
        for each in maps:
            shown.board.map_changes.append(each)
            browser.until(f"[...slz.sheets.sheets.{each[0]}.blocks.values()].some((block) => block.canvas)")
            frames = browser.script("slz.bird.frames")
            browser.until(f"slz.bird.frames > {frames} + 1")
            seen.append([browser.script(pixel.format(*place)) for place in ((-44, -54), (-25, -35))])
        (near, unseen), (covered, far) = seen
        assert near == covered
        assert far not in (near, unseen)
        assert browser.errors == []
