"""Driver of Debian's headless Chromium over its debugging protocol."""

from __future__ import annotations

import base64
import json
import shutil
import subprocess
import tempfile
import time
import urllib.request
from contextlib import ExitStack
from pathlib import Path
from typing import Any, Self

from websockets.sync.client import connect

START_S = 30.0
WAIT_S = 30.0
FLAGS = (
    "--headless=new",
    "--no-sandbox",
    "--disable-quic",
    "--no-first-run",
    "--disable-background-networking",
    "--disable-component-update",
    "--disable-sync",
    "--hide-scrollbars",
    "--remote-debugging-port=0",
    "--use-angle=swiftshader",
    "--enable-unsafe-swiftshader",
    "--disable-gpu-rasterization",
    "--disable-accelerated-2d-canvas",
)


class Chromium:
    """One browser with one page; a context manager that ends it.

    Attributes
    ----------
    errors
        What scripts threw and consoles complained of.
    """

    def __init__(self, program: Path, width: int = 1440, height: int = 860, *, phone: bool = False) -> None:
        self._folder = Path(tempfile.mkdtemp(prefix="slz-chromium-"))
        command = [str(program), *FLAGS, f"--user-data-dir={self._folder}", "about:blank"]
        self._process = subprocess.Popen(
            command, stdin=subprocess.DEVNULL, stdout=subprocess.DEVNULL, stderr=subprocess.DEVNULL
        )
        self._number = 0
        self.errors: list[str] = []
        self._stack = ExitStack()
        self._stack.callback(self._end)
        try:
            self._channel = self._stack.enter_context(connect(self._address(), max_size=None, proxy=None))
            for domain in ("Page", "Runtime", "Log"):
                self.call(f"{domain}.enable")
            self.size(width, height, phone=phone)
            self.theme("dark")
        except BaseException:
            self._stack.close()
            raise

    def __enter__(self) -> Self:
        return self

    def __exit__(self, *_: object) -> None:
        self._stack.close()

    def size(self, width: int, height: int, *, phone: bool = False) -> None:
        """Give the page another size; a phone has touch and two pixels a unit."""
        scale = 2 if phone else 1
        metrics = {"width": width, "height": height, "deviceScaleFactor": scale, "mobile": phone}
        self.call("Emulation.setDeviceMetricsOverride", **metrics)
        self.call("Emulation.setTouchEmulationEnabled", enabled=phone)

    def theme(self, wish: str) -> None:
        """Let the page believe that its user wants "light" or "dark"."""
        self.call("Emulation.setEmulatedMedia", features=[{"name": "prefers-color-scheme", "value": wish}])

    def open(self, url: str) -> None:
        """Go to a page."""
        self.call("Page.navigate", url=url)

    def reload(self) -> None:
        """Load the page again."""
        self.call("Page.reload")

    def script(self, text: str) -> Any:
        """Return the value of an expression in the page."""
        found = self.call("Runtime.evaluate", expression=text, returnByValue=True, awaitPromise=True)
        if "exceptionDetails" in found:
            raise RuntimeError(str(found["exceptionDetails"].get("exception", {}).get("description")))
        return found["result"].get("value")

    def until(self, text: str, limit_s: float = WAIT_S) -> Any:
        """Wait until an expression is true; return its value."""
        end = time.monotonic() + limit_s
        while time.monotonic() < end:
            try:
                if found := self.script(text):
                    return found
            except RuntimeError:
                pass  # the page is loading
            time.sleep(0.05)
        raise AssertionError(f"never true in {limit_s:g} s: {text}; errors: {self.errors}")

    def click(self, x: float, y: float) -> None:
        """Click at a place."""
        for kind in ("mousePressed", "mouseReleased"):
            self.call("Input.dispatchMouseEvent", type=kind, x=x, y=y, button="left", clickCount=1)

    def click_on(self, selector: str) -> None:
        """Click in the middle of an element."""
        self.click(*self.middle(selector))

    def hold(self, selector: str, by: str = "mouse") -> None:
        """Hold a button until it is full: by mouse, finger or the name of a key, which has the focus then."""
        self.press_on(selector, by)
        fill = f"document.querySelector({json.dumps(selector)}).getAnimations()[0]"
        finish = "fill.addEventListener('finish', done); fill.finish();"
        self.script(f"new Promise((done) => {{ const fill = {fill}; {finish} }})")
        self.let_go(by)

    def press_on(self, selector: str, by: str) -> None:
        """Press a button by mouse, finger or a key, and wait until it fills."""
        x, y = self.middle(selector)
        if by == "mouse":
            self.call("Input.dispatchMouseEvent", type="mousePressed", x=x, y=y, button="left", clickCount=1)
        elif by == "finger":
            self.touch("touchStart", [(x, y)])
        else:
            self.script(f"document.querySelector({json.dumps(selector)}).focus()")
            self.call("Input.dispatchKeyEvent", type="keyDown", key=by)
        self.until(f"document.querySelector({json.dumps(selector)}).getAnimations().length === 1")

    def let_go(self, by: str) -> None:
        """Let go of what is pressed."""
        if by == "mouse":
            self.call("Input.dispatchMouseEvent", type="mouseReleased", x=0, y=0, button="left", clickCount=1)
        elif by == "finger":
            self.touch("touchEnd", [])
        else:
            self.call("Input.dispatchKeyEvent", type="keyUp", key=by)

    def middle(self, selector: str) -> tuple[float, float]:
        """Return where the middle of an element is, once that is the same for some frames."""
        x, y = self.script(
            "new Promise((done) => { let before = '', same = 0; const look = () => {"
            f" const b = document.querySelector({json.dumps(selector)}).getBoundingClientRect();"
            " const now = [b.x + b.width / 2, b.y + b.height / 2];"
            " same = String(now) === before ? same + 1 : 0; before = String(now);"
            " if (same > 3) done(now); else requestAnimationFrame(look); }; look(); })"
        )
        return x, y

    def touch(self, kind: str, points: list[tuple[float, float]]) -> None:
        """Let fingers do something: touchStart, touchMove, touchEnd, touchCancel; where they are now."""
        fingers = [{"x": x, "y": y, "id": number} for number, (x, y) in enumerate(points)]
        self.call("Input.dispatchTouchEvent", type=kind, touchPoints=fingers)

    def tap(self, x: float, y: float) -> None:
        """Tap at a place."""
        self.touch("touchStart", [(x, y)])
        self.touch("touchEnd", [])

    def tap_on(self, selector: str) -> None:
        """Tap in the middle of an element, on whatever lies there."""
        self.tap(*self.middle(selector))

    def drag(self, begin: list[tuple[float, float]], end: list[tuple[float, float]], steps: int = 8) -> None:
        """Put fingers down, move them, lift them."""
        self.touch("touchStart", begin)
        for step in range(1, steps + 1):
            share = step / steps
            self.touch(
                "touchMove",
                [
                    (a + share * (c - a), b + share * (d - b))
                    for (a, b), (c, d) in zip(begin, end, strict=True)
                ],
            )
        self.touch("touchEnd", [])

    def press(self, key: str) -> None:
        """Press a key."""
        for kind in ("keyDown", "keyUp"):
            self.call("Input.dispatchKeyEvent", type=kind, key=key, text=key if len(key) == 1 else "")

    def picture(self, path: Path) -> None:
        """Save what is to be seen."""
        path.write_bytes(base64.b64decode(self.call("Page.captureScreenshot", format="png")["data"]))

    def call(self, method: str, **parameters: Any) -> dict[str, Any]:
        """Call a method of the protocol and return its result."""
        self._number += 1
        self._channel.send(json.dumps({"id": self._number, "method": method, "params": parameters}))
        while True:
            message = json.loads(self._channel.recv(timeout=60))
            if message.get("id") == self._number:
                if "error" in message:
                    raise RuntimeError(f"{method}: {message['error']}")
                return dict(message["result"])
            self._note(message)

    # ---- parts ----------------------------------------------------------------------------------

    def _note(self, event: dict[str, Any]) -> None:
        if event.get("method") == "Runtime.exceptionThrown":
            self.errors.append(
                str(event["params"]["exceptionDetails"].get("exception", {}).get("description"))
            )
        elif event.get("method") == "Log.entryAdded" and event["params"]["entry"]["level"] == "error":
            entry = event["params"]["entry"]
            self.errors.append(f"{entry['text']} {entry.get('url', '')}".strip())

    def _address(self) -> str:
        file, end = self._folder / "DevToolsActivePort", time.monotonic() + START_S
        while not (file.exists() and len(file.read_text().split()) >= 2):
            if time.monotonic() > end or self._process.poll() is not None:
                raise RuntimeError("Chromium did not start")
            time.sleep(0.05)
        port = file.read_text().split()[0]
        with urllib.request.urlopen(f"http://127.0.0.1:{port}/json/list", timeout=START_S) as answer:
            pages = [target for target in json.load(answer) if target["type"] == "page"]
        return str(pages[0]["webSocketDebuggerUrl"])

    def _end(self) -> None:
        self._process.terminate()
        try:
            self._process.wait(10)
        except subprocess.TimeoutExpired:
            self._process.kill()
            self._process.wait()
        shutil.rmtree(self._folder, ignore_errors=True)
