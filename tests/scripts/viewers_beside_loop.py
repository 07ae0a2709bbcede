#!/usr/bin/env python3
"""What viewers cost the loop: its lateness with and without them, minute by minute in one run.

    tests/scripts/viewers_beside_loop.py --magsteer target/release/magsteer --config config/bigmag-planar.toml [--pairs 3] [--loop-cpu 1]

Starts a simulated rig and lets it steer. Turn by turn nobody looks, or `top` in a terminal (tmux), `web` with its page open
in headless Chromium, `status --watch` and, where it is built in, `bridge foxglove` do, and `record` records. The minute in which viewers come or
go is left out; of the next one the daemon's own figures are printed. So a run takes four minutes a pair, and whatever else
the machine does falls on both sides alike. With `--loop-cpu` the loop has a CPU that plant, viewers and this script keep off, as
`[daemon] cpu` and `taskset` would have it in a laboratory. Ends with 1 when the median of p99.9 with viewers is more than 1.1 times that
without.
"""

import argparse
import json
import os
import shutil
import signal
import statistics
import subprocess
import sys
import tempfile
import time

from web_page import Browser, Failure, Rig

LIMIT = 1.1


class Viewers:
    """All that look, until ended."""

    def __init__(self, rig):
        self.rig = rig
        self.name = f"magsteer-{os.getpid()}"
        url = rig.web()
        rig.start("watch", "status", rig.config, "--watch")
        listed = subprocess.run([rig.magsteer, "--help"], capture_output=True, text=True, check=True).stdout
        self.others = ["watch", "web", "record"]
        rig.start("record", "record", rig.config, "--out", tempfile.mkdtemp(dir=rig.folder))
        if "bridge" in listed:
            rig.start("bridge", "bridge", "foxglove", rig.config, "--bind", "127.0.0.1:0")
            self.others.append("bridge")
        top = f"'{rig.magsteer}' top '{rig.config}' --root '{rig.root}'"
        subprocess.run(["tmux", "-L", self.name, "new-session", "-d", "-x", "160", "-y", "50", top], check=True)
        self.browser = Browser(shutil.which("chromedriver"), shutil.which("chromium"),
                               tempfile.mkdtemp(dir=rig.folder))
        self.browser.size(1280, 1000)
        self.browser.post("/url", {"url": url})

    def check(self):
        """Fails unless all of them really look."""
        shown = subprocess.run(["tmux", "-L", self.name, "capture-pane", "-p"], capture_output=True, text=True, check=True)
        if "attached" not in shown.stdout or self.browser.text("link") != "attached":
            raise Failure(f"a viewer does not look: {shown.stdout[:200]}")
        if any(self.rig.children[name].poll() is not None for name in self.others):
            raise Failure("a viewer has ended")

    def end(self):
        self.browser.end()
        subprocess.run(["tmux", "-L", self.name, "send-keys", "q"], check=False)
        time.sleep(1)
        subprocess.run(["tmux", "-L", self.name, "kill-server"], check=False, stderr=subprocess.DEVNULL)
        for name in self.others:
            self.rig.signal(name, signal.SIGTERM)


def operate(rig, *arguments):
    command = [rig.magsteer, *arguments, "--config", rig.config, "--root", rig.root]
    return subprocess.run(command, capture_output=True, text=True, timeout=30)


def steer(rig):
    """Lets the rig steer, whatever a machine that stops processes brought it to."""
    operate(rig, "reset")
    for request in (["arm"], ["target", "set", "m1=75deg", "m2=105deg"], ["go"]):
        for _ in range(20):
            if operate(rig, *request).returncode == 0:
                break
            time.sleep(0.3)


def minute(rig, former):
    """The daemon's figures of its next whole minute, asked for about once a second near its end alone."""
    time.sleep(56)
    while True:
        status = json.loads(operate(rig, "status", "--json").stdout)
        if status["last_minute"] and status["last_minute"] != former:
            return status["last_minute"], status["state"]
        time.sleep(1)


def measure(rig, pairs):
    found = {False: [], True: []}
    last, state = minute(rig, None)
    print("viewers   p50   p99  p99.9    max us   execution p99.9   missed   load")
    for turn in range(2 * pairs):
        looking = turn % 2 == 1
        viewers = Viewers(rig) if looking else None
        try:
            last, state = minute(rig, last)
            if state != "active":
                steer(rig)
            if viewers:
                viewers.check()
            last, state = minute(rig, last)
            if viewers:
                viewers.check()
        finally:
            if viewers:
                viewers.end()
        late = last["lateness_us"]
        found[looking].append(late["p999"])
        print(f"{'all' if looking else 'none':7} {late['p50']:5.0f} {late['p99']:5.0f} {late['p999']:6.0f} {late['max']:9.0f}"
              f" {last['execution_us']['p999']:17.0f} {last['missed']:8} {os.getloadavg()[0]:6.1f}  {state}", flush=True)
    without, beside = statistics.median(found[False]), statistics.median(found[True])
    print(f"median of p99.9: {beside:.1f} us with viewers, {without:.1f} us without: {beside / without:.3f} times")
    return beside <= LIMIT * without


def keep_cpu(cpu, config, folder):
    """Takes this process, and all that it starts, off the CPU; a configuration that has the loop there."""
    os.sched_setaffinity(0, os.sched_getaffinity(0) - {cpu})
    path = os.path.join(folder, "kept.toml")
    with open(path, "w", encoding="utf-8") as file:
        file.write(f"extends = {json.dumps(config)}\n[daemon]\ncpu = {cpu}\n")
    return path


def main():
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("--magsteer", required=True)
    parser.add_argument("--config", required=True)
    parser.add_argument("--pairs", type=int, default=3)
    parser.add_argument("--loop-cpu", type=int, help="CPU that is kept for the loop")
    arguments = parser.parse_args()
    # What was started is ended, whoever ends this.
    signal.signal(signal.SIGTERM, lambda *_: sys.exit(143))
    missing = [name for name in ("tmux", "chromium", "chromedriver") if not shutil.which(name)]
    if missing:
        print(f"missing: {', '.join(missing)}")
        return 69
    with tempfile.TemporaryDirectory(prefix="mv") as folder:
        config = os.path.abspath(arguments.config)
        if arguments.loop_cpu is not None:
            config = keep_cpu(arguments.loop_cpu, config, folder)
        rig = Rig(os.path.abspath(arguments.magsteer), config, folder)
        try:
            rig.plant()
            # A machine that stops processes must not end the steering halfway: monitors tell, but do not act.
            rig.daemon("--passive")
            time.sleep(2)
            steer(rig)
            return 0 if measure(rig, arguments.pairs) else 1
        finally:
            rig.end()


if __name__ == "__main__":
    sys.exit(main())
