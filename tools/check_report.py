#!/usr/bin/env python3
"""Opens a study's report in headless Chromium and uses it as a person would.

    python tools/check_report.py FOLDER [--shots FOLDER] [--exr SCENE LABEL FILE]...

Fails on any console error and any network request. Compares the pixel values
that the viewer shows with the embedded pictures decoded here, and with EXR
files where they are given (`--exr "Cornell box" reference refs/cornell-box.exr`).
Needs selenium, numpy and, for `--exr`, OpenImageIO (PyPI); Chromium and its
driver (Debian: chromium, chromium-driver).
"""
import argparse
import base64
import html
import json
import re
import tempfile
import time
import zlib
from pathlib import Path

import numpy as np
from selenium import webdriver
from selenium.webdriver.common.action_chains import ActionChains
from selenium.webdriver.common.by import By
from selenium.webdriver.common.keys import Keys
from selenium.webdriver.support.ui import Select

FLAGS = [
    "--headless=new", "--no-sandbox", "--disable-gpu", "--disable-quic", "--no-first-run", "--hide-scrollbars",
    "--disable-background-networking", "--disable-component-update", "--disable-sync", "--disable-extensions",
    "--disable-default-apps", "--disable-dev-shm-usage",
]


def check(condition, what):
    assert condition, what
    print("ok:", what)


def embedded_pictures(text):
    """(scene, label) to an array of rows, columns, channels, in page order."""
    found = {}
    for tag, data in re.findall(r'<script type="text/plain" class="exhibit"([^>]*)>([^<]*)</script>', text):
        about = {name: html.unescape(value) for name, value in re.findall(r'data-(\w+)="([^"]*)"', tag)}
        width, height, half = int(about["width"]), int(about["height"]), about["format"] == "half"
        raw = np.frombuffer(zlib.decompress(base64.b64decode(data)), np.uint8)
        planes = raw.reshape(3, 2 if half else 4, height, width)
        values = np.moveaxis(planes, 1, -1).copy().view(">f2" if half else ">f4")[..., 0]
        found[about["scene"], about["label"]] = np.moveaxis(values, 0, -1).astype(np.float32)
    return found


class Page:
    def __init__(self, driver, shots):
        self.driver, self.shots = driver, shots

    def get(self, css):
        return self.driver.find_element(By.CSS_SELECTOR, css)

    def all(self, css):
        return self.driver.find_elements(By.CSS_SELECTOR, css)

    def wait(self, condition, what, limit=20):
        end = time.monotonic() + limit
        while not condition():
            assert time.monotonic() < end, f"waited in vain: {what}"
            time.sleep(0.05)

    def settle(self):
        self.wait(lambda: self.get("#viewer").get_attribute("data-ready") == "true", "the pictures are decoded")

    def keys(self, *keys):
        ActionChains(self.driver).send_keys(*keys).perform()

    def run(self, script, *arguments):
        return self.driver.execute_script(script, *arguments)

    def focus(self, css):
        self.run("document.querySelector(arguments[0]).focus()", css)

    def shot(self, name, css=None):
        if not self.shots:
            return
        if css:
            self.run("document.querySelector(arguments[0]).scrollIntoView({block: 'start'})", css)
        else:
            self.run("window.scrollTo(0, 0)")
        time.sleep(0.2)
        self.driver.save_screenshot(str(self.shots / f"{name}.png"))

    def fingerprint(self):
        """Of what the canvas shows."""
        return self.run("return document.getElementById('canvas').toDataURL()")

    def values(self, row):
        element = self.get(f"#value-{row}")
        return [element.get_attribute(f"data-{c}") for c in "rgb"]

    def pixel(self):
        return int(self.get("#pixel-x").text), int(self.get("#pixel-y").text)


def start(data_folder):
    options = webdriver.ChromeOptions()
    options.binary_location = "/usr/bin/chromium"
    for flag in [*FLAGS, f"--user-data-dir={data_folder}", "--window-size=1400,900"]:
        options.add_argument(flag)
    options.set_capability("goog:loggingPrefs", {"browser": "ALL", "performance": "ALL"})
    service = webdriver.ChromeService("/usr/bin/chromedriver")
    return webdriver.Chrome(options=options, service=service)


