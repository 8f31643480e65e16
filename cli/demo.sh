#!/usr/bin/env bash
# Set-up and the main job on a Debian 12 or 13 machine that has nothing: installs, builds, characterizes this machine, schedules a robot's mix in
# all four modes, reports. Prints a screen or two; everything else goes to files in build/demo. Can be run again at any time.
#
# Usage: cli/demo.sh [IMAGES]     IMAGES: a folder with your own PNG or JPEG pictures (default: generated ones)
set -euo pipefail
if [[ $# -gt 1 || ${1:-} == -* ]]; then echo "usage: cli/demo.sh [IMAGES]" >&2; exit 2; fi
images=()
if [[ $# -eq 1 ]]; then
  if [[ ! -e $1 ]]; then echo "demo: there is no folder '$1'" >&2; exit 2; fi
  images=(--images "$(realpath -- "$1")")
fi
cd "$(dirname "${BASH_SOURCE[0]}")/.."
source cli/packages.sh
out=build/demo
mkdir -p "$out"
steps=5 number=0

# show: the last line that a step has printed, on a terminal at once, elsewhere once a minute; all of them go to file $1.
show() {
  local line begun=$SECONDS minutes=0
  while IFS= read -r line; do
    printf '%s\n' "$line"
    if [[ -t 2 ]]; then
      printf '\r\e[K  %.*s' $((${COLUMNS:-80} - 3)) "$line" >&2
    elif (((SECONDS - begun) / 60 > minutes)); then
      minutes=$(((SECONDS - begun) / 60))
      printf '      %d min: %.100s\n' "$minutes" "$line" >&2
    fi
  done >"$1"
  if [[ -t 2 ]]; then printf '\r\e[K' >&2; fi
}

# step NAME WHAT COMMAND...: one line, and a second with how long it took; what it prints is in build/demo/NAME.log.
step() {
  local log=$out/$1.log begun=$SECONDS code
  number=$((number + 1))
  printf '[%d/%d] %s\n' "$number" "$steps" "$2"
  set +e
  (set -e; "${@:3}") 2>&1 | show "$log"
  code=$?
  set -e
  if [[ $code -ne 0 ]]; then
    tail -n 20 "$log" >&2
    echo "demo: FAILED in step $number; all of its output: $log" >&2
    exit "$code"
  fi
  printf '      %d:%02d min\n' $(((SECONDS - begun) / 60)) $(((SECONDS - begun) % 60))
}

schedule() {
  local mode
  for mode in latency throughput energy advanced; do
    build/pirt schedule --mode "$mode" --profile "$out/profile.db" --json "$out/$mode.json"
  done
}

report() {
  build/pirt report text "$out/profile.db" "$out"/{latency,throughput,energy,advanced}.json
  build/pirt report page "$out/profile.db" "$out"/{latency,throughput,energy,advanced}.json -o "$out/report.html"
}

rm -f "$out/profile.db"
echo "pirt: measures robot workloads on every processing unit of this machine, and schedules a robot's tasks with what it finds."
step packages "packages: what is missing of Debian's" install_packages "${PIRT_PACKAGES[@]}"
# A build that is there stays what it is: with its tests, which the demo does not need.
fresh=(-DPIRT_TESTS=OFF)
if [[ -f build/CMakeCache.txt ]]; then fresh=(); fi
PIRT_TARGET="pirt pirt_manual" step build "build: some 5 minutes on two cores the first time" build_pirt build "${fresh[@]}"
platform=host
if build/pirt list platforms | grep '^host-gpu  *yes ' >/dev/null; then platform=host-gpu; fi
step characterize "characterize: every workload on every unit of this machine (platform $platform), some 2 minutes (up to 6 more where meters are read)" \
  build/pirt characterize --quick --platform "$platform" --db "$out/profile.db" "${images[@]}"
step schedule "schedule: a robot's tasks (mix full-robot), 60 s of virtual time in each of four modes" schedule
step report "report: as text, and as a page to look at" report
echo
build/pirt report compare "$out/profile.db"
echo
grep 'rows are uncertain' "$out/characterize.log" || true
echo "demo: OK"
echo "A page with all of it:     $out/report.html"
echo "The same as text:          $out/report.log"
echo "Profile, runs, and logs:   $out"
