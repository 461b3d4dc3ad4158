"""A headless Chromium, driven over a pipe by its own protocol: what a page asks for, complains of, looks like, prints.

The protocol is https://chromedevtools.github.io/devtools-protocol; messages end with a zero byte.
"""

import base64
import json
import os
import re
import shutil
import subprocess
from collections.abc import Iterator
from contextlib import contextmanager
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any, BinaryIO

#: Names under which systems have it.
NAMES = ("chromium", "chromium-browser", "google-chrome", "chrome")
FLAGS = (
    *("--headless", "--no-sandbox", "--disable-gpu", "--disable-quic", "--no-first-run", "--remote-debugging-pipe"),
    *("--disable-background-networking", "--disable-component-update", "--disable-sync", "--hide-scrollbars"),
)


def found() -> str | None:
    """The Chromium of this system; None where there is none."""
    return next((path for name in NAMES if (path := shutil.which(name))), None)


@dataclass
class Tab:
    """A tab: commands and the events that came meanwhile."""

    to: BinaryIO
    answers: Iterator[dict[str, Any]]
    session: str | None = None
    count: int = 0
    events: list[dict[str, Any]] = field(default_factory=list)

    def ask(self, method: str, **params: Any) -> dict[str, Any]:
        """The answer to a command."""
        self.count += 1
        message = {"id": self.count, "method": method, "params": params}
        message |= {"sessionId": self.session} if self.session else {}
        self.to.write(json.dumps(message).encode() + b"\0")
        self.to.flush()
        for answer in self.answers:
            if answer.get("id") == self.count:
                assert "error" not in answer, answer
                return answer["result"]  # type: ignore[no-any-return]
            self.events.append(answer)
        raise AssertionError("the browser is gone")

    def open(self, page: Path, width: int, height: int = 900, *, scripts: bool = True) -> None:
        """Load a page in a window of so many pixels, and wait for it."""
        self.events.clear()
        self.ask("Emulation.setDeviceMetricsOverride", width=width, height=height, deviceScaleFactor=1, mobile=False)
        self.ask("Emulation.setScriptExecutionDisabled", value=not scripts)
        self.ask("Page.navigate", url=page.resolve().as_uri())
        while not any(event.get("method") == "Page.loadEventFired" for event in self.events):
            self.events.append(next(self.answers))

    def run(self, script: str) -> Any:
        """The value of an expression in the page, a promise's once it is there."""
        answer = self.ask("Runtime.evaluate", expression=script, awaitPromise=True, returnByValue=True)
        assert "exceptionDetails" not in answer, answer
        return answer["result"].get("value")

    @property
    def complaints(self) -> list[str]:
        """Errors and warnings of the console, and of the browser."""
        kinds = ("Log.entryAdded", "Runtime.consoleAPICalled", "Runtime.exceptionThrown")
        return [json.dumps(event["params"]) for event in self.events if event.get("method") in kinds]

    @property
    def requests(self) -> list[str]:
        """All addresses that were asked for."""
        asked = (event["params"] for event in self.events if event.get("method") == "Network.requestWillBeSent")
        return [params["request"]["url"] for params in asked]

    def sheets(self) -> int:
        """Sheets of A4 that the page prints to."""
        pdf = base64.b64decode(self.ask("Page.printToPDF", preferCSSPageSize=True, printBackground=True)["data"])
        return len(re.findall(rb"/Type\s*/Page\b", pdf))


@contextmanager
def tab(profile: Path) -> Iterator[Tab]:
    """A tab of a new browser, with an empty profile in a folder."""
    program = found()
    assert program
    (from_us, to_browser), (from_browser, to_us) = os.pipe(), os.pipe()

    def on_three_and_four() -> None:
        """Where the browser reads and writes; first out of the way of each other."""
        for number, copy in enumerate((os.dup(from_us), os.dup(to_us)), start=3):
            os.dup2(copy, number)

    command, quiet = [program, *FLAGS, f"--user-data-dir={profile}", "about:blank"], subprocess.DEVNULL
    process = subprocess.Popen(command, stdout=quiet, stderr=quiet, close_fds=False, preexec_fn=on_three_and_four)
    os.close(from_us)
    os.close(to_us)
    try:
        with os.fdopen(to_browser, "wb") as to, os.fdopen(from_browser, "rb") as answers:
            browser = Tab(to, _messages(answers))
            target = browser.ask("Target.createTarget", url="about:blank")["targetId"]
            browser.session = browser.ask("Target.attachToTarget", targetId=target, flatten=True)["sessionId"]
            for domain in ("Page", "Runtime", "Log", "Network"):
                browser.ask(f"{domain}.enable")
            yield browser
    finally:
        process.terminate()
        process.wait(20)


def _messages(stream: BinaryIO) -> Iterator[dict[str, Any]]:
    rest = b""
    while chunk := os.read(stream.fileno(), 1 << 16):
        *whole, rest = (rest + chunk).split(b"\0")
        yield from map(json.loads, whole)
