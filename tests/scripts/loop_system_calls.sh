#!/usr/bin/env bash
# System calls of the control loop's thread while it steers and faults come and go (config/faults/flicker.toml), counted by strace
# (Debian package strace). Between a joining and a leaving peer there must be one a cycle: the wait for the next deadline. The clock is
# read without any. Prints allocations of the loop too, beyond the transport's one a message: none.
#
#   tests/scripts/loop_system_calls.sh [PROGRAM]
#
# PROGRAM is target/release/magsteer when left out. Environment: SECONDS_EACH (100: 100,000 cycles at 1 kHz). Ends with 1
# when another call than the wait was made.
set -euo pipefail

here=$(cd "$(dirname "$0")/../.." && pwd)
program=${1:-$here/target/release/magsteer}
seconds=${SECONDS_EACH:-100}
command -v strace >/dev/null || { echo "strace is missing: sudo apt-get install -y strace" >&2; exit 69; }
[ -x "$program" ] || { echo "$program is missing: cargo build --release" >&2; exit 66; }

file=$here/config/bigmag-planar.toml
root=$(mktemp -d /dev/shm/calls.XXXXXX)
counts=$root/counts
plant=""
daemon=""
finish() {
    for process in $daemon $plant; do kill "$process" 2>/dev/null && wait "$process" 2>/dev/null || true; done
    rm -rf "$root"
}
trap finish EXIT

state() { "$program" status "$file" --root "$root" --json 2>/dev/null | grep -o '"state":"[a-z-]*"' | cut -d'"' -f4; }

"$program" sim-plant "$file" --root "$root" --allow-faults --fault-plan "$here/config/faults/flicker.toml" >/dev/null 2>"$root/plant.err" &
plant=$!
sleep 0.5
kill -0 "$plant" 2>/dev/null || { cat "$root/plant.err" >&2; exit 1; }
"$program" run "$file" --root "$root" --arm >/dev/null 2>"$root/daemon.err" &
daemon=$!
for _ in $(seq 200); do [ "$(state || true)" = armed ] && break; sleep 0.05; done
"$program" target set m1=70deg m2=110deg --config "$file" --root "$root" >/dev/null
"$program" go "$file" --root "$root" >/dev/null
# Operators have come and gone; the loop's ports take notice within some cycles.
sleep 2
loop=""
for task in /proc/"$daemon"/task/*; do
    [ "$(cat "$task/comm")" = magsteer-loop ] && loop=${task##*/}
done
[ -n "$loop" ] || { echo "the daemon has no loop; it said:" >&2; cat "$root/daemon.err" >&2; exit 1; }
timeout --signal=INT "$seconds" strace -qq -c -p "$loop" -o "$counts" || true
cat "$counts"
"$program" status "$file" --root "$root" --json | grep -oE '"(state|cycle|missed|alloc_in_cycle)":[^,}]*' | tr '\n' ' '
echo
awk '$NF ~ /^[a-z_0-9]+$/ && $4 ~ /^[0-9]+$/ && $NF != "total" && $NF !~ /^(clock_nanosleep|restart_syscall)/ { other = 1; print "not expected: " $0 }
     END { exit other }' "$counts"
