#!/usr/bin/env bash
# Lateness of the daemon's loop beside cyclictest's (Debian package rt-tests), on this machine, at the same rate, priority
# and CPU, alternately and in both orders. The simulated plant runs on the other CPU the whole time; the daemon steers it.
# Both keep CPUs from idling while they measure (cyclictest by default, the daemon by idle_latency_us = 0).
#
# Prints for each rate the medians over the runs, their ratio, missed periods and the machine's steal time.
#
#   tests/scripts/beside_cyclictest.sh [PROGRAM]
#
# PROGRAM is target/release/magsteer when left out. Environment: RUNS (5), SECONDS_EACH (10), RATES ("1000 10000"),
# PRIORITY (80), LOOP_CPU (1), PLANT_CPU (0), SPIN_US (0), OUT (a folder for the raw results; a temporary one).
set -euo pipefail

here=$(cd "$(dirname "$0")/../.." && pwd)
program=${1:-$here/target/release/magsteer}
runs=${RUNS:-5}
seconds=${SECONDS_EACH:-10}
rates=${RATES:-"1000 10000"}
priority=${PRIORITY:-80}
loop_cpu=${LOOP_CPU:-1}
plant_cpu=${PLANT_CPU:-0}
spin=${SPIN_US:-0}

need() {
    command -v "$1" >/dev/null || { echo "$1 is missing: sudo apt-get install -y $2" >&2; exit 69; }
}
need cyclictest rt-tests
need python3 python3
need taskset util-linux
[ -x "$program" ] || { echo "$program is missing: cargo build --release" >&2; exit 66; }
chrt --fifo "$priority" true 2>/dev/null || { echo "no right to SCHED_FIFO $priority: run as root, or see magsteer doctor" >&2; exit 77; }

out=${OUT:-$(mktemp -d)}
mkdir -p "$out"
root=$(mktemp -d /dev/shm/beside.XXXXXX)
plant=""
daemon=""
finish() {
    for process in $daemon $plant; do kill "$process" 2>/dev/null && wait "$process" 2>/dev/null || true; done
    rm -rf "$root"
}
trap finish EXIT

steal() { awk '/^cpu / { print $9, $2+$3+$4+$5+$6+$7+$8+$9 }' /proc/stat; }

# Lateness of each wake-up in ns, one a line: the values themselves, since its histogram has whole microseconds.
cyclictest_run() { # rate, result
    local before after
    before=$(steal)
    cyclictest -q -m -t1 -p "$priority" -a "$loop_cpu" -i $((1000000 / $1)) -D "$seconds" -N -v > "$2.raw" 2> "$2.err"
    after=$(steal)
    awk -F: '$1 ~ /^ *0$/ && NF == 3 { print $3 + 0 }' "$2.raw" > "$2"
    rm "$2.raw"
    echo "$before $after" > "$2.steal"
}

state() { "$program" status "$out/config.toml" --root "$root" --json 2>/dev/null | grep -o '"state":"[a-z-]*"' | cut -d'"' -f4; }

until_state() {
    for _ in $(seq 200); do
        [ "$(state || true)" = "$1" ] && return 0
        sleep 0.05
    done
    echo "the daemon did not come to state $1; see $out" >&2
    exit 1
}

daemon_run() { # rate, result
    local before after
    "$program" run "$out/config.toml" --root "$root" --arm --json > "$2" 2> "$2.err" &
    daemon=$!
    until_state armed
    "$program" target set m1=70deg m2=110deg --config "$out/config.toml" --root "$root" >/dev/null
    "$program" go --config "$out/config.toml" --root "$root" >/dev/null
    before=$(steal)
    sleep "$seconds"
    after=$(steal)
    state > "$2.state" || true
    kill -TERM "$daemon"
    wait "$daemon" || true
    daemon=""
    echo "$before $after" > "$2.steal"
}

for rate in $rates; do
    cat > "$out/config.toml" <<CONFIG
