#!/usr/bin/env bash
# Cases of the system around pirt that lie beside the project (../shared/cases/systems): launchers, containers, boards, other people's tools.
# Each is a script, NAME/cmd, whose output is held against what is said of it here; a case without a word here only has to end. Nothing is timed.
#
# Usage: tests/systems.sh PIRT [NAME...]     NAME: the case, or how it begins: 07
# Exit codes: 0 all hold, 1 one does not, 77 there are none here.
set -uo pipefail
cd "$(dirname "${BASH_SOURCE[0]}")/.."
PIRT=$(realpath "$1")
export PIRT PIRT_SOURCE=$PWD PIRT_TUNING=${PIRT_TUNING:-none}
shift
folder=${PIRT_CASES:-../shared/cases/systems}
if [[ ! -d $folder ]]; then
  echo "skipped: no data in $folder"
  exit 77
fi

# has / hasnt PATTERN: the case's output has a line that matches (grep -E), or none.
has() { grep -qE -- "$1" <<<"$output" || wrong "no line matches: $1"; }
hasnt() { ! grep -qE -- "$1" <<<"$output" || wrong "a line matches: $1"; }
wrong() { problems+=("$1"); }

expect_02() { has '^rc=0$' && hasnt 'on battery'; }
expect_03() { has '"level":"good"' && hasnt '100\.0|cooling'; }
expect_04() { has VDD_IN && has VDD_GPU && has VDD_CPU && has 'rc=0'; }
expect_06() { has 'rc=0|takes no new file'; }
expect_07() {
  has 'sample rc=0'  # on a busy machine the others may say that they cannot tell
  hasnt 'regress rc=[124]|parse error|no answer'
}
expect_08() {
  has 'env\.ONEDNN_MAX_CPU_ISA.*identity'
  has 'env\.OMP_THREAD_LIMIT.*identity'
  hasnt 'facts: the same|doctor: no word'
}
expect_10() { has 'rc=0|noexec' && has 'TMPDIR|rc=0'; }
expect_11() { has 'sobel' && has 'may not be made executable' && hasnt 'crashed \(SIG'; }
expect_12() { has 'list rc=0' && has 'schedule rc=0' && has 'characterize rc=0' && has 'doctor rc=[01]$' && has 'report rc=0'; }
expect_14() { has "control group" && has '"level":"spoils"' && has 'ran out of memory'; }
expect_13() { has 'rc=0|replaced' && hasnt 'another program'; }
expect_15() { has '0,1 \(1593 MHz, capacity 572\) and 2,3 \(2150 MHz, capacity 1024\)'; }
expect_17() { has '^package-0 ' && hasnt 'counted once'; }
expect_18() { has 'Esocket0.*package' && hasnt 'no Esocket0'; }
expect_20() {
  has 'rc=1|the time was up' && has 'junit: well-formed' && has 'markdown and JSON are UTF-8' && hasnt '^classname'
}
expect_23() { hasnt 'overlaps [1-9]|negative [1-9]' && has 'c.json slices [0-9]+ tracks [0-9]+ overlaps 0 negative 0'; }
expect_24() { hasnt 'rc=(1|2|137)$' && has 'no JetStream' && has 'storage' && has 'max_payload'; }
expect_25() { has 'escape sequences: 0'; }
expect_27() { hasnt 'internal error|rc=(1[2-9][0-9]|2[0-9][0-9])$'; }
expect_29() { has '^rc=0' && hasnt 'internal error'; }
expect_32() { has 'rc=4' && hasnt 'still running'; }
expect_33() { has '^rc=0' && has 'stdin closed rc=0' && has 'umask 0777 rc=[02]' && has 'nonexistent rc=[04]'; }
expect_34() { has '^same' && has 'rc=0'; }
expect_35() { has 'no /sys rc=0' && has 'subset=pid rc=0' && has 'no /proc schedule rc=0' && has 'no /proc characterize rc=[04]' && has 'as PID 1 rc=0'; }
expect_36() {
  has '^p rc=0|holds no measurements'  # on a busy machine a second is short
  has '^wal rc=(0|2)' && has 'copy it \(cp ro/wal' && has '^hot rc=2' && has 'copy both \(cp ro/hot.db ro/hot.db-journal' && has '^write rc=2'
}
expect_40() { hasnt 'no file of that name|: [1-9]|: 0 [1-9]'; }

# Case 34 needs a locale that few machines have: made from Debian's sources.
prepare_34() {
  LOCPATH=$scratch
  localedef -i de_DE -f UTF-8 "$LOCPATH/de_DE.UTF-8" && export LOCPATH
}

# Of files, databases and clocks: what somebody else's work holds, or takes minutes.
left_out='19|21|22|28|30|31|37|38|39'

failed=()
scratch=$(mktemp -d)
trap 'rm -rf "$scratch"' EXIT
for each in "$folder"/*/; do
  name=$(basename "$each")
  number=${name%%-*}
  wanted=$([[ $# -eq 0 ]] && echo true || echo false)
  for wish in "$@"; do [[ $name != "$wish"* ]] || wanted=true; done
  $wanted || continue
  if [[ $# -eq 0 && $number =~ ^($left_out)$ ]]; then continue; fi
  problems=()
  output=$(
    if declare -F "prepare_$number" >/dev/null; then "prepare_$number"; fi
    timeout 600 bash "$each/cmd" 2>&1
  )
  code=$?
  if [[ $code -eq 77 ]] || grep -qE 'unshare failed|Operation not permitted|cgroup.*(No such file|Read-only)' <<<"$output"; then
    echo "$name: skipped: $(head -n 1 <<<"$output")"
    continue
  fi
  [[ $code -ne 124 ]] || wrong "it hangs"
  if declare -F "expect_$number" >/dev/null; then "expect_$number"; fi
  if [[ ${#problems[@]} -eq 0 ]]; then
    echo "$name: holds"
  else
    failed+=("$name")
    printf '%s: DOES NOT HOLD: %s\n' "$name" "$(cat "$each/expect")"
    printf '  %s\n' "${problems[@]}"
    sed 's/^/  | /' <<<"$output"
  fi
done
[[ ${#failed[@]} -eq 0 ]] || { echo "systems.sh: do not hold: ${failed[*]}"; exit 1; }
