#!/usr/bin/env bash
# Puts each fault that there was (faults/*.patch) back into a copy of the sources: it must be found within 2,000 seeds of live runs.
#
# Usage: tests/scheduler/simulation/faults.sh FOLDER [PATCH...]    FOLDER: of the copy and its build, made anew; default: all patches
set -euo pipefail
cd "$(dirname "${BASH_SOURCE[0]}")/../../.."
[[ $# -gt 0 ]] || { sed -n '4s/^# //p' "$0" >&2; exit 2; }
folder=$1
shift
faults=("$@")
if [[ ${#faults[@]} -eq 0 ]]; then faults=(tests/scheduler/simulation/faults/*.patch); fi
readonly last_seed=1999
rm -rf "$folder"
mkdir -p "$folder/source"
git ls-files -z --cached --others --exclude-standard | xargs -0 tar cf - --ignore-failed-read 2>/dev/null | tar xf - -C "$folder/source"
cmake -S "$folder/source" -B "$folder/build" -G Ninja -DPIRT_TESTS=ON >/dev/null
missed=()
for fault in "${faults[@]}"; do
  name=$(basename "$fault" .patch)
  patch --quiet -p1 -d "$folder/source" <"$fault"
  cmake --build "$folder/build" --target live_simulation >"$folder/log" || { tail -n 30 "$folder/log"; exit 1; }
  found=""
  for kind in robot mix; do
    if ! "$folder/build/tests/live_simulation" "$kind" 0 $last_seed >"$folder/log" 2>&1; then
      found=$(grep -m 1 "^$kind: seed" "$folder/log")
      break
    fi
  done
  echo "$name: ${found:-NOT FOUND}"
  if [[ -z $found ]]; then missed+=("$name"); fi
  patch --quiet -R -p1 -d "$folder/source" <"$fault"
done
[[ ${#missed[@]} -eq 0 ]]
