#!/usr/bin/env bash
# pirt for ARM's boards: built for aarch64 against Debian's packages of that architecture, and run under qemu: the tests of scheduler/ but
# for those that run live, those of characterize/ that measure nothing, and the whole program, which has to say and write what the one built
# for this machine does, and to replay its traces.
#
# Usage: tests/aarch64.sh [PROGRAM]     on Debian, whose release the sysroot has; else it is skipped (exit code 77)
#   PROGRAM is pirt, built for this machine (default: build/pirt). Everything is made in build-aarch64; its sysroot is kept.
set -euo pipefail
cd "$(dirname "${BASH_SOURCE[0]}")/.."
source cli/packages.sh
program=${1:-build/pirt}
sysroot=$PWD/build-aarch64/sysroot
release=$(debian_release)  # compilers that know each other's libraries
[[ -x $program ]] || { echo "aarch64.sh: there is no program '$program'; build pirt for this machine first" >&2; exit 2; }

# What of pirt's packages is linked, as of this release: libopencv-dev and libyaml-cpp-dev cannot be installed beside this machine's.
make_sysroot() {
  local packages link libraries=$sysroot/usr/lib/aarch64-linux-gnu
  packages=$(printf '%s\n' "${PIRT_PACKAGES[@]}" "${PIRT_NATS_PACKAGES[@]}" "${PIRT_BAG_PACKAGES[@]}" libgtest-dev libgmock-dev libc6-dev |
    grep -- '-\(dev\|headers\)$' | paste -sd,)
  if [[ $(cat "$sysroot.packages" 2>/dev/null) == "$release $packages" ]]; then return; fi
  say "sysroot: Debian's packages for arm64"
  rm -rf "$sysroot"
  mmdebstrap --variant=extract --architectures=arm64 --include="$packages" --logfile="$sysroot.log" "$release" "$sysroot" \
    http://deb.debian.org/debian || { tail -n 5 "$sysroot.log" >&2; exit 4; }
  [[ -e $sysroot/lib ]] || ln -s usr/lib "$sysroot/lib"  # base-files' link, which nothing that is linked needs
  # Links within it, which would lead out of it; and those that its packages' scripts would have made.
  find "$sysroot/usr/lib" "$sysroot/lib" -lname '/*' | while read -r link; do ln -srfn "$sysroot$(readlink "$link")" "$link"; done
  for link in blas lapack; do
    ln -sfn "$link/lib$link.so.3" "$libraries/lib$link.so.3"
    ln -sfn "$link/lib$link.so" "$libraries/lib$link.so"
  done
  # And paths that their packages of CMake have written out.
  find "$libraries/cmake" -name '*.cmake' -exec sed -i "s#\([;\"]\)/usr/lib/aarch64-linux-gnu/#\1$libraries/#g" {} +
  # What qemu would take for this machine's: it looks up each path there first.
  rm -rf "$sysroot"/{dev,home,proc,root,run,sys,tmp,var}
  printf '%s\n' "$release $packages" >"$sysroot.packages"
}

on_arm() { qemu-aarch64 -L "$sysroot" "$@"; }

mkdir -p build-aarch64
make_sysroot
say "build: build-aarch64"
cmake --preset aarch64 >/dev/null
cmake --build --preset aarch64

# tests_of FOLDER SUITE...: without these suites.
tests_of() {
  say "tests under qemu: $1/"
  on_arm "build-aarch64/tests/$1_test" --gtest_brief=1 --gtest_filter="-$(IFS=:; echo "${*:2}")"
}
tests_of scheduler '*Runtime*' '*Live*' 'Localization.*' 'Activities.*' 'TraceThread.*'
# qemu follows no process and knows no limit of threads.
tests_of characterize '*Survival*' 'Process.*' 'Worker.*' 'Job.*' 'TuneOpenCl.*' 'DuetRun*' 'Doctor*' 'Rounds*' 'HostLoad*' 'Campaign*' \
  'ForeignTime*' 'IntervalOverProcesses*' '*Database*' 'Measure*' 'Scratch*' 'Jitter*' 'DuetLanes*' '*CannotStart'

# both AS ARGUMENT...: what pirt says on stdout, through filter AS, is the same. Either has to succeed.
both() {
  "$program" "${@:2}" | "$1" >build-aarch64/said
  on_arm build-aarch64/pirt "${@:2}" | "$1" >build-aarch64/arm-said
  diff build-aarch64/said build-aarch64/arm-said || { echo "aarch64.sh: pirt ${*:2} differs" >&2; return 1; }
}
same() { both cat "$@"; }
# same_file NAME ARGUMENT...: what pirt writes into the file that follows.
same_file() {
  rm -f "build-aarch64/$1" "build-aarch64/arm-$1"
  "$program" "${@:2}" "build-aarch64/$1" >/dev/null
  on_arm build-aarch64/pirt "${@:2}" "build-aarch64/arm-$1" >/dev/null
  cmp "build-aarch64/$1" "build-aarch64/arm-$1" || { echo "aarch64.sh: what pirt ${*:2} writes differs" >&2; return 1; }
}
say "pirt under qemu"
on_arm build-aarch64/pirt --version
for each in platforms mixes modes workloads; do same list "$each"; done
same schedule --platform snapdragon820 --mix convolution-1000 --compare
section5=(--platform snapdragon820-section5 --mix section5 --quiet)
for mode in latency throughput advanced cpu-only edf budget heft; do same schedule "${section5[@]}" --mode "$mode" --json -; done
same_file trace.json schedule "${section5[@]}" --mode budget --faults seed=7 --trace
on_arm build-aarch64/pirt replay build-aarch64/trace.json
same_file sequence.bag generate --format bag --seed 7 --duration 4s --width 320 --height 240 --rate 10 --quiet
# Eigen fuses products on ARM by itself, so that what is estimated differs, from the 13th digit on.
micrometres() { sed -E 's/(\.[0-9]{6})[0-9]*/\1/g'; }
both micrometres run-robot build-aarch64/sequence.bag --serial --fast --localize-only --quiet --trajectory -
say "aarch64: OK"
