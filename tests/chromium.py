"""A page in headless Chromium, driven through its debugging protocol: real pointers, real time."""

import json
import re
import shutil
import subprocess
import urllib.request
from contextlib import contextmanager

from websockets.sync.client import connect

CHROMIUM = shutil.which("chromium") or shutil.which("chromium-browser")


class ChromiumPage:
    """A loaded page, ``problems`` are errors of its scripts and breaches of its policy."""

    def __init__(self, socket):
        self._socket = socket
        self._sent = 0
        self.problems = []

    def call(self, method, **params):
        """Send a command of the protocol and return its result."""
        self._sent += 1
        self._socket.send(json.dumps({"id": self._sent, "method": method, "params": params}))
        while True:
            message = json.loads(self._socket.recv(timeout=60))
            if message.get("method") in ("Runtime.exceptionThrown", "Log.entryAdded"):
                self.problems.append(message["params"])
            if message.get("method") == "Runtime.consoleAPICalled":
                self.problems.append(message["params"]["args"])
            if message.get("id") == self._sent:
                assert "result" in message, message["error"]
                return message["result"]

    def evaluate(self, script):
        """Return the value of an expression, also of one that has to be waited for."""
        done = self.call(
            "Runtime.evaluate", expression=script, awaitPromise=True, returnByValue=True
        )
        assert "exceptionDetails" not in done, done["exceptionDetails"]
        return done["result"].get("value")

    def wait(self, condition):
        """Wait until an expression is true; return its value."""
        return self.evaluate(
            "(async () => { for (let n = 0; n < 300; n++) {"
            f" const value = {condition}; if (value) return value;"
            " await new Promise((done) => setTimeout(done, 50)); } })()"
        )

    def point(self, kind, x, y, *, held=False):
        """Send an event of the mouse, ``Moved``, ``Pressed`` or ``Released``, at a place [px]."""
        button = {"button": "left", "buttons": 1, "clickCount": 1} if held else {}
        self.call("Input.dispatchMouseEvent", type=f"mouse{kind}", x=x, y=y, **button)

    def press(self, key):
        """Press and release the key of a letter."""
        for kind, text in (("keyDown", key), ("keyUp", "")):
            self.call("Input.dispatchKeyEvent", type=kind, key=key, text=text)


@contextmanager
def chromium_page(page_url, folder, *options, width=1280, script=""):
    """Open a page; of the network only this machine exists. ``folder`` has room for a profile.

    ``script`` runs before those of the page.
    """
    command = [
        CHROMIUM, "--headless", "--no-sandbox", "--disable-gpu", "--disable-dev-shm-usage",
        "--remote-debugging-port=0", "--host-resolver-rules=MAP * ~NOTFOUND, EXCLUDE 127.0.0.1",
        f"--user-data-dir={folder / 'profile'}", f"--window-size={width},900", *options,
        "about:blank",
    ]  # fmt: skip
    process = subprocess.Popen(command, stderr=subprocess.PIPE, text=True)
    try:
        address = next(
            found[1]
            for line in process.stderr
            if (found := re.match(r"DevTools listening on ws://([^/]+)/", line))
        )
        with urllib.request.urlopen(f"http://{address}/json/list", timeout=60) as answer:
            targets = json.load(answer)
        (target,) = [target for target in targets if target["type"] == "page"]
        with connect(target["webSocketDebuggerUrl"], max_size=None) as socket:
            page = ChromiumPage(socket)
            for domain in ("Runtime", "Log", "Page"):
                page.call(f"{domain}.enable")
            page.call("Page.addScriptToEvaluateOnNewDocument", source=script)
            page.call("Page.navigate", url=page_url)
            page.wait("document.readyState === 'complete' && location.href !== 'about:blank'")
            yield page
    finally:
        process.terminate()
        process.wait()
        process.stderr.close()