def check_quiet(driver, address):
    """Nothing in the console, nothing asked of any network or other file."""
    loud = [entry["message"] for entry in driver.get_log("browser")]
    check(not loud, f"nothing in the console {loud}")
    requests = []
    for entry in driver.get_log("performance"):
        message = json.loads(entry["message"])["message"]
        if message["method"] == "Network.requestWillBeSent":
            requests.append(message["params"]["request"]["url"])
    other = [url for url in requests if not url.startswith(("data:", "blob:")) and url.split("#")[0] != address]
    check(not other, f"no request but the page itself {other}")


def same(shown, expected, tolerance=0.0):
    """Are the shown numbers the expected ones?"""
    for text, value in zip(shown, expected):
        number = float(text.replace("Infinity", "inf"))
        if np.isfinite(value) and np.isfinite(number):
            if abs(number - value) > tolerance * abs(value) + 1e-12:
                return False
        elif not (np.isnan(value) and np.isnan(number) or value == number):
            return False
    return True


def check_values(page, pictures, scene, exrs):
    """Some pixels of A and B, reached by mouse and by keyboard."""
    label = lambda which: Select(page.get(f"#picture-{which}")).first_selected_option.get_attribute("textContent")
    a, b = label("a"), label("b")
    size = pictures[scene, a].shape
    canvas = page.get("#canvas")
    for at in [(-0.3, -0.2), (-0.25, 0.1), (0.2, 0.15), (0.25, -0.1)]:
        width, height = canvas.size["width"], canvas.size["height"]
        ActionChains(page.driver).move_to_element_with_offset(canvas, int(at[0] * width), int(at[1] * height)).perform()
        compare_pixel(page, pictures, scene, a, b, exrs)
    page.focus("#canvas")
    x, y = page.pixel()
    page.keys(Keys.ARROW_LEFT, Keys.ARROW_UP)
    expected = (max(x - 1, 0), max(y - 1, 0))
    check(page.pixel() == expected, f"arrow keys move the cursor to {expected}")
    compare_pixel(page, pictures, scene, a, b, exrs)
    ActionChains(page.driver).key_down(Keys.SHIFT).send_keys(Keys.ARROW_DOWN).key_up(Keys.SHIFT).perform()
    check(page.pixel()[1] == min(expected[1] + 10, size[0] - 1), "shift moves it by ten")
    check("Pixel" in page.get("#viewer-status").get_attribute("textContent"), "and it is spoken")


def compare_pixel(page, pictures, scene, a, b, exrs):
    x, y = page.pixel()
    for row, label in (("a", a), ("b", b)):
        picture = pictures[scene, label]
        if y < picture.shape[0] and x < picture.shape[1]:
            check(same(page.values(row), picture[y, x]), f"{row.upper()} ({label}) at {x}, {y} is {page.values(row)}")
            if (scene, label) in exrs:
                # Half of the last of a half float's 11 bits.
                check(same(page.values(row), exrs[scene, label][y, x], 2**-11), f"and in the EXR {exrs[scene, label][y, x]}")
    if None not in page.values("a") + page.values("b"):
        difference = [float(p) - float(q) for p, q in zip(page.values("a"), page.values("b"))]
        check(same(page.values("difference"), difference, 1e-6), "the difference is that of the two")


def check_pictures(page, study, pictures, exrs):
    """The viewer for every scene that has pictures, thoroughly for the first."""
    shown = 0
    for index, scene in reversed(list(enumerate(study["scenes"]))):
        page.get(f"#tab-{index}").click()
        if not any(name == scene["name"] for name, _ in pictures):
            check(page.get("#viewer-empty").is_displayed() and not page.get("#viewer").is_displayed(), "no pictures: it says so")
            continue
        page.settle()
        check_values(page, pictures, scene["name"], exrs)
        shown += 1
    if any(name == study["scenes"][0]["name"] for name, _ in pictures):
        check_viewer(page)
    check(shown or not pictures, f"pictures of {shown} scenes")


