#!/usr/bin/env python3
"""A rig watched and recorded from another machine, on one machine: what passes, what does not, and what it costs the loop.

    sudo tests/scripts/two_machines.py --magsteer target/release/magsteer --config config/bigmag-planar.toml

Makes two machines of namespaces, joined by a cable: each has its own network, its own /dev/shm, and its own monotonic
clock, so that nothing but what passes the tunnel is shared. Needs root, and iox2-link-tunnel-zenoh on PATH or named with
--program. Prints a line a claim and a table of the loop's timing; ends with 1 when a claim does not hold. No claim is
about time: on a machine that stops processes the table says what it says.
"""

import argparse
import csv
import json
import os
import shutil
import signal
import subprocess
import sys
import tempfile
import time

PORT = 7447
ADDRESS = {"rig": "10.213.77.1", "desk": "10.213.77.2"}
# The desk was started this long before the rig, s: its clock stands elsewhere.
CLOCK = {"rig": 0, "desk": 250_000}


class Machine:
    """A set of namespaces, and what runs in it."""

    def __init__(self, name, folder):
        self.name, self.folder = name, folder
        self.net = f"magsteer-{name}-{os.getpid()}"
        self.children = []
        subprocess.run(["ip", "netns", "add", self.net], check=True)
        # The root in shared memory is the one that nobody has to name: that of this user.
        shell = "mount -t tmpfs -o size=512m tmpfs /dev/shm && echo $$ && exec sleep infinity"
        command = ["ip", "netns", "exec", self.net, "unshare", "--mount", "--time", "--monotonic", str(CLOCK[name]),
                   "--fork", "--kill-child", "sh", "-c", shell]
        self.holder = subprocess.Popen(command, stdout=subprocess.PIPE, text=True)
        self.pid = int(self.holder.stdout.readline())

    def inside(self, *command):
        return ["nsenter", "-t", str(self.pid), "-m", "-n", "-T", f"--wd={self.folder}", *command]

    def start(self, *command, log, **options):
        with open(os.path.join(self.folder, f"{self.name}-{log}.log"), "a") as file:
            child = subprocess.Popen(self.inside(*command), stdout=options.pop("stdout", file), stderr=file, **options)
        self.children.append(child)
        return child

    def run(self, *command, timeout=60):
        return subprocess.run(self.inside(*command), capture_output=True, text=True, timeout=timeout)

    def log(self, log):
        with open(os.path.join(self.folder, f"{self.name}-{log}.log")) as file:
            return file.read()

    def memory(self):
        return self.run("stat", "-c", "%d", "/dev/shm").stdout.strip()

    def clock(self):
        return float(self.run(sys.executable, "-c", "import time; print(time.monotonic())").stdout)

    def end(self):
        for child in reversed(self.children):
            end(child)
        self.holder.kill()
        self.holder.wait()
        subprocess.run(["ip", "netns", "del", self.net], check=False)


def end(child, number=signal.SIGTERM):
    if child.poll() is None:
        child.send_signal(number)
        try:
            child.wait(20)
        except subprocess.TimeoutExpired:
            child.kill()
            child.wait()
    return child.returncode


