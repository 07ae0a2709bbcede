#!/usr/bin/env python3
"""Drives the page of `magsteer web` in headless Chromium, as a person would, against a simulated rig.

    tests/scripts/web_page.py --magsteer target/debug/magsteer --config config/bigmag-planar.toml [--screens DIR]

Starts plant, daemon and page server as processes of their own; arms, steers by a slider, presses STOP, kills the daemon
and starts another, cuts the amplifiers; and checks that nothing is asked for outside of loopback. Ends with 0 when all
holds, with 1 and the reason when not, with 77 when this machine has no Chromium or no ChromeDriver. Python's standard
library alone; ChromeDriver is spoken to over HTTP (https://www.w3.org/TR/webdriver2/).
"""

import argparse
import base64
import json
import os
import shutil
import signal
import subprocess
import sys
import tempfile
import time
import urllib.error
import urllib.parse
import urllib.request

PATIENCE_S = 30.0
SKIP = 77
ELEMENT = "element-6066-11e4-a52e-4f735466cecf"  # the key that the standard gives to references
LOOPBACK = ("127.0.0.1", "localhost", "::1")


class Failure(Exception):
    """Something does not hold."""


def until(what, holds):
    """Waits until `holds` returns something true, and returns it."""
    end = time.monotonic() + PATIENCE_S
    while True:
        found = holds()
        if found:
            return found
        if time.monotonic() > end:
            raise Failure(f"not within {PATIENCE_S:.0f} s: {what}")
        time.sleep(0.1)


def check(what, holds):
    if not holds:
        raise Failure(what)
    print(f"ok: {what}")


class Browser:
    """One headless Chromium."""

    def __init__(self, chromedriver, chromium, folder):
        self.process = subprocess.Popen([chromedriver, "--port=0"], stdout=subprocess.PIPE, text=True)
        port = None
        while port is None:
            line = self.process.stdout.readline()
            if not line:
                raise Failure("ChromeDriver ended")
            if "on port" in line and "started" in line:
                port = int(line.rsplit("port", 1)[1].strip(" .\n"))
        self.root = f"http://127.0.0.1:{port}"
        arguments = ["--headless=new", "--no-sandbox", "--disable-dev-shm-usage", "--disable-gpu",
                     "--disable-background-networking", "--no-first-run", f"--user-data-dir={folder}"]
        capabilities = {"browserName": "chrome", "goog:chromeOptions": {"binary": chromium, "args": arguments},
                        "goog:loggingPrefs": {"performance": "ALL", "browser": "ALL"}}
        answer = self.ask("POST", "/session", {"capabilities": {"alwaysMatch": capabilities}})
        self.session = f"/session/{answer['sessionId']}"

    def ask(self, method, path, content=None):
        data = None if content is None else json.dumps(content).encode()
        request = urllib.request.Request(self.root + path, data, {"Content-Type": "application/json"}, method=method)
        try:
            with urllib.request.urlopen(request, timeout=60) as answer:
                return json.load(answer)["value"]
        except urllib.error.HTTPError as error:
            raise Failure(f"{method} {path}: {error.read().decode()[:400]}") from error

    def post(self, path, content):
        return self.ask("POST", self.session + path, content)

    def run(self, script, *arguments):
        return self.post("/execute/sync", {"script": script, "args": list(arguments)})

    def text(self, identity):
        return self.run("return document.getElementById(arguments[0]).textContent", identity)

    def enabled(self, *identities):
        return [self.run("return !document.getElementById(arguments[0]).disabled", it) for it in identities]

    def element(self, identity):
        return self.post("/element", {"using": "css selector", "value": f"#{identity}"})[ELEMENT]

    def click(self, identity):
        """Clicks as a pointer does, where a person would have scrolled to: fails when something lies over the element."""
        element = self.element(identity)
        self.run("arguments[0].scrollIntoView({block: 'center'})", {ELEMENT: element})
        self.post(f"/element/{element}/click", {})

    def drag(self, identity, share):
        """Presses in the middle of a slider and lets go at a share of its width from there."""
        element = self.element(identity)
        self.run("arguments[0].scrollIntoView({block: 'center'})", {ELEMENT: element})
        width = self.run("return arguments[0].getBoundingClientRect().width", {ELEMENT: element})
        origin = {ELEMENT: element}
        moves = [{"type": "pointerMove", "origin": origin, "x": 0, "y": 0}, {"type": "pointerDown", "button": 0},
                 {"type": "pointerMove", "duration": 200, "origin": origin, "x": round(share * width), "y": 0},
                 {"type": "pointerUp", "button": 0}]
        self.post("/actions", {"actions": [{"type": "pointer", "id": "mouse", "actions": moves}]})

    def devtools(self, command, parameters):
        return self.post("/goog/cdp/execute", {"cmd": command, "params": parameters})

    def size(self, width, height, mobile=False):
        self.devtools("Emulation.setDeviceMetricsOverride",
                      {"width": width, "height": height, "deviceScaleFactor": 2 if mobile else 1, "mobile": mobile})
        time.sleep(0.5)

    def shoot(self, path, whole=False):
        taken = self.devtools("Page.captureScreenshot", {"format": "png", "captureBeyondViewport": whole})
        with open(path, "wb") as file:
            file.write(base64.b64decode(taken["data"]))

    def log(self, kind):
        return self.post("/se/log", {"type": kind})

    def end(self):
        try:
            self.ask("DELETE", self.session)
        finally:
            self.process.terminate()
            self.process.wait()


