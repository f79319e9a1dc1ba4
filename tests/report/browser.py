"""A real browser driven through its DevTools protocol: pages opened, pointed at, typed into."""

import base64
import itertools
import json
import os
import shutil
import subprocess
import sys
import tempfile
import time
from contextlib import contextmanager
from pathlib import Path

import pytest

NAMES = ("chromium", "chromium-browser", "google-chrome", "google-chrome-stable", "chrome")
PLACES = (
    "/Applications/Google Chrome.app/Contents/MacOS/Google Chrome",
    r"C:\Program Files\Google\Chrome\Application\chrome.exe",
)
FLAGS = (
    "--headless=new", "--no-sandbox", "--use-gl=angle", "--use-angle=swiftshader",
    "--enable-unsafe-swiftshader", "--no-first-run", "--disable-background-networking",
    "--disable-component-update", "--disable-sync", "--disable-extensions", "--hide-scrollbars",
    "--remote-debugging-port=0", "--remote-allow-origins=*",
)  # fmt: skip
KEYS = {
    "ArrowLeft": 37, "ArrowUp": 38, "ArrowRight": 39, "ArrowDown": 40, "Escape": 27, "Enter": 13,
    "Tab": 9, "Home": 36,
}  # fmt: skip


def find_browser():
    """The browser's program: PHEXFAB_BROWSER, or the first of the usual ones; else None."""
    asked = os.environ.get("PHEXFAB_BROWSER")
    found = [asked] if asked else [shutil.which(name) for name in NAMES]
    return next((path for path in (*found, *PLACES) if path and Path(path).exists()), None)


class Tab:
    """One page in the browser; input goes the way of a real mouse, finger and keyboard."""

    def __init__(self, socket):
        self.socket, self.numbers, self.errors, self.asked = socket, itertools.count(1), [], []
        for domain in ("Page", "Runtime", "Network", "Log"):
            self.call(f"{domain}.enable")

    def call(self, method, **params):
        number = next(self.numbers)
        self.socket.send(json.dumps({"id": number, "method": method, "params": params}))
        while True:
            message = json.loads(self.socket.recv(timeout=60))
            if message.get("id") == number:
                if "error" in message:
                    raise RuntimeError(f"{method}: {message['error']['message']}")
                return message["result"]
            self.heed(message)

    def heed(self, message):
        kind, params = message.get("method"), message.get("params", {})
        if kind == "Runtime.exceptionThrown":
            self.errors.append(json.dumps(params["exceptionDetails"])[:2000])
        elif kind == "Log.entryAdded" and params["entry"]["level"] == "error":
            self.errors.append(params["entry"]["text"])
        elif kind == "Network.requestWillBeSent":
            self.asked.append(params["request"]["url"])

    def js(self, expression):
        """The value of an expression, once its promise is kept."""
        made = self.call(
            "Runtime.evaluate", expression=expression, awaitPromise=True, returnByValue=True
        )
        if "exceptionDetails" in made:
            raise RuntimeError(json.dumps(made["exceptionDetails"])[:2000])
        return made["result"].get("value")

    def wait(self, expression, seconds=30):
        """Wait until an expression is true."""
        end = time.monotonic() + seconds
        while not self.js(f"Boolean({expression})"):
            if time.monotonic() > end:
                raise TimeoutError(f"{expression} stays false; {self.errors}")
            time.sleep(0.03)

    def show(self, width, height, touch=False, dark=False, calm=True):
        """Set the window's size, the kind of pointer, and what the reader prefers."""
        self.call(
            "Emulation.setDeviceMetricsOverride",
            width=width, height=height, deviceScaleFactor=1, mobile=touch,
        )  # fmt: skip
        self.call("Emulation.setTouchEmulationEnabled", enabled=touch)
        features = {
            "prefers-color-scheme": "dark" if dark else "light",
            "prefers-reduced-motion": "reduce" if calm else "no-preference",
        }
        self.call(
            "Emulation.setEmulatedMedia",
            features=[{"name": name, "value": value} for name, value in features.items()],
        )

    def open(self, path, fragment=""):
        self.errors.clear()
        self.asked.clear()
        self.call("Page.navigate", url="about:blank")
        self.call("Page.navigate", url=Path(path).as_uri() + fragment)
        self.wait("document.readyState === 'complete' && document.querySelector('header')")

    def mouse(self, kind, x, y, **more):
        self.call("Input.dispatchMouseEvent", type=f"mouse{kind}", x=x, y=y, **more)

    def click(self, x, y, count=1):
        self.mouse("Moved", x, y)
        for n in range(1, count + 1):
            for kind in ("Pressed", "Released"):
                self.mouse(kind, x, y, button="left", clickCount=n)

    def drag(self, start, stop, steps=3, button="left", modifiers=0):
        held = {"left": 1, "right": 2}[button]
        self.mouse("Moved", *start)
        self.mouse("Pressed", *start, button=button, clickCount=1, modifiers=modifiers)
        for k in range(1, steps + 1):
            at = [a + (b - a) * k / steps for a, b in zip(start, stop, strict=True)]
            self.mouse("Moved", *at, button=button, buttons=held, modifiers=modifiers)
        self.mouse("Released", *stop, button=button, clickCount=1, modifiers=modifiers)

    def wheel(self, x, y, delta):
        self.mouse("Wheel", x, y, deltaX=0, deltaY=delta)

    def touch(self, *moves):
        """Fingers put down at the first of the moves, moved to the others, and lifted."""
        kinds = ["touchStart"] + ["touchMove"] * (len(moves) - 1)
        for kind, fingers in zip(kinds, moves, strict=True):
            points = [{"x": x, "y": y, "id": k} for k, (x, y) in enumerate(fingers)]
            self.call("Input.dispatchTouchEvent", type=kind, touchPoints=points)
        self.call("Input.dispatchTouchEvent", type="touchEnd", touchPoints=[])

    def key(self, key, modifiers=0):
        code = KEYS.get(key, ord(key.upper()) if len(key) == 1 else 0)
        named = {"key": key, "windowsVirtualKeyCode": code, "modifiers": modifiers}
        text = {"text": key} if len(key) == 1 else {"text": "\r"} if key == "Enter" else {}
        self.call("Input.dispatchKeyEvent", type="keyDown", **named, **text)
        self.call("Input.dispatchKeyEvent", type="keyUp", **named)

    def type(self, text):
        for character in text:
            self.key(character)

    def picture(self, whole=False):
        """A PNG of the window, or of the whole page."""
        shot = self.call("Page.captureScreenshot", format="png", captureBeyondViewport=whole)
        return base64.b64decode(shot["data"])

    def middle(self, selector):
        """Where the middle of an element is, in CSS pixels of the window."""
        return self.js(
            f"(() => {{ const e = document.querySelector({json.dumps(selector)});"
            "e.scrollIntoView({block: 'nearest', behavior: 'instant'});"
            "const b = e.getBoundingClientRect();"
            " return [b.x + b.width / 2, b.y + b.height / 2] })()"
        )

    def press(self, selector):
        """Click the middle of an element."""
        self.click(*self.middle(selector))


