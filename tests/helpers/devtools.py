"""A headless Chromium that a test drives by its DevTools protocol (chromedevtools.github.io/devtools-protocol)."""

from __future__ import annotations

import asyncio
import base64
import json
import shutil
import subprocess
import time
from pathlib import Path
from typing import Any
from urllib.request import urlopen

CHROMIUM = shutil.which("chromium")
_PATIENCE_S = 60.0


class Browser:
    """One tab of a browser of its own.

    Parameters
    ----------
    profile
        An empty folder for the browser's files.
    size
        Width and height of the page [px].
    """

    def __init__(self, profile: Path, size: tuple[int, int] = (1280, 900)) -> None:
        assert CHROMIUM is not None
        self.requested: list[str] = []
        self.errors: list[str] = []
        self._loop, self._sent = asyncio.new_event_loop(), 0
        options = ["--headless=new", "--no-sandbox", "--disable-gpu", "--remote-debugging-port=0", "--no-first-run"]
        self._process = subprocess.Popen(
            [CHROMIUM, *options, f"--user-data-dir={profile}", "about:blank"], stderr=subprocess.PIPE, text=True
        )
        assert self._process.stderr is not None
        said = next(line for line in self._process.stderr if "DevTools listening on" in line)
        place = said.split("ws://")[1].split("/")[0]
        with urlopen(f"http://{place}/json") as answer:
            tab = next(each for each in json.load(answer) if each["type"] == "page")
        self._socket = self._run(_connect(tab["webSocketDebuggerUrl"]))
        for domain in ("Runtime", "Network", "Page", "Log"):
            self.call(f"{domain}.enable")
        width, height = size
        self.call("Emulation.setDeviceMetricsOverride", width=width, height=height, deviceScaleFactor=1, mobile=False)

    def _run(self, work: Any) -> Any:
        return self._loop.run_until_complete(asyncio.wait_for(work, _PATIENCE_S))

    def call(self, method: str, **parameters: Any) -> dict[str, Any]:
        """Send a command, and give its result."""
        self._sent += 1
        self._run(self._exchange(json.dumps({"id": self._sent, "method": method, "params": parameters})))
        while True:
            message = json.loads(self._run(self._exchange()))
            self._note(message)
            if message.get("id") == self._sent:
                assert "error" not in message, message
                return message["result"]

    async def _exchange(self, message: str | None = None) -> Any:
        """Send a message, or receive one."""
        return await (self._socket.read_message() if message is None else self._socket.write_message(message))

    async def _part(self) -> None:
        self._socket.close()

    def _note(self, message: dict[str, Any]) -> None:
        method, about = message.get("method"), message.get("params", {})
        if method == "Network.requestWillBeSent":
            self.requested.append(about["request"]["url"])
        elif method == "Runtime.exceptionThrown":
            self.errors.append(json.dumps(about["exceptionDetails"])[:500])
        elif method == "Log.entryAdded" and about["entry"]["level"] == "error":
            self.errors.append(about["entry"]["text"])

    def open(self, url: str, ready: str) -> None:
        """Open a page, and wait until an expression is true."""
        self.call("Page.navigate", url=url)
        self.wait(ready)

    def js(self, expression: str) -> Any:
        """Evaluate an expression."""
        result = self.call("Runtime.evaluate", expression=expression, returnByValue=True)
        assert "exceptionDetails" not in result, result
        return result["result"].get("value")

    def wait(self, expression: str) -> None:
        """Wait until an expression is true."""
        until = time.monotonic() + _PATIENCE_S
        while not self.js(expression):
            assert time.monotonic() < until, f"never: {expression}"
            time.sleep(0.05)

    def click(self, x: float, y: float) -> None:
        """Click at a place of the page [px]."""
        for kind in ("mouseMoved", "mousePressed", "mouseReleased"):
            self.call("Input.dispatchMouseEvent", type=kind, x=x, y=y, button="left", clickCount=1)

    def press(self, key: str, text: str = "") -> None:
        """Press a key; `text` is what it would write."""
        self.call("Input.dispatchKeyEvent", type="keyDown", key=key, code=key, **({"text": text} if text else {}))
        self.call("Input.dispatchKeyEvent", type="keyUp", key=key, code=key)

    def screenshot(self) -> bytes:
        """Give what is seen, as PNG."""
        return base64.b64decode(self.call("Page.captureScreenshot", format="png")["data"])

    def close(self) -> None:
        """End the browser."""
        self._run(self._part())
        self._process.terminate()
        self._process.wait(timeout=_PATIENCE_S)
        assert self._process.stderr is not None
        self._process.stderr.close()
        self._loop.close()


async def _connect(url: str) -> Any:
    from tornado.websocket import websocket_connect

    return await websocket_connect(url, max_message_size=2**28)
