"""Ways in and out and wind on the pilot's page, drawn by a real browser."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest

from slz import SAFE, UNKNOWN, UNSAFE, Corridors
from tests.e2e.chromium import Chromium
from tests.e2e.shown import Shown, report

POINT = np.array([10.0, 10.0, 0.0])
WIND = {"from_deg": 90, "speed_ms": 6.0, "gust_ms": 8.0, "source": "autopilot"}
# Colour of the bird's view at a bearing and a distance (pixels) from the landing point.
PIXEL = """((bearing, away) => {
  const b = slz.bird, a = bearing * Math.PI / 180, [x, y] = b.place(10, 10), k = away * devicePixelRatio;
  const at = [Math.round(x + k * Math.sin(a)), Math.round(y - k * Math.cos(a))];
  return [...b.canvas.getContext('2d').getImageData(...at, 1, 1).data].slice(0, 3);
})"""
# Colours of what the pilot's view hands to the graphics card.
TINTS = """((gl) => {
  const was = gl.bufferData.bind(gl);
  window.tints = new Set();
  gl.bufferData = (kind, data, use) => {
    const tint = (at) => [...data.slice(at, at + 3)].map((part) => Math.round(255 * part)).join();
    for (let at = 3; at + 3 < data.length; at += 7) window.tints.add(tint(at));
    was(kind, data, use);
  };
})(slz.pilot.gl)"""
WAYS, ARROW = ("61,220,132", "255,106,94", "213,221,228"), "255,225,77"  # clear, blocked, not seen
SAID = """((pen) => {
  const was = pen.fillText.bind(pen);
  window.said = [];
  pen.fillText = (text, ...at) => (window.said.push(text), was(text, ...at));
})"""


def corridors() -> Corridors:
    """Return ways clear in the north half but at 30 degrees only in the east, blocked south, unseen west."""
    states = np.full((72, 3), SAFE, np.uint8)
    states[27:45, :2] = UNSAFE
    states[45:63, :2] = UNKNOWN
    states[9:27, 0] = UNSAFE
    nothing = np.full((72, 3), np.nan)
    return Corridors(POINT, (10.0, 60.0, 90.0), states, np.zeros(72), nothing)


def reddish(pixel: list[int]) -> bool:
    return pixel[0] > 1.3 * pixel[1]


def greenish(pixel: list[int]) -> bool:
    return pixel[1] > 1.3 * pixel[0] and pixel[1] > 200  # lighter than a zone


def test_the_rose_and_the_wind_are_drawn_in_both_views(chromium: Path) -> None:
    with Shown() as shown, Chromium(chromium) as browser:
        browser.open(shown.url)
        browser.until("slz.model.state")
        browser.script("slz.bird.follow = false, slz.bird.centre = [10, 10], slz.bird.scale = 4")
        shown.state |= {"wind": WIND}
        shown.board.set_report(report(selected=True, corridors=corridors()), 20.0)
        browser.until("slz.model.selected()?.rose && slz.model.state.wind")
        frames = browser.script("slz.bird.frames")
        browser.until(f"slz.bird.frames > {frames} + 1 && slz.pilot.frames > 1")
        pixels = {b: browser.script(f"{PIXEL}({b}, 31)") for b in (0, 90, 182, 270)}
        assert greenish(pixels[0])
        assert greenish(pixels[90])
        assert reddish(pixels[182])
        assert not greenish(pixels[270])
        assert not reddish(pixels[270])
        assert greenish(browser.script(f"{PIXEL}(0, 45)"))  # a flat way's petal is longer than a steep one's
        assert not greenish(browser.script(f"{PIXEL}(90, 47)"))
        red, green, blue = browser.script(f"{PIXEL}(90, 72)")  # the arrow comes from the east
        assert min(red, green) > 200
        assert blue < 120
        browser.script(TINTS)
        browser.until(f"{[*WAYS, ARROW]}.every((tint) => window.tints.has(tint))")
        assert browser.errors == []


@pytest.mark.parametrize(("wind", "words"), [(WIND, "wind 6.0 m/s"), (None, "wind unknown")])
def test_the_wind_is_said_in_words_known_or_not(chromium: Path, wind: object, words: str) -> None:
    with Shown() as shown, Chromium(chromium) as browser:
        browser.open(shown.url)
        shown.state |= {"wind": wind}
        browser.until("slz.model.state && 'wind' in slz.model.state")
        for canvas in ("slz.bird.canvas", "slz.pilot.hud"):
            browser.script(f"{SAID}({canvas}.getContext('2d'))")
            assert browser.until(f"window.said.includes({words!r})")