class Rig:
    """The processes of one rig, in a folder and a channel root of their own."""

    def __init__(self, magsteer, config, folder):
        self.magsteer, self.config, self.folder = magsteer, config, folder
        self.root = os.path.join(folder, "r")
        self.children = {}

    def start(self, name, *arguments, pipe=False):
        out = subprocess.PIPE if pipe else open(os.path.join(self.folder, f"{name}.log"), "ab")
        log = open(os.path.join(self.folder, f"{name}.log"), "ab")
        command = [self.magsteer, *arguments, "--root", self.root]
        child = subprocess.Popen(command, stdin=subprocess.DEVNULL, stdout=out, stderr=log, text=True, cwd=self.folder)
        self.children[name] = child
        return child

    def plant(self):
        self.start("plant", "sim-plant", self.config)

    def daemon(self, *arguments):
        self.start("daemon", "run", self.config, *arguments)

    def web(self):
        child = self.start("web", "web", self.config, "--bind", "127.0.0.1:0", pipe=True)
        line = child.stdout.readline().strip()
        if not line.startswith("http://127.0.0.1:"):
            raise Failure(f"the page server said {line!r}")
        return line

    def status(self):
        """What the daemon says of itself, past the page."""
        done = subprocess.run([self.magsteer, "status", "--json", "--root", self.root, "--config", self.config],
                              capture_output=True, text=True, timeout=30)
        return json.loads(done.stdout) if done.returncode == 0 else None

    def first(self, key):
        """The first number of a list in the status; one that nothing is close to when there is none."""
        listed = (self.status() or {}).get(key) or [None]
        return 1e9 if listed[0] is None else listed[0]

    def current(self):
        """The largest measured current, A; infinite when nobody tells."""
        status = self.status()
        return max(abs(it) for it in status["currents_a"]) if status else float("inf")

    def signal(self, name, number):
        child = self.children[name]
        child.send_signal(number)
        child.wait(timeout=30)

    def end(self):
        for name in ("web", "daemon", "plant"):
            child = self.children.get(name)
            if child and child.poll() is None:
                child.send_signal(signal.SIGTERM)
                try:
                    child.wait(timeout=20)
                except subprocess.TimeoutExpired:
                    child.kill()
                    child.wait()


def press_until(browser, identity, state):
    """Presses whenever the button is enabled, until the page shows a state: a busy machine may trip on the way."""
    def reached():
        if browser.text("state") == state:
            return True
        if browser.text("state") == "fault" and browser.enabled("reset")[0] and state != "fault":
            browser.click("reset")
        elif browser.enabled(identity)[0]:
            browser.click(identity)
        time.sleep(0.3)
        return browser.text("state") == state
    until(f"{identity} leads to {state}", reached)
    check(f"{identity} leads to {state}", True)


def steer(browser):
    def reached():
        state = browser.text("state")
        button = {"idle": "arm", "armed": "go", "fault": "reset", "holding": "go"}.get(state)
        if button and browser.enabled(button)[0]:
            browser.click(button)
            time.sleep(0.3)
        return browser.text("state") == "active"
    until("the page steers", reached)
    check("arm and go steer", True)