def check_viewer(page):
    """Every mode, exposure, zoom, exchange: each changes what is seen."""
    seen = {}
    for mode in ["side", "wipe", "flip", "error", "signed"]:
        page.get(f"[data-mode={mode}]").click()
        check(page.get("#viewer").get_attribute("data-mode") == mode, f"mode {mode}")
        seen[mode] = page.fingerprint()
        page.shot(f"viewer-{mode}", "#pictures")
    check(len(set(seen.values())) == 5, "five modes look different")
    check(page.get("#map-high").text.endswith("%"), f"the map's legend ends at {page.get('#map-high').text}")
    Select(page.get("#map-range")).select_by_value("5")
    check(page.get("#map-high").text == "+500 %", "the map's range can be set")
    page.focus("#canvas")
    page.keys("2")
    before = page.fingerprint()
    page.keys(",")
    check(page.fingerprint() != before, "the wipe moves by key")
    page.keys(" ")
    one = page.fingerprint()
    page.keys(" ")
    check(page.get("#viewer").get_attribute("data-shows") == "b" and page.fingerprint() != one, "space flips to B")
    before = page.fingerprint()
    page.keys("]", "]")
    check(page.get("#exposure-value").text == "+1 stops" and page.fingerprint() != before, "exposure by key")
    page.run("const e = document.getElementById('exposure'); e.value = -2; e.dispatchEvent(new Event('input'))")
    check(page.get("#exposure-value").text == "−2 stops", "exposure by slider")
    page.focus("#canvas")
    before = page.fingerprint()
    page.keys("+", "+", "+")
    check(page.fingerprint() != before and page.get("#zoom-value").text != "fit", f"zoom to {page.get('#zoom-value').text}")
    before = page.fingerprint()
    ActionChains(page.driver).drag_and_drop_by_offset(page.get("#canvas"), 60, 30).perform()
    check(page.fingerprint() != before, "dragging pans")
    page.get("#zoom-fit").click()
    check(page.get("#zoom-value").text == "fit", "fit")
    a = page.get("#picture-a").get_property("value")
    page.get("#exchange").click()
    page.settle()
    check(page.get("#picture-b").get_property("value") == a, "A and B are exchanged")
    page.get("#exchange").click()
    page.settle()
    page.run("const e = document.getElementById('exposure'); e.value = 0; e.dispatchEvent(new Event('input'))")
    page.get("[data-mode=side]").click()


def check_plots(page, study):
    scene = study["scenes"][0]
    with_points = [c for c in scene["configurations"] if c["rungs"]]
    curves = page.all("#plot-convergence .series")
    check(len(curves) >= 1 and len(curves) <= len(with_points), f"{len(curves)} curves")
    marker = page.get("#plot-convergence .series .marker")
    page.run("arguments[0].scrollIntoView({block: 'center'})", marker)
    ActionChains(page.driver).move_to_element(marker).perform()
    check(page.get("#tip").is_displayed() and "CPU time" in page.get("#tip").text, "hovering shows a value")
    page.shot("plot-hover", "#convergence")
    page.focus("#plot-convergence svg")
    page.keys(Keys.ARROW_RIGHT)
    first = page.get("#plot-convergence svg").get_attribute("data-point")
    page.keys(Keys.ARROW_RIGHT)
    check(page.get("#plot-convergence svg").get_attribute("data-point") != first, "arrow keys go along a curve")
    page.keys(Keys.ENTER)
    chosen = page.all("#plot-convergence .series.selected")
    check(len(chosen) == 1 and len(page.all("#summary-table tr.selected")) >= 1, "enter selects a configuration")
    page.shot("selected", "#convergence")
    page.keys(Keys.ENTER)
    check(not page.all(".series.selected"), "enter again selects none")
    before = page.get("#plot-convergence").get_attribute("innerHTML")
    Select(page.get("#abscissa")).select_by_value("samples")
    check("samples per pixel" in page.get("#plot-convergence").text, "samples as abscissa")
    for option in [o.get_property("value") for o in Select(page.get("#metric")).options]:
        Select(page.get("#metric")).select_by_value(option)
    check(page.get("#plot-convergence").get_attribute("innerHTML") != before, "every metric can be chosen")
    Select(page.get("#metric")).select_by_value("rel-mse")
    Select(page.get("#abscissa")).select_by_value("cpu")
    entry = page.get("#legend .entry")
    entry.click()
    page.settle()
    check(page.get("#legend .entry").get_attribute("aria-pressed") == "true", "the legend selects too")
    page.get("#legend .entry").click()
    page.settle()


