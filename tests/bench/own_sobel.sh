#!/bin/sh
# A module's Sobel filter by OpenCV (tests/examples/module/fast.cpp) beside pirt's own, which is the same call, on one core: how many
# of DECISIONS find a difference, either one in the place of the other in turns.
# Usage: tests/bench/own_sobel.sh DECISIONS [build]
set -u
if [ $# -lt 1 ]; then sed -n 's/^# Usage/usage/p' "$0" >&2; exit 2; fi
build=$(realpath "${2:-build}")
folder=$(mktemp -d)
trap 'rm -rf "$folder"' EXIT
printf 'platform: one_core\nunits: {cpu: {backend: cpu, cores: [0], active_w: 1}}\n' >"$folder/one_core.yaml"
same=0
for seed in $(seq "$1"); do
  pair=fast.sobel=sobel@640x480
  if [ $((seed % 2)) -eq 0 ]; then pair=sobel@640x480=fast.sobel; fi
  "$build/pirt" regress --as $pair --workloads "$build/tests/fast.so" --platform "$folder/one_core.yaml" --units cpu \
    --seed "$seed" --ledger "$folder/$seed" >"$folder/out" 2>&1
  code=$?
  if [ $code -eq 0 ]; then same=$((same + 1)); else cat "$folder/out"; fi
  echo "$seed: $pair: exit code $code"
done
echo "not slower: $same of $1"