def drive(browser, rig, url, screens):
    browser.size(1280, 1000)
    browser.post("/url", {"url": url})
    until("the page knows its rig", lambda: browser.text("rig") == "bigmag-planar")
    check("without a daemon the page says so", browser.text("link") == "no daemon")
    check("and offers nothing but to stop",
          browser.enabled("arm", "go", "hold", "reset", "target-0-0", "stop", "estop") == [False] * 5 + [True] * 2)
    browser.shoot(os.path.join(screens, "absent-1280.png"))

    rig.daemon()
    until("the page attaches", lambda: browser.text("link") == "attached" and browser.text("state") == "idle")
    check("a daemon that comes is met", True)
    press_until(browser, "arm", "armed")
    steer(browser)
    browser.drag("target-0-0", -0.08)
    wanted = float(browser.run("return document.getElementById('target-0-0').value"))
    check(f"the slider moved to {wanted} deg", 60 <= wanted <= 85)
    until("the target arrives at the daemon", lambda: abs(rig.first("targets_deg") - wanted) < 0.01)
    check("the slider sets the daemon's target", True)
    until("the magnet arrives", lambda: browser.text("state") != "active"
          or abs(rig.first("measured_deg") - wanted) < 1.5)
    steer(browser)
    time.sleep(3)
    browser.shoot(os.path.join(screens, "steering-1280.png"), whole=True)

    browser.size(390, 844, mobile=True)
    browser.run("window.scrollTo(0, 0)")
    time.sleep(0.5)
    browser.shoot(os.path.join(screens, "steering-390.png"))
    browser.shoot(os.path.join(screens, "steering-390-whole.png"), whole=True)
    width = browser.run("return document.documentElement.scrollWidth")
    check(f"nothing is wider than 390 pixels: {width}", width <= 390)
    browser.run("window.scrollTo(0, document.body.scrollHeight)")
    seen = browser.run("const box = document.getElementById('stop').getBoundingClientRect();"
                       "return box.top >= 0 && box.bottom <= innerHeight && box.height >= 44")
    check("STOP is in sight wherever the page is scrolled to", seen)
    browser.click("stop")
    until("STOP stops", lambda: browser.text("state") == "idle")
    until("no current is left", lambda: rig.current() < 0.1)
    check("STOP ramps to zero", True)

    browser.size(1280, 1000)
    rig.signal("daemon", signal.SIGKILL)
    until("silence is seen", lambda: browser.run("return document.body.classList.contains('old')"))
    check("a dead daemon is told with its age", "no daemon for" in browser.text("link"))
    check("controls are off, STOP is not",
          browser.enabled("arm", "go", "hold", "reset", "target-0-0", "stop", "estop") == [False] * 5 + [True] * 2)
    browser.click("stop")
    until("a stop that nobody took is told", lambda: "not done" in browser.text("answer"))
    browser.shoot(os.path.join(screens, "stale-1280.png"))
    rig.daemon()
    until("another daemon is met", lambda: browser.text("link") == "attached" and browser.text("state") == "idle")
    check("the page is back after the daemon's restart", True)
    steer(browser)
    browser.click("estop")
    check("the emergency stop asks first", browser.text("estoptext") == "SURE?")
    browser.click("estop")
    until("the emergency stop cuts", lambda: browser.text("state") == "fault")
    check("pressed twice it cuts the amplifiers", "emergency stop" in browser.text("alerts"))
    press_until(browser, "reset", "idle")


def look_at_logs(browser):
    urls = []
    for entry in browser.log("performance"):
        message = json.loads(entry["message"])["message"]
        if message["method"] == "Network.requestWillBeSent":
            urls.append(message["params"]["request"]["url"])
    outside = [url for url in urls if urllib.parse.urlsplit(url).scheme in ("http", "https", "ws", "wss")
               and urllib.parse.urlsplit(url).hostname not in LOOPBACK]
    check(f"none of {len(urls)} requests left loopback: {outside}", len(urls) > 5 and not outside)
    # A request that is refused with a reason is no mistake of the page.
    errors = [entry["message"] for entry in browser.log("browser")
              if entry["level"] == "SEVERE" and "/command" not in entry["message"]]
    check(f"the browser complains of nothing: {errors}", not errors)


def main():
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("--magsteer", required=True)
    parser.add_argument("--config", required=True)
    parser.add_argument("--screens", help="folder for screenshots")
    arguments = parser.parse_args()
    # What was started is ended, whoever ends this.
    signal.signal(signal.SIGTERM, lambda *_: sys.exit(143))
    chromium = next(filter(None, map(shutil.which, ("chromium", "chromium-browser", "google-chrome"))), None)
    chromedriver = shutil.which("chromedriver")
    if not chromium or not chromedriver:
        print("skipped: this machine has no Chromium or no ChromeDriver")
        return SKIP
    with tempfile.TemporaryDirectory(prefix="mw") as folder:
        screens = arguments.screens or folder
        os.makedirs(screens, exist_ok=True)
        rig = Rig(os.path.abspath(arguments.magsteer), os.path.abspath(arguments.config), folder)
        browser = None
        try:
            rig.plant()
            url = rig.web()
            browser = Browser(chromedriver, chromium, os.path.join(folder, "profile"))
            drive(browser, rig, url, screens)
            look_at_logs(browser)
        except Failure as failure:
            print(f"failed: {failure}")
            if browser:
                print({name: browser.text(name) for name in ("state", "link", "alerts", "answer")})
                browser.shoot(os.path.join(screens, "failed.png"))
            return 1
        finally:
            if browser:
                browser.end()
            rig.end()
    return 0


if __name__ == "__main__":
    sys.exit(main())
