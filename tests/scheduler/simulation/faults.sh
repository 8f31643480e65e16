#!/usr/bin/env bash
# Puts each fault that there was (faults/*.patch) back into a copy of the sources: it must be found within 2,000 seeds of live runs.
#
# Usage: tests/scheduler/simulation/faults.sh FOLDER [PATCH...]    FOLDER: of the copy; what is there already is brought up to date
set -euo pipefail
cd "$(dirname "${BASH_SOURCE[0]}")/../../.."
[[ $# -gt 0 ]] || { sed -n '4s/^# //p' "$0" >&2; exit 2; }
folder=$1
shift
faults=("$@")
if [[ ${#faults[@]} -eq 0 ]]; then faults=(tests/scheduler/simulation/faults/*.patch); fi
readonly last_seed=1999

mkdir -p "$folder/build"
git ls-files --cached --others --exclude-standard | sort >"$folder/build/files"
(cd "$folder" && find . -type f -not -path './build/*' -printf '%P\n' | sort | comm -23 - build/files | xargs -r -d '\n' rm)
while IFS= read -r file; do
  if [[ -f $file ]] && ! cmp -s "$file" "$folder/$file"; then cp --parents "$file" "$folder"; fi
done <"$folder/build/files"
cmake -S "$folder" -B "$folder/build" -G Ninja -DPIRT_TESTS=ON >/dev/null

missed=()
for fault in "${faults[@]}"; do
  name=$(basename "$fault" .patch)
  patch --quiet -p1 -d "$folder" <"$fault"
  cmake --build "$folder/build" --target live_simulation >"$folder/build/log" || { tail -n 30 "$folder/build/log"; exit 1; }
  found=""
  for kind in robot mix; do
    if ! "$folder/build/tests/live_simulation" "$kind" 0 $last_seed >"$folder/build/log" 2>&1; then
      found=$(grep -m 1 "^$kind: seed" "$folder/build/log")
      break
    fi
  done
  echo "$name: ${found:-NOT FOUND}"
  if [[ -z $found ]]; then missed+=("$name"); fi
  patch --quiet -R -p1 -d "$folder" <"$fault"
done
[[ ${#missed[@]} -eq 0 ]]