extends = "$here/config/bigmag-planar.toml"

[daemon]
rate_hz = $rate.0
priority = $priority
cpu = $loop_cpu
idle_latency_us = 0
spin_us = $spin.0

[plant.real_time]
wake_us = 500
CONFIG
    "$program" check "$out/config.toml" >/dev/null
    taskset -c "$plant_cpu" "$program" sim-plant "$out/config.toml" --root "$root" --json > "$out/plant-$rate.json" 2>"$out/plant-$rate.err" &
    plant=$!
    sleep 0.5
    for run in $(seq "$runs"); do
        if [ $((run % 2)) = 1 ]; then
            cyclictest_run "$rate" "$out/cyclictest-$rate-$run"
            daemon_run "$rate" "$out/magsteer-$rate-$run.json"
        else
            daemon_run "$rate" "$out/magsteer-$rate-$run.json"
            cyclictest_run "$rate" "$out/cyclictest-$rate-$run"
        fi
    done
    kill -TERM "$plant"
    wait "$plant" || true
    plant=""
done

python3 - "$out" "$runs" $rates <<'PYTHON'
import json, statistics, sys

out, runs, rates = sys.argv[1], int(sys.argv[2]), sys.argv[3:]
QUANTILES = [("p50", 0.5), ("p99", 0.99), ("p999", 0.999), ("max", 1.0)]


def stolen(path):
    stolen0, all0, stolen1, all1 = map(int, open(path + ".steal").read().split())
    return 100.0 * (stolen1 - stolen0) / max(all1 - all0, 1)


def median(values):
    return statistics.median(values)


def span(values):
    return f"{median(values):9.1f} ({min(values):.1f} to {max(values):.1f})"


for rate in rates:
    period_us = 1e6 / int(rate)
    theirs, ours, missed, steals, states = [], [], [0, 0], [[], []], set()
    for run in range(1, runs + 1):
        path = f"{out}/cyclictest-{rate}-{run}"
        values = sorted(int(line) * 1e-3 for line in open(path))
        theirs.append({name: values[min(int(share * len(values)), len(values) - 1)] for name, share in QUANTILES})
        # A wake-up that is late by whole periods skips them, as the daemon's does.
        missed[0] += sum(int(value // period_us) for value in values)
        steals[0].append(stolen(path))
        path = f"{out}/magsteer-{rate}-{run}.json"
        report = json.load(open(path))
        ours.append(report["loop"])
        missed[1] += report["loop"]["missed"]
        steals[1].append(stolen(path))
        states.add(open(path + ".state").read().strip() or "gone")
    print(f"\n{rate} Hz, medians over {runs} runs each (least to greatest), us; lateness")
    print(f"{'':8} {'cyclictest':28} {'magsteer':28} ratio")
    for name, _ in QUANTILES:
        left, right = [it[name] for it in theirs], [it["lateness_us"][name] for it in ours]
        print(f"{name:8} {span(left):28} {span(right):28} {median(right) / median(left):.2f}")
    print(f"{'missed':8} {missed[0]:9d} {'':18} {missed[1]:9d}   of {sum(it['cycles'] for it in ours) + missed[1]}")
    print(f"{'steal %':8} {median(steals[0]):9.2f} {'':18} {median(steals[1]):9.2f}   steering at the end: {', '.join(states)}")
    rows = ["execution_us", "pose_to_command_us", "pose_to_driver_us", "round_trip_us"]
    print(f"magsteer alone, us       {'p50':>10} {'p99':>10} {'p99.9':>10} {'max':>10}")
    lines = [(row, [it[row] for it in ours]) for row in rows]
    lines += [(f"  phase {name}", [it["phases_us"][name] for it in ours]) for name in ours[0]["phases_us"]]
    for row, values in lines:
        cells = " ".join(f"{median([it[name] for it in values]):10.1f}" for name, _ in QUANTILES)
        print(f"{row:24} {cells}")
print(f"\nraw results: {out}")
PYTHON
