#!/usr/bin/env bash
# Every kernel of backend opencl at its smallest sizes on Oclgrind, a simulated device that reports races between work
# items, values that nobody wrote, accesses beyond a buffer and wrong calls of the API. About 10 minutes.
#
# Usage: tests/oclgrind.sh [BUILD [GTEST_FILTER]]
#   BUILD has the test programs (default: build). Fails for a wrong result, and for a report that
#   tests/support/oclgrind.txt does not explain. The peak loops, which run for seconds on a real device, are left out.
set -euo pipefail
cd "$(dirname "${BASH_SOURCE[0]}")/.."
build=${1:-build}
filter=${2:-*OpenClSmallest.*}
command -v oclgrind >/dev/null || { echo "oclgrind.sh: there is no oclgrind; apt-get install oclgrind" >&2; exit 4; }

# Without optimizations and forced inlining: Oclgrind 21.10 knows neither LLVM's `freeze`, which the one makes, nor the
# declarations of scopes that the other does.
folder=$(mktemp -d)
trap 'rm -rf "$folder"' EXIT
# A process each: Oclgrind begins its log anew with every context.
list=$("$build/tests/workloads_test" --gtest_list_tests --gtest_filter="$filter" |
  awk '/^[^ ].*\.$/ { suite = $1 } /^ / { print suite $1 }')
[[ -n $list ]] || { echo "oclgrind.sh: no test ran" >&2; exit 1; }
touch "$folder/log"
while read -r name; do
  PIRT_TEST_DEVICE=Oclgrind oclgrind --log "$folder/one" --max-errors 100000 \
    --build-options "-cl-opt-disable -DINLINE=" --data-races --check-api --uninitialized \
    "$build/tests/workloads_test" --gtest_filter="$name" --gtest_brief=1 >"$folder/tests" 2>&1 </dev/null ||
    { cat "$folder/tests"; echo "oclgrind.sh: $name failed" >&2; exit 1; }
  if grep -q 'SKIPPED' "$folder/tests"; then echo "oclgrind.sh: $name was skipped" >&2; exit 1; fi
  cat "$folder/one" >>"$folder/log"
  rm -f "$folder/one"
done <<<"$list"
echo "oclgrind: $(wc -l <<<"$list") tests"

# A report is a paragraph: what it is, and where ("Kernel: name"). Alike ones of one kernel are counted.
awk -v suppressions=tests/support/oclgrind.txt '
  BEGIN {
    while ((getline line < suppressions) > 0) {
      if (line ~ /^#/ || line ~ /^ *$/) continue
      split(line, field, " *[|] *")
      kernel[++known] = field[1]; message[known] = field[2]
    }
    RS = ""; FS = "\n"
  }
  {
    what = $1; where = "-"
    sub(/ (at|to) (global|local|private|constant) memory address.*/, "", what)
    for (i = 1; i <= NF; ++i) if ($i ~ /Kernel:/) { where = $i; sub(/.*Kernel: */, "", where) }
    for (i = 1; i <= known; ++i) {
      if (where ~ "^(" kernel[i] ")$" && index(what, message[i])) { ++used[i]; next }
    }
    if (!(where SUBSEP what in seen)) first[where SUBSEP what] = $0
    ++seen[where SUBSEP what]
  }
  END {
    for (i = 1; i <= known; ++i) printf "%6d explained: %s, %s\n", used[i], kernel[i], message[i]
    for (key in seen) { ++new; printf "%6d NEW, the first:\n%s\n", seen[key], first[key] }
    exit new > 0
  }' "$folder/log"
echo "oclgrind: OK"