class Trial:
    """The rig, the desk, and the claims so far."""

    def __init__(self, arguments, folder):
        self.magsteer = os.path.abspath(arguments.magsteer)
        self.config = os.path.abspath(arguments.config)
        self.program = os.path.abspath(arguments.program or shutil.which("iox2-link-tunnel-zenoh"))
        self.folder, self.failed, self.machines = folder, 0, []
        self.recorders, self.reports = {}, {}
        for name in ADDRESS:
            self.machines.append(Machine(name, folder))
        self.rig, self.desk = self.machines
        self.cable()

    def cable(self):
        ends = {self.rig: f"mgr{os.getpid()}", self.desk: f"mgd{os.getpid()}"}
        first, second = ends.values()
        subprocess.run(["ip", "link", "add", first, "type", "veth", "peer", "name", second], check=True)
        for machine, link in ends.items():
            subprocess.run(["ip", "link", "set", link, "netns", machine.net], check=True)
            for words in (["addr", "add", f"{ADDRESS[machine.name]}/30", "dev", link], ["link", "set", link, "up"],
                          ["link", "set", "lo", "up"]):
                subprocess.run(["ip", "-n", machine.net, *words], check=True)

    def claim(self, text, holds, detail=""):
        self.failed += not holds
        print(f"{'PASS' if holds else 'FAIL'}  {text}{': ' if detail else ''}{detail}", flush=True)

    def share(self):
        return self.rig.start(self.magsteer, "tunnel", "share", self.config, "--program", self.program, "--listen",
                              f"{ADDRESS['rig']}:{PORT}", log="share")

    def watch(self):
        return self.desk.start(self.magsteer, "tunnel", "watch", self.config, "--program", self.program, "--connect",
                               f"{ADDRESS['rig']}:{PORT}", log="watch")

    def services(self):
        return sorted(self.rig.run("find", "/dev/shm/magsteer-0", "-name", "*.service").stdout.split())

    def status(self, machine, *options):
        shown = machine.run(self.magsteer, "status", self.config, "--json", *options)
        return json.loads(shown.stdout) if shown.returncode == 0 else {"error": shown.stderr, "code": shown.returncode}

    def heard(self, patience_s=20):
        """Seconds until the desk hears the rig; none when it does not."""
        begin = time.monotonic()
        while time.monotonic() - begin < patience_s:
            if "cycle" in self.status(self.desk):
                return time.monotonic() - begin
            time.sleep(0.1)
        return None

    def ask(self, machine, *words):
        return machine.run(self.magsteer, *words, "--config", self.config)

    def steer(self):
        for request in (["reset"], ["arm"], ["target", "set", "m1=75deg", "m2=105deg"], ["go"]):
            for _ in range(30):
                if self.ask(self.rig, *request).returncode == 0 or request == ["reset"]:
                    break
                time.sleep(0.2)

    def begin(self):
        self.rig.start(self.magsteer, "sim-plant", self.config, log="plant")
        self.begin_daemon("whole")

    def begin_daemon(self, record):
        # A machine that stops processes must not end the steering halfway: monitors tell, but do not act.
        self.daemon = self.rig.start(self.magsteer, "run", self.config, "--passive", "--record",
                                     os.path.join(self.folder, record), "--json", log="daemon")
        while "cycle" not in self.status(self.rig):
            if self.daemon.poll() is not None:
                raise SystemExit(self.rig.log("daemon"))
            time.sleep(0.2)
        self.steer()

    def record_at_desk(self, name):
        self.recorders[name] = self.desk.start(self.magsteer, "record", self.config, "--out",
                                               os.path.join(self.folder, name), "--json", log=name,
                                               stdout=subprocess.PIPE, text=True)
        return self.recorders[name]

    def recorded(self, name, ask):
        """Ends a recorder, or waits until the loop does; its report."""
        recorder = self.recorders[name]
        if ask:
            recorder.send_signal(signal.SIGINT)
        self.reports[name] = json.loads(recorder.communicate(timeout=60)[0])
        return self.reports[name]

    def table(self, name):
        """Cycles of a recording by their numbers, as text."""
        run = os.path.join(self.folder, name)
        subprocess.run([self.magsteer, "runs", "export", run, "--format", "csv"], check=True, capture_output=True)
        with open(os.path.join(run, "cycles.csv")) as file:
            return {int(row["number"]): row for row in csv.DictReader(file)}


def alone(trial):
    """Before there is a tunnel, and how the two machines differ."""
    before = trial.status(trial.desk)
    trial.claim("without a tunnel the desk has no rig", before.get("code") == 69, before.get("error", "").strip()[:90])
    offset = trial.desk.clock() - trial.rig.clock()
    trial.claim("the two clocks stand apart", abs(offset) > 1_000, f"{offset:.0f} s")
    there, here = trial.rig.memory(), trial.desk.memory()
    trial.claim("the desk's shared memory is its own", there != here, f"device {there} there, {here} here")


def look(trial, seconds):
    """Watching and recording."""
    waited = trial.heard()
    trial.claim("the desk hears the rig", waited is not None, f"after {waited or 0:.1f} s")
    there, here = trial.status(trial.rig), {}
    for _ in range(100):
        # What the rig said just now is still on its way.
        here = trial.status(trial.desk)
        if here.get("cycle", 0) >= there["cycle"]:
            break
    same = all(there.get(key) == here.get(key) for key in ("state", "targets_deg", "rate_hz", "safe_action"))
    trial.claim("status says there what it says here", same and here["cycle"] >= there["cycle"] > 0,
                f"cycle {there.get('cycle')} there, then {here.get('cycle')} here; {here.get('state')}")
    trial.claim("and that the rig is distant", here.get("distant") is True and there.get("distant") is False)
    text = trial.desk.run(trial.magsteer, "status", trial.config).stdout
    trial.claim("in words too", "DISTANT" in text, next((x for x in text.splitlines() if "DISTANT" in x), ""))
    trial.record_at_desk("desk")
    time.sleep(seconds)
    report = trial.recorded("desk", ask=True)
    trial.claim("the desk records", report["cycles"] > 10,
                f"{report['cycles']} cycles in {seconds} s, {report['lost']} lost")


