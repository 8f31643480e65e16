#!/usr/bin/env bash
# Set-up and every test: installs what is needed, builds, runs. Can be run again at any time.
#
# Usage: tests/run.sh [--long]    --long adds the long tests, the sanitizer build (with assertions) and its tests,
#                             the clang build, format check, clang-tidy, and the thread sanitizer on what runs live
set -euo pipefail
cd "$(dirname "${BASH_SOURCE[0]}")/.."
source cli/packages.sh
trap 'echo "tests: FAILED (line $LINENO)" >&2' ERR

long=false
for argument in "$@"; do
  case $argument in
    --long) long=true ;;
    *) echo "usage: tests/run.sh [--long]" >&2; exit 2 ;;
  esac
done

werror=()
if [[ ${CI:-} == true ]]; then werror=(-DPIRT_WERROR=ON); fi

# run_tests FOLDER [OPTION...]: every test of a build, two at a time (nothing asserts wall time).
run_tests() {
  say "tests: $*"
  ctest --test-dir "$1" --output-on-failure -j 2 --no-tests=error "${@:2}"
}

# run_shards PROGRAM [OPTION...]: the tests of one program, in two processes.
run_shards() {
  printf '0\n1\n' | xargs -P 2 -I{} env GTEST_TOTAL_SHARDS=2 GTEST_SHARD_INDEX={} "$@" --gtest_brief=1
}

install_packages "${PIRT_PACKAGES[@]}" "${PIRT_TEST_PACKAGES[@]}" "${PIRT_DSP_PACKAGES[@]}"
build_pirt build -DPIRT_TESTS=ON "${werror[@]}"
run_tests build
if [[ ${CI:-} == true ]]; then
  say "the scheduler's tests, with assertions"
  cmake --preset debug >/dev/null
  cmake --build --preset debug --target scheduler_test
  run_shards build-debug/tests/scheduler_test
fi

if $long; then
  install_packages "${PIRT_LONG_PACKAGES[@]}"
  say "long tests"
  ctest --test-dir build --output-on-failure -j 2 -C long -L long --no-tests=error
  say "format"
  git ls-files '*.cpp' '*.h' | xargs clang-format-14 --dry-run --Werror
  say "the page's script"
  NODE_PATH=/usr/share/nodejs eslint --format unix reports/document/charts.js
  say "clang 14, warnings as errors"
  build_pirt build-clang -DCMAKE_CXX_COMPILER=clang++-14 -DPIRT_WERROR=ON
  say "each header alone"
  cmake --build build-clang --target all_verify_interface_header_sets
  say "clang-tidy"
  git ls-files '*.cpp' ':!tests' | xargs -P 2 -n 4 clang-tidy-14 --quiet -p build-clang
  cmake --preset asan -DPIRT_WERROR=ON >/dev/null && cmake --build --preset asan
  # LLVM within PoCL sets signal stacks of its own, which the sanitizer would free as its own; and the leak checker
  # dies of PoCL's threads that are about to end, so that tests with a driver go without it.
  with_driver='OpenCl|^cli\.|Batch|Tun|Peak'
  # Sequences of 10 s take more than 5 min there; SlamQuality.SameInputsGiveTheSameBits goes the same ways.
  too_long='SlamQuality\.(Stereo|Mono|OneCameraAloneF|ASecond)'
  LSAN_OPTIONS=suppressions=$PWD/tests/support/lsan.txt:print_suppressions=0 ASAN_OPTIONS=use_sigaltstack=0 \
    run_tests build-asan -E "$with_driver|$too_long"
  ASAN_OPTIONS=use_sigaltstack=0:detect_leaks=0 run_tests build-asan -R "$with_driver"
  say "threads: live runs and the runtime"
  cmake --preset tsan -DPIRT_WERROR=ON >/dev/null && cmake --build --preset tsan --target scheduler_test
  TSAN_OPTIONS=suppressions=$PWD/tests/support/tsan.txt \
    run_shards build-tsan/tests/scheduler_test --gtest_filter='Runtime*:Live*:TraceThread*:Localization*:Activities*'
fi
say "tests: OK"