def check_page(page, study):
    background = lambda: page.run("return getComputedStyle(document.body).backgroundColor")
    page.shot("light")
    light = background()
    page.get("#theme-toggle").click()
    check(background() != light, f"dark is another ground: {light}, {background()}")
    for name, css in (("dark", None), ("dark-convergence", "#convergence"), ("dark-pictures", "#pictures"), ("dark-tables", "#tables")):
        page.shot(name, css)
    page.run("document.activeElement.blur()")
    page.keys("d")
    check(background() == light, "and d brings light back")
    page.keys("?")
    check(page.get("#help").is_displayed(), "? shows the keys")
    page.shot("keys")
    page.keys("?")
    check(not page.get("#help").is_displayed(), "and hides them")
    for name in ("convergence", "pictures", "tables", "definitions") if study["scenes"] else ("definitions",):
        page.shot(f"light-{name}", f"#{name}")
    page.run("document.activeElement.blur(); window.scrollTo(0, 0)")
    reached = set()
    for _ in range(60):
        page.keys(Keys.TAB)
        reached.add(page.run("const e = document.activeElement; return e.id || e.closest('figure')?.id || e.dataset.pick || e.tagName"))
    wanted = ["theme-toggle"] + (["tab-0", "metric"] if study["scenes"] else [])
    if page.all("#plot-convergence svg"):
        wanted.append("plot-convergence")
    for name in wanted:
        check(name in reached, f"tab reaches {name}")
    for index in range(1, len(study["scenes"])):
        page.run("document.activeElement.blur()")
        page.keys("n")
        check(page.get(f"#tab-{index}").get_attribute("aria-selected") == "true", f"n shows scene {index}")
        page.shot(f"scene-{index}")
    if study["scenes"]:
        page.get("#tab-0").click()


def check_narrow(page):
    page.driver.set_window_size(520, 900)
    page.run("window.scrollTo(0, 0)")
    time.sleep(0.3)
    check(page.run("return document.documentElement.scrollWidth <= window.innerWidth + 1"), "a narrow window does not scroll sideways")
    page.shot("narrow")
    page.shot("narrow-convergence", "#convergence")
    page.shot("narrow-pictures", "#pictures")
    page.driver.set_window_size(1400, 900)


def read_exr(path):
    import OpenImageIO as oiio

    buffer = oiio.ImageBuf(str(path))
    names = list(buffer.spec().channelnames)
    return np.asarray(buffer.get_pixels(oiio.FLOAT))[..., [names.index(c) for c in "RGB"]]


def main():
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("folder", type=Path)
    parser.add_argument("--shots", type=Path, help="where screenshots go")
    parser.add_argument("--exr", nargs=3, action="append", default=[], metavar=("SCENE", "LABEL", "FILE"))
    given = parser.parse_args()
    if given.shots:
        given.shots.mkdir(parents=True, exist_ok=True)
    path = (given.folder / "index.html").resolve()
    text = path.read_text(encoding="utf-8")
    study = json.loads(re.search(r'id="study-data">(.*?)</script>', text, re.S)[1])
    pictures = embedded_pictures(text)
    exrs = {(scene, label): read_exr(file) for scene, label, file in given.exr}
    missing = [key for key in exrs if key not in pictures]
    assert not missing, f"no such pictures in the report: {missing}; there are {list(pictures)}"
    with tempfile.TemporaryDirectory() as data_folder:
        driver = start(data_folder)
        try:
            # The browser's own start page asks for its parts: not counted.
            driver.get("about:blank")
            driver.get_log("performance")
            driver.get(path.as_uri())
            page = Page(driver, given.shots)
            page.wait(lambda: page.get("body").get_attribute("data-ready") == "true", "the script has run")
            check_page(page, study)
            check(bool(study["scenes"]) != bool(page.all("main > .empty")), "an empty study says that it is")
            if study["scenes"]:
                if page.all("#plot-convergence svg"):
                    check_plots(page, study)
                check_pictures(page, study, pictures, exrs)
                check_narrow(page)
            check_quiet(driver, path.as_uri())
        finally:
            driver.quit()
    print(f"the report works: {len(text) / 1e6:.2f} MB, {len(pictures)} pictures")


if __name__ == "__main__":
    main()
