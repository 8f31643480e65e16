#!/usr/bin/env bash
# Set-up and every test: installs what is needed, builds, runs. Can be run again at any time.
#
# Usage: tests/run.sh [--long]    --long adds the long tests, the sanitizer build (with assertions) and its tests,
#                             the clang build, format check and clang-tidy
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

# run_tests FOLDER: every test of a build, two at a time (nothing asserts wall time).
run_tests() {
  say "tests: $1"
  ctest --test-dir "$1" --output-on-failure -j 2 --no-tests=error
}

install_packages "${PIRT_PACKAGES[@]}" "${PIRT_TEST_PACKAGES[@]}"
build_pirt build -DPIRT_TESTS=ON "${werror[@]}"
run_tests build

if $long; then
  install_packages "${PIRT_LONG_PACKAGES[@]}"
  say "long tests"
  ctest --test-dir build --output-on-failure -C long -L long --no-tests=error
  say "format"
  git ls-files '*.cpp' '*.h' | xargs clang-format-14 --dry-run --Werror
  say "clang 14, warnings as errors"
  build_pirt build-clang -DCMAKE_CXX_COMPILER=clang++-14 -DPIRT_WERROR=ON
  say "clang-tidy"
  git ls-files '*.cpp' ':!tests' | xargs -P 2 -n 4 clang-tidy-14 --quiet -p build-clang
  cmake --preset asan -DPIRT_WERROR=ON >/dev/null && cmake --build --preset asan
  LSAN_OPTIONS=suppressions=$PWD/tests/support/lsan.txt:print_suppressions=0 run_tests build-asan
fi
say "tests: OK"