def refuse(trial):
    """Commands from the desk."""
    before = trial.status(trial.rig)
    for words in (["arm"], ["go"], ["hold"], ["stop"], ["reset"], ["estop"], ["target", "set", "m1=60deg", "m2=90deg"]):
        asked = trial.ask(trial.desk, *words)
        trial.claim(f"`{' '.join(words[:2])}` is refused at the desk", asked.returncode == 1 and
                    "only watches" in asked.stderr, asked.stderr.strip())
    after = trial.status(trial.rig)
    trial.claim("the rig goes on as before", before["state"] == after["state"] == "active"
                and before["targets_deg"] == after["targets_deg"], f"{after['state']}, {after['targets_deg']} deg")


def intrude(trial):
    """A desk that keeps to no rule: another rig of the same name, all of it offered by a tunnel that allows everything.
    It meets the rig, and beside it on the rig's machine another one that is shared without access rules: what becomes of
    that one shows that the rules are what keeps the first."""
    unruly, false = (os.path.join(trial.folder, name) for name in ("unruly", "false"))
    started = another_rig(trial, trial.rig, unruly)
    address = f"{ADDRESS['rig']}:{PORT + 1}"
    started.append(lawless(trial, trial.rig, unruly, {"listen": {"endpoints": [f"tcp/{address}"]}},
                           "--allow 'magsteer/bigmag-planar/*'"))
    time.sleep(3)
    services = trial.services()
    started += another_rig(trial, trial.desk, false)
    both = [f"tcp/{ADDRESS['rig']}:{PORT}", f"tcp/{address}"]
    started.append(lawless(trial, trial.desk, false, {"listen": {"endpoints": []}, "connect": {"endpoints": both}}, ""))
    time.sleep(4)
    cycles, unruly_cycles = [], []
    for _ in range(30):
        cycles.append(trial.status(trial.rig).get("cycle", -1))
        unruly_cycles.append(trial.status(trial.rig, "--root", unruly).get("cycle", -1))
    trial.claim("an intruder's status does not reach the rig", started[-1].poll() is None and cycles == sorted(cycles)
                and cycles[0] > 0, f"{len(cycles)} looks, cycle {cycles[0]} to {cycles[-1]}")
    trial.claim("it would without the access rules", min(unruly_cycles) > 0 and unruly_cycles != sorted(unruly_cycles),
                f"{sum(a > b for a, b in zip(unruly_cycles, unruly_cycles[1:]))} times back to another rig's cycle")
    trial.claim("nor do its services", trial.services() == services != [], f"{len(services)} as before")
    state = trial.status(trial.rig)
    trial.claim("nor its commands", state["state"] == "active", state["state"])
    for child in reversed(started):
        end(child)


def another_rig(trial, machine, root):
    options = [trial.config, "--root", root]
    return [machine.start(trial.magsteer, "sim-plant", *options, log=os.path.basename(root)),
            machine.start(trial.magsteer, "run", *options, "--passive", log=os.path.basename(root))]


def lawless(trial, machine, root, network, allowed):
    """A tunnel at `root` with another network and no access rules, started without magsteer."""
    share = machine.start(trial.magsteer, "tunnel", "share", trial.config, "--program", trial.program, "--root", root,
                          "--listen", "127.0.0.1:7999", log="lawless")
    written = os.path.join(root, "bigmag-planar.tunnel")
    while not os.path.exists(os.path.join(written, "pid")):
        time.sleep(0.1)
    folder = f"{root}-tunnel"
    shutil.copytree(written, folder)
    end(share)
    file = os.path.join(folder, "zenoh.json5")
    with open(file) as text:
        config = {**json.load(text), **network, "access_control": {"enabled": False}}
    with open(file, "w") as text:
        json.dump(config, text)
    command = f"cd {folder} && exec {trial.program} --zenoh-config zenoh.json5 --poll 20 {allowed}"
    return machine.start("sh", "-c", command, log="lawless")


