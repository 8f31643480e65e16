#!/usr/bin/env bash
# Set-up and tests, in stages: installs what each needs, builds, runs. Can be run again at any time, and goes on where it was interrupted.
#
# Usage: tests/run.sh                          every test (stage `tests`)
#        tests/run.sh --long                   every stage: the whole, before a release
#        tests/run.sh --stage NAME             this stage, or those whose names begin with it: asan; again for more
#        tests/run.sh --list                   the stages, and which have passed for the sources as they are
# --fresh: also what has passed already for the same sources, packages and compiler. CI skips nothing either.
set -eEuo pipefail
cd "$(dirname "${BASH_SOURCE[0]}")/.."
source cli/packages.sh

usage() {
  sed -n '4,8s/^# //p' tests/run.sh >&2
  exit 2
}

long=false list=false fresh=false chosen=()
if [[ ${CI:-} == true ]]; then fresh=true; fi
while [[ $# -gt 0 ]]; do
  case $1 in
    --long) long=true ;;
    --fresh) fresh=true ;;
    --list) list=true ;;
    --stage) [[ $# -gt 1 ]] || usage; chosen+=("$2"); shift ;;
    *) usage ;;
  esac
  shift
done

# stage NAME READS INSTALLS SHOWS COMMAND...: declares one (tests/stages.sh).
names=()
declare -A reads installs shows command
stage() {
  names+=("$1")
  reads[$1]=$2 installs[$1]=$3 shows[$1]=$4
  command[$1]=$(printf '%q ' "${@:5}")
}
source tests/stages.sh

# find_versions PACKAGE...: sets `versions` to those of the packages and of all that they need.
declare -A known_versions
find_versions() {
  if [[ -z ${known_versions[$*]:-} ]]; then
    known_versions[$*]=$(apt-cache depends --recurse --installed --no-{recommends,suggests,conflicts,breaks,replaces,enhances} "$@" |
      grep '^[a-z0-9]' | sort -u | xargs dpkg-query -W 2>/dev/null | sha256sum) || true  # virtual packages have no version
  fi
  versions=${known_versions[$*]}
}

# functions_of NAME...: the text of these functions and of all that they call.
functions_of() {
  local called
  mapfile -t called < <(declare -F | cut -d ' ' -f 3 | grep -xFf <(declare -f "$@" | grep -oE '\w+'))
  if [[ ${called[*]} == "$*" ]]; then declare -f "$@"; else functions_of "${called[@]}"; fi
}

# find_fingerprint STAGE: sets `fingerprint`, of all that it compiles and reads; empty where that is not known: these sources are not git's.
find_fingerprint() {
  local paths packages versions
  fingerprint=""
  git rev-parse --is-inside-work-tree &>/dev/null || return 0
  read -ra paths <<<"${reads[$1]}"
  read -ra packages <<<"${installs[$1]}"
  find_versions "${packages[@]}"
  fingerprint=$({
    git ls-files -z --cached --others --exclude-standard --deduplicate -- "${paths[@]}" | sort -z | xargs -0 sha256sum 2>/dev/null || true
    printf '%s\n' "${command[$1]}" "$versions" "${CXX:-}" "${CXXFLAGS:-}" "${LDFLAGS:-}"
    functions_of build_pirt run_tests run_left "${command[$1]%% *}"
    "${CXX:-c++}" --version 2>/dev/null || true
    uname -m
    grep -m 1 '^model name' /proc/cpuinfo || true
    find "${PIRT_DATA:-../shared/data}" -printf '%P %s\n' 2>/dev/null | sort || true
    find ../shared/cases -type f -print0 2>/dev/null | sort -z | xargs -0r sha256sum || true
  } | sha256sum | cut -c -64)
}

# What has passed is kept here: STAGE holds its fingerprint and when that was, STAGE.ledger the tests of one that was interrupted.
stamps=build/stages

# has_passed STAGE: with the sources as they are. Sets `fingerprint`.
has_passed() {
  find_fingerprint "$1"
  [[ -n $fingerprint && $(head -n 1 "$stamps/$1" 2>/dev/null) == "$fingerprint" ]]
}

# run_stage NAME ALWAYS: unless it has passed for the same fingerprint, which does not count where ALWAYS is true. Sets `failed`.
run_stage() {
  local begun=$SECONDS packages code was took
  current=$1
  read -ra packages <<<"${installs[$current]}"
  if [[ ${packages[*]} == *-14* && $(debian_release 2>/dev/null) == trixie ]]; then
    say "$current: SKIPPED, clang 14 is Debian 12's"
    return
  fi
  if ! install_packages "${packages[@]}"; then
    failed+=("$current")
    say "$current: FAILED, its packages cannot be installed"
    return
  fi
  if has_passed "$current" && ! $2; then
    say "$current: has passed with the same sources, $(tail -n 1 "$stamps/$current") (--fresh runs it again)"
    return
  fi
  say "$current: ${shows[$current]}"
  if $2 || [[ -z $fingerprint || $(head -n 1 "$stamps/$current.ledger" 2>/dev/null) != "$fingerprint" ]]; then
    printf '%s\n' "$fingerprint" >"$stamps/$current.ledger"
  fi
  was=$fingerprint
  set +e
  (
    set -e
    trap 'echo "$current: FAILED (${BASH_SOURCE[0]}, line $LINENO)" >&2' ERR
    eval "${command[$current]}"
  )
  code=$?
  set -e
  if [[ $code -eq 77 ]]; then
    say "$current: SKIPPED, see above"
    return
  fi
  took=$(printf '%d:%02d min' $(((SECONDS - begun) / 60)) $(((SECONDS - begun) % 60)))
  if [[ $code -ne 0 ]]; then
    failed+=("$current")
    say "$current: FAILED after $took"
    return
  fi
  find_fingerprint "$current"
  if [[ $fingerprint == "$was" ]]; then  # nobody has edited meanwhile
    printf '%s\n' "$fingerprint" "on $(date '+%F %R') in $took" >"$stamps/$current"
  fi
  rm -f "$stamps/$current.ledger"
  say "$current: passed in $took"
}

# run_tests FOLDER [OPTION...]: tests of a build, one more at a time than there are cores, since some wait (nothing asserts wall time).
run_tests() {
  ctest --test-dir "$1" --output-on-failure -j $(($(nproc) + 1)) --no-tests=error "${@:2}" | tee "$stamps/log"
  grep -E '^[0-9]+% tests passed' "$stamps/log" >"$stamps/closing" || true
}

# run_left FOLDER [OPTION...]: the same, but for those that the ledger says have passed: seed ranges of a stage that was interrupted.
run_left() {
  local passed line left=(--no-tests=error)
  passed=$(tail -n +2 "$stamps/$current.ledger" | sed 's/[.]/\\./g' | paste -sd'|')
  if [[ -n $passed ]]; then
    say "$current: passed already with the same sources: $(tail -n +2 "$stamps/$current.ledger" | paste -sd' ')"
    left=(--no-tests=ignore -E "^($passed)\$")
  fi
  ctest --test-dir "$1" --output-on-failure -j "$(nproc)" "${left[@]}" "${@:2}" |
    while IFS= read -r line; do
      printf '%s\n' "$line"
      if [[ $line =~ Test\ +#[0-9]+:\ ([^ ]+)\ \.+\ +Passed ]]; then printf '%s\n' "${BASH_REMATCH[1]}" >>"$stamps/$current.ledger"; fi
    done
}

list_stages() {
  local name state
  for name in "${names[@]}"; do
    state="to run"
    if [[ -f $stamps/$name ]] && has_passed "$name"; then state="passed $(tail -n 1 "$stamps/$name")"; fi
    printf '%-20s %s; %s\n' "$name" "${shows[$name]}" "$state"
  done
}

# selected: the names that --stage asks for.
selected() {
  local name wish found
  for wish in "${chosen[@]}"; do
    found=false
    for name in "${names[@]}"; do
      if [[ $name == "$wish" || $name == "$wish"-* ]]; then found=true && printf '%s\n' "$name"; fi
    done
    $found || { echo "tests/run.sh: no stage '$wish'; there are: ${names[*]}" >&2; return 2; }
  done
}

mkdir -p "$stamps"
rm -f "$stamps/closing"
if $list; then
  list_stages
  exit
fi
always=$fresh
if $long; then
  chosen=("${names[@]}")
elif [[ ${#chosen[@]} -eq 0 ]]; then
  chosen=(tests) always=true  # who asks for the tests gets them
fi
wanted=$(selected)
failed=()
for each in $wanted; do run_stage "$each" "$always"; done
if [[ ${#failed[@]} -gt 0 ]]; then
  say "tests: FAILED: ${failed[*]}"
  exit 1
fi
say "tests: OK"
if [[ -f $stamps/closing ]]; then cat "$stamps/closing"; fi
