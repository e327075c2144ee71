"""A browser that has one page open, as tests of reports and of live pages share it."""

import json
import os
from collections.abc import Callable
from importlib.resources import files
from pathlib import Path
from typing import Any

from selenium import webdriver
from selenium.webdriver.common.by import By
from selenium.webdriver.support.wait import WebDriverWait

PATIENCE_S = 30


class Browser:
    """A browser with one page open."""

    def __init__(self, driver: webdriver.Chrome) -> None:
        self.driver = driver

    def open_file(self, path: Path, fragment: str = "") -> None:
        """Open a page that is a file, in light colours; what was asked for and complained of before is forgotten."""
        self.driver.get("about:blank")  # the same address with another fragment would not load the file again
        self.log("performance")
        self.log("browser")
        self.scheme("light")
        self.driver.get(path.as_uri() + fragment)

    def open(self, url: str, *, width: int = 1400, scheme: str = "light") -> None:
        """Open a page, in a window so wide, of a reader whose system is light or dark."""
        self.log()
        self.scheme(scheme)
        metrics = {"width": width, "height": 1000, "deviceScaleFactor": 1, "mobile": width < 600}
        self.driver.execute_cdp_cmd("Emulation.setDeviceMetricsOverride", metrics)
        self.driver.get(url)

    def text(self, name: str) -> str:
        """Return the text of the element with this id, at one moment."""
        return str(self.script("return document.getElementById(arguments[0]).textContent", name))

    def texts(self, selector: str) -> list[str]:
        """Return the texts of all elements that a selector finds, at one moment."""
        found = self.script("return [...document.querySelectorAll(arguments[0])].map((e) => e.textContent)", selector)
        return list(found)

    def click(self, name: str) -> None:
        self.driver.find_element(By.ID, name).click()

    def picture(self, name: str) -> None:
        """Keep a picture of the page where THENAR_PICTURES names a folder for them."""
        if folder := os.environ.get("THENAR_PICTURES"):
            self.driver.save_screenshot(f"{folder}/{name}.png")

    def scheme(self, name: str) -> None:
        """Let the reader's system be "light" or "dark"."""
        features = [{"name": "prefers-color-scheme", "value": name}]
        self.driver.execute_cdp_cmd("Emulation.setEmulatedMedia", {"features": features})

    def script(self, text: str, *arguments: object) -> Any:
        return self.driver.execute_script(text, *arguments)

    def wait(self, until: Callable[[], object]) -> None:
        WebDriverWait(self.driver, PATIENCE_S, poll_frequency=0.02).until(lambda _: until())

    def log(self, kind: str = "browser") -> list[dict[str, Any]]:
        """Return the new messages of a log: of the "browser", what the page complained of."""
        entries: list[dict[str, Any]] = self.driver.get_log(kind)  # type: ignore[no-untyped-call]
        return entries

    def requests(self) -> list[str]:
        """Return the addresses that were asked for since the page was opened."""
        messages = [json.loads(entry["message"])["message"] for entry in self.log("performance")]
        sent = [message for message in messages if message["method"] == "Network.requestWillBeSent"]
        return [message["params"]["request"]["url"] for message in sent]

    def axe(self, *impacts: str) -> list[str]:
        """Return the rules that axe-core finds broken, of these impacts or of any, and where."""
        self.script((files("axe_core_python") / "axe.min.js").read_text())
        found = self.driver.execute_async_script(
            "axe.run({resultTypes: ['violations']}).then(arguments[0], (wrong) => arguments[0](String(wrong)))"
        )
        assert isinstance(found, dict), found
        assert found["passes"]
        wrong = [one for one in found["violations"] if not impacts or one["impact"] in impacts]
        return [f"{one['id']}: {node['html']}: {node['failureSummary']}" for one in wrong for node in one["nodes"]]