def begin_again(trial):
    """The daemon ends, and another one starts while both tunnels run."""
    end(trial.daemon)
    time.sleep(1)
    trial.begin_daemon("again")
    waited = trial.heard()
    there, here = trial.status(trial.rig), trial.status(trial.desk)
    trial.claim("a new daemon starts beside the tunnel and is heard", waited is not None and
                abs(here.get("cycle", -1) - there.get("cycle", 1e9)) < 2_000, f"after {waited or 0:.1f} s")
    page = trial.desk.start(trial.magsteer, "web", trial.config, "--bind", "127.0.0.1:8090", log="web")
    time.sleep(2)
    shown = trial.desk.run(sys.executable, "-c", "import urllib.request as u;"
                           "print(u.urlopen('http://127.0.0.1:8090/metrics').read().decode())").stdout
    cycle = next((line for line in shown.splitlines() if "_cycle" in line and not line.startswith("#")), "")
    trial.claim("the desk's own page shows the rig", cycle != "" and not cycle.endswith(" 0"), cycle)
    end(page)


def begin_last(trial):
    """Both tunnels are there before there is any daemon: what the desk made must not stand in its way."""
    end(trial.daemon)
    share, watch = trial.share(), trial.watch()
    time.sleep(4)
    trial.begin_daemon("afterwards")
    waited = trial.heard()
    trial.claim("a daemon starts that finds the tunnel there first", waited is not None, f"after {waited or 0:.1f} s")
    end(watch)
    end(share)


def watch_folder(machine):
    return f"/proc/{machine.pid}/root/dev/shm/magsteer-0/bigmag-planar.tunnel"


def kill(trial, share):
    """The tunnel is killed, and comes back."""
    missed = trial.status(trial.rig)["missed"]
    with open(os.path.join(watch_folder(trial.rig), "pid")) as file:
        os.kill(int(file.read()), signal.SIGKILL)
    share.send_signal(signal.SIGKILL)
    share.wait()
    begin = trial.status(trial.rig)
    time.sleep(4)
    after = trial.status(trial.rig)
    trial.claim("the loop goes on when the tunnel is killed", after["state"] == "active" and
                after["cycle"] > begin["cycle"] + 100, f"{after['state']}, {after['missed'] - missed} periods missed")
    gone = trial.status(trial.desk)
    trial.claim("the desk says that it is deaf", gone.get("code") == 69, gone.get("error", "").strip()[:90])
    share = trial.share()
    waited = trial.heard()
    trial.claim("a new one is found by itself", waited is not None, f"after {waited or 0:.1f} s")
    return share


def measure(trial, pairs, seconds):
    """Turn by turn with tunnel, status and recorder at the desk, and without; windows of cycles."""
    windows = []
    for turn in range(2 * pairs):
        with_tunnel = turn % 2 == 1
        started = []
        if with_tunnel:
            started = [trial.share(), trial.watch()]
            if trial.heard() is None:
                raise SystemExit("the desk does not hear the rig")
            started.append(trial.desk.start(trial.magsteer, "status", trial.config, "--watch", log="status"))
            trial.record_at_desk(f"desk-{turn}")
        time.sleep(3)
        begin, work = trial.status(trial.rig)["cycle"], tunnel_work(trial.rig, with_tunnel)
        time.sleep(seconds)
        share = (tunnel_work(trial.rig, with_tunnel) - work) / seconds
        windows.append((with_tunnel, begin, trial.status(trial.rig)["cycle"], share))
        if with_tunnel:
            trial.recorded(f"desk-{turn}", ask=True)
        for child in reversed(started):
            end(child, signal.SIGINT)
        time.sleep(1)
    return windows


def tunnel_work(machine, runs):
    """Seconds of a processor that the tunnel has used on a machine."""
    if not runs:
        return 0.0
    with open(os.path.join(watch_folder(machine), "pid")) as file:
        pid = int(file.read())
    with open(f"/proc/{pid}/stat") as file:
        fields = file.read().rsplit(")", 1)[1].split()
    return (int(fields[11]) + int(fields[12])) / os.sysconf("SC_CLK_TCK")


