#!/usr/bin/env bash
# Fuzzes for a while: run.sh SECONDS [TARGET…], all targets in turn by default. Needs `cmake --preset fuzz` and
# `cmake --build --preset fuzz`. What the fuzzer learns stays in build/fuzz/corpus/, inputs that break the contract in
# build/fuzz/findings/TARGET/, what it printed in build/fuzz/logs/.
set -euo pipefail
cd "$(dirname "${BASH_SOURCE[0]}")/../.."

seconds=$1
shift
[ $# -gt 0 ] || set -- $(basename -s .cpp tests/fuzz/targets/*.cpp)

build=build/fuzz
mkdir -p "$build/logs"
TMPDIR=$(mktemp -d "$([ -d /dev/shm ] && echo /dev/shm || echo /tmp)/diffnea-fuzz-XXXXXX")  # inputs are files in memory
export TMPDIR
trap 'rm -rf "$TMPDIR"' EXIT
# A finding must not end the run, and a fork of libFuzzer's starts over after it.
export ASAN_OPTIONS=detect_leaks=1:allocator_may_return_null=0 UBSAN_OPTIONS=print_stacktrace=1

dictionary() {
  case $1 in
    csv | csv_model | audit | trajectory) echo csv ;;
    urdf | mjcf) echo xml ;;
    world) echo world ;;
    *) echo json ;;
  esac
}
models() {  # those of the tree that the target reads
  case $1 in
    urdf) echo models/*.urdf ;;
    mjcf) echo models/*.xml ;;
    model_json) echo models/pendulum.json ;;
    surrogate) echo models/surrogate_*.json ;;
  esac
}

for target; do
  corpus=$build/corpus/$target
  mkdir -p "$corpus" "$build/findings/$target"
  for seed in $(models "$target"); do cp "$seed" "$corpus/"; done
  nice -n 19 "$build/tests/fuzz/fuzz_$target" -fork=1 -ignore_crashes=1 -ignore_ooms=1 -ignore_timeouts=1 \
    -max_total_time="$seconds" -timeout=10 -rss_limit_mb=1024 -malloc_limit_mb=512 -max_len=16384 \
    -dict="tests/fuzz/dictionaries/$(dictionary "$target").dict" -artifact_prefix="$build/findings/$target/" \
    "$corpus" "tests/fuzz/seeds/$target" >> "$build/logs/$target.log" 2>&1 || true
  printf '%-14s %s\n' "$target" "$(grep -a 'cov: ' "$build/logs/$target.log" | tail -1)"
done