@contextmanager
def browser():
    """Open a browser and yield its one tab; skip the test where there is none."""
    program = find_browser()
    if program is None:
        pytest.skip("no Chromium or Chrome here; install one, or name it in PHEXFAB_BROWSER")
    websockets = pytest.importorskip("websockets.sync.client", reason="pip install websockets")
    with tempfile.TemporaryDirectory(ignore_cleanup_errors=True) as profile:
        flags = [*FLAGS, f"--user-data-dir={profile}", "about:blank"]
        quiet = {"stdout": subprocess.DEVNULL, "stderr": subprocess.DEVNULL}
        process = subprocess.Popen(
            [program, *flags], start_new_session=sys.platform != "win32", **quiet
        )
        try:
            with websockets.connect(_address(Path(profile), process), max_size=2**28) as socket:
                yield Tab(socket)
                socket.send(json.dumps({"id": 0, "method": "Browser.close"}))
        finally:
            try:
                process.wait(10)
            except subprocess.TimeoutExpired:
                process.kill()


def _address(profile, process):
    """The address of the first tab, as soon as the browser listens."""
    import urllib.request

    port = profile / "DevToolsActivePort"
    end = time.monotonic() + 60
    while not (port.exists() and port.read_text().count("\n")):
        if process.poll() is not None or time.monotonic() > end:
            pytest.skip("the browser here does not start without a screen")
        time.sleep(0.05)
    number = port.read_text().splitlines()[0]
    direct = urllib.request.build_opener(urllib.request.ProxyHandler({}))
    with direct.open(f"http://127.0.0.1:{number}/json", timeout=30) as answer:
        tabs = json.loads(answer.read())
    return next(tab["webSocketDebuggerUrl"] for tab in tabs if tab["type"] == "page")