def compare(trial, name, lost, whole):
    """What was recorded at the desk against what was recorded beside the loop, number by number."""
    part = trial.table(name)
    first, until = min(part), max(part)
    expected = {number: row for number, row in whole.items() if first <= number <= until}
    differ = sum(row != expected.get(number) for number, row in part.items())
    trial.claim(f"what the desk recorded ({name}) is what the rig did, and what is missing is counted",
                differ == 0 and len(expected) - len(part) == lost,
                f"{len(part)} of {len(expected)} cycles, {lost} counted as lost, {differ} differ")


def quantile(values, fraction):
    return sorted(values)[min(len(values) - 1, int(fraction * len(values)))] * 1e-3


def tell(cycles, windows):
    print(f"\nload {os.getloadavg()[0]:.1f} on {os.cpu_count()} processors; tunnel: what it takes of one on the rig's machine")
    print("tunnel  cycles  lateness p50    p99  p99.9 us   execution p50    p99  p99.9 us   missed   tunnel %")
    sums = {False: ([], []), True: ([], [])}

    def line(name, late, work, missed, share):
        print(f"{name:7} {len(late):6} {quantile(late, .5):13.1f} {quantile(late, .99):6.1f} {quantile(late, .999):6.1f}"
              f" {quantile(work, .5):18.1f} {quantile(work, .99):6.1f} {quantile(work, .999):6.1f} {missed:11} {share:>10}")

    for with_tunnel, begin, until, share in windows:
        rows = [row for number, row in cycles.items() if begin <= number < until]
        late, work = ([int(row[key]) for row in rows] for key in ("lateness_ns", "execution_ns"))
        sums[with_tunnel][0].extend(late)
        sums[with_tunnel][1].extend(work)
        line("yes" if with_tunnel else "no", late, work, until - begin - len(rows), f"{100 * share:.1f}")
    for with_tunnel, (late, work) in sums.items():
        line("all yes" if with_tunnel else "all no", late, work, "", "")


def main():
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("--magsteer", required=True)
    parser.add_argument("--config", required=True)
    parser.add_argument("--program", help="iox2-link-tunnel-zenoh; the one on PATH when left out")
    parser.add_argument("--pairs", type=int, default=4, help="windows with and without the tunnel")
    parser.add_argument("--logs", help="folder in which to keep what the processes said")
    parser.add_argument("--seconds", type=int, default=20, help="length of a window and of the first recording")
    arguments = parser.parse_args()
    signal.signal(signal.SIGTERM, lambda *_: sys.exit(143))
    if os.geteuid() != 0 or not (arguments.program or shutil.which("iox2-link-tunnel-zenoh")):
        print("needs root, and iox2-link-tunnel-zenoh on PATH or --program", file=sys.stderr)
        return 69
    # Below the limit of a root's length.
    with tempfile.TemporaryDirectory(prefix="mt", dir="/tmp") as folder:
        trial = None
        try:
            trial = Trial(arguments, folder)
            return carry_out(trial, arguments)
        finally:
            if trial:
                for machine in reversed(trial.machines):
                    machine.end()
            if arguments.logs:
                os.makedirs(arguments.logs, exist_ok=True)
                for name in filter(lambda name: name.endswith(".log"), os.listdir(folder)):
                    shutil.copy(os.path.join(folder, name), arguments.logs)


def carry_out(trial, arguments):
    trial.begin()
    alone(trial)
    share, watch = trial.share(), trial.watch()
    look(trial, arguments.seconds)
    refuse(trial)
    intrude(trial)
    share = kill(trial, share)
    end(watch)
    end(share)
    windows = measure(trial, arguments.pairs, arguments.seconds)
    share, watch = trial.share(), trial.watch()
    trial.claim("the desk hears the rig again", trial.heard() is not None)
    trial.record_at_desk("last")
    time.sleep(3)
    end(trial.daemon)
    report = trial.recorded("last", ask=False)
    # The tunnel lets go of a topic whose publisher has ended, be there something in its queue or not: the last of its
    # looks, 20 ms, can be missing, and then the recorder says so by the way it ended.
    trial.claim("the desk's recorder ends with the loop", report["ended"] in ("loop-ended", "daemon-gone"),
                f"{report['cycles']} cycles, {report['lost']} lost, {report['ended']}")
    whole = trial.table("whole")
    for name, report in trial.reports.items():
        compare(trial, name, report["lost"], whole)
    begin_again(trial)
    end(watch)
    end(share)
    begin_last(trial)
    tell(whole, windows)
    return 1 if trial.failed else 0


if __name__ == "__main__":
    sys.exit(main())
