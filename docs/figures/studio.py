"""Takes the picture of the live page: python docs/figures/studio.py [--dark] [--width 1400] docs/figures/studio.png
or, with --choose docs/figures/choose.png, that of `thenar studio` with six sensors of the scene `kamakura`.

The shipped scene `quick` plays on an emulated glove, `thenar run --web` shows it, and Chromium takes the picture once
twenty grasps have been seen and one has been held for half a second. It needs Debian's chromium and chromium-driver,
and selenium (group `test`).
"""

import argparse
import shutil
import subprocess
import sys
from collections.abc import Iterator
from contextlib import contextmanager
from io import BytesIO
from pathlib import Path
from tempfile import TemporaryDirectory

from PIL import Image
from selenium import webdriver
from selenium.webdriver.chrome.service import Service
from selenium.webdriver.support.wait import WebDriverWait

SCENE, GRASPS, PATIENCE_S = "quick", 20, 120
# Segments are numbered from 1; "segment 21, held for 0.6 s".
_READY = """const found = /segment (\\d+), held for ([\\d.]+)/.exec(document.getElementById('segment').textContent);
    const well = document.getElementById('health').textContent === 'ok';
    return well && found !== null && Number(found[1]) > arguments[0] && Number(found[2]) >= 0.5"""
# The height of the whole sections on the screen: below, no section is cut.
_WHOLE = """const boxes = [...document.querySelectorAll('main section')].map((one) => one.getBoundingClientRect());
    const whole = (end) => end <= innerHeight && boxes.every(({ top, bottom }) => top >= end || bottom <= end);
    return Math.ceil(Math.max(...boxes.map(({ bottom }) => bottom).filter(whole))) + 10"""


@contextmanager
def page(folder: Path) -> Iterator[str]:
    """Yield the address of the page of a run on an emulated glove."""
    thenar, glove = [sys.executable, "-m", "thenar.cli"], folder / "glove.toml"
    commands = f"""simulate {SCENE} -o {folder}/set.grasps
        compile {folder}/set.grasps -o {folder}/build --folds 0 --no-report --propose {glove} --chip board"""
    for line in commands.splitlines():
        subprocess.run([*thenar, *line.split()], check=True, capture_output=True)
    emulate = f"emulate {SCENE} --glove {glove} --dir {folder}/emulated --period-ms 1000 --rest-ms 500 --repeat --"
    run = f"run {folder}/build --glove {{glove}} --web 127.0.0.1:0 --preshape barrett_bh8"
    command = [*thenar, *emulate.split(), *thenar, *run.split()]
    with subprocess.Popen(command, stdout=subprocess.DEVNULL, stderr=subprocess.PIPE, text=True) as process:
        try:
            assert process.stderr is not None
            lines = (line.partition("the page is at ")[2].strip() for line in process.stderr)
            yield next(filter(None, lines))
        finally:
            process.terminate()


@contextmanager
def choose_page(folder: Path) -> Iterator[str]:
    """Yield the address of the page on which sensors are chosen."""
    thenar = [sys.executable, "-m", "thenar.cli"]
    (folder / "kamakura").mkdir()
    simulate = ["simulate", "kamakura", "--repetitions", "10", "-o", "kamakura/set.grasps"]
    subprocess.run([*thenar, *simulate], check=True, capture_output=True, cwd=folder)
    command = [*thenar, "studio", "kamakura", "--web", "127.0.0.1:0"]
    with subprocess.Popen(command, stderr=subprocess.PIPE, text=True, cwd=folder) as process:
        try:
            assert process.stderr is not None
            yield next(line.partition("the page is at ")[2].strip() for line in process.stderr)
        finally:
            process.terminate()


def choose_sensors(driver: webdriver.Chrome, wait: WebDriverWait[webdriver.Chrome]) -> None:
    """Choose the six sensors of the curve."""
    wait.until(lambda _: driver.find_element("id", "count").text)
    driver.find_element("id", "curve").click()
    wait.until(lambda _: driver.find_elements("css selector", "#points button"))[5].click()
    wait.until(lambda _: driver.find_element("id", "count").text.startswith("6 of "))
    driver.execute_script("document.getElementById('with-set').scrollIntoView()")


def main() -> None:
    """Take the picture."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("picture", type=Path)
    parser.add_argument("--dark", action="store_true")
    parser.add_argument("--choose", action="store_true")
    parser.add_argument("--width", type=int, default=1400)
    options = parser.parse_args()
    chrome = webdriver.ChromeOptions()
    chrome.binary_location = shutil.which("chromium") or ""
    for flag in ("--headless=new", "--no-sandbox", "--disable-gpu", "--hide-scrollbars"):
        chrome.add_argument(flag)
    with TemporaryDirectory() as name, (choose_page if options.choose else page)(Path(name)) as url:
        driver = webdriver.Chrome(options=chrome, service=Service(executable_path=shutil.which("chromedriver") or ""))
        try:
            scheme = {"name": "prefers-color-scheme", "value": "dark" if options.dark else "light"}
            driver.execute_cdp_cmd("Emulation.setEmulatedMedia", {"features": [scheme]})
            height = 1000 if options.choose else 1200
            sized = {"width": options.width, "height": height, "deviceScaleFactor": 1, "mobile": options.width < 600}
            driver.execute_cdp_cmd("Emulation.setDeviceMetricsOverride", sized)
            driver.get(url)
            wait = WebDriverWait(driver, PATIENCE_S, poll_frequency=0.05)
            if options.choose:
                choose_sensors(driver, wait)
            else:
                wait.until(lambda _: driver.execute_script(_READY, GRASPS))
            height = driver.execute_script(_WHOLE)
            with Image.open(BytesIO(driver.get_screenshot_as_png())) as taken:
                picture = taken.convert("RGB").crop((0, 0, options.width, height))
                picture.quantize(256, dither=Image.Dither.NONE).save(options.picture, optimize=True)
        finally:
            driver.quit()


if __name__ == "__main__":
    main()
