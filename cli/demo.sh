#!/usr/bin/env bash
# Set-up and the main job on a Debian 12 machine that has nothing: installs, builds, characterizes this machine, schedules a
# robot's mix in all four modes, prints the report. Can be run again at any time.
#
# Usage: cli/demo.sh [IMAGES]     IMAGES: a folder with your own PNG or JPEG pictures (default: generated ones)
set -euo pipefail
cd "$(dirname "${BASH_SOURCE[0]}")/.."
source cli/packages.sh
trap 'echo "demo: FAILED (line $LINENO)" >&2' ERR

images=()
if [[ $# -gt 0 ]]; then images=(--images "$1"); fi

install_packages "${PIRT_PACKAGES[@]}"
build_pirt build -DPIRT_TESTS=OFF

out=build/demo
mkdir -p "$out"
rm -f "$out/profile.db"
say "characterize: every workload on every unit of this machine (about two minutes)"
build/pirt characterize --quick --db "$out/profile.db" "${images[@]}"
for mode in latency throughput energy advanced; do
  say "schedule: full-robot, $mode mode, 60 s of virtual time"
  build/pirt schedule --mode "$mode" --profile "$out/profile.db" --json "$out/$mode.json"
done
say "report"
build/pirt report "$out/profile.db" "$out"/{latency,throughput,energy,advanced}.json
build/pirt report "$out/profile.db" "$out"/{latency,throughput,energy,advanced}.json \
  --format html -o "$out/report.html"
say "demo: OK (profile database, run records and report.html are in $out)"
