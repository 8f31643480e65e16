# The stages of tests/run.sh, in the order in which --long runs them; sourced. A stage is a line:
#   stage NAME READS INSTALLS SHOWS COMMAND...
# READS: the paths (pathspecs of git) that it compiles and reads; it is run again when one of them has changed. INSTALLS: packages.
# COMMAND: words, or a function below; exit code 77 = skipped, for what it has said. None takes longer than 20 minutes on two quiet cores.

base="${PIRT_PACKAGES[*]} ${PIRT_TEST_PACKAGES[*]} ${PIRT_DSP_PACKAGES[*]} ${PIRT_NATS_PACKAGES[*]} ${PIRT_BAG_PACKAGES[*]} ${PIRT_FPGA_PACKAGES[*]}"
all='. :!tests/run.sh :!tests/stages.sh :!cli/demo.sh :!tests/bench/README.md'
# What the tests of a folder compile: it, and those that it may include.
common='CMakeLists.txt CMakePresets.json README.md tests/CMakeLists.txt tests/*.cmake tests/support tests/examples/module'
declare -A code
code[workloads]="$common workloads tests/workloads"
code[characterize]="${code[workloads]} characterize tests/characterize"
code[scheduler]="${code[characterize]} scheduler tests/scheduler"
code[reports]="${code[scheduler]} reports tests/reports"
code[cli]=$all
layers=(workloads characterize scheduler reports cli)

stage tests "$all" "$base" "every test, built with g++" usual_tests
stage format "*.cpp *.h .clang-format" "git clang-format-14" "format of the sources" check_format
stage yaml ".yamllint cli/ci *.yaml" "yamllint" "workflows and shipped YAML, linted" yamllint --strict -c .yamllint cli/ci characterize/platform/platforms scheduler/mix/mixes
stage page-script "reports/document/*.js reports/document/.eslintrc.json" "eslint" "the page's script, linted" check_page_script
stage clang "$all" "$base clang-14" "clang 14 builds all of it without a warning" build_clang
stage headers "$all" "$base clang-14" "each header compiles alone" check_headers
for layer in "${layers[@]}"; do
  stage "tidy-$layer" "${code[$layer]} .clang-tidy" "$base clang-14 clang-tidy-14" "clang-tidy of $layer/" tidy "$layer"
done
stage kills "$all" "$base" "500 kills of pirt characterize, by seed range" long_test kills
stage database "${code[characterize]}" "$base" "500 kills of a writer of a database, 10,000 flipped bits, cuts, by seed range" long_test database
stage slam "${code[workloads]}" "$base" "localization and maps on sequences of a minute, by seed" long_test '(slam|keyframes)'
stage cloud "${code[workloads]}" "$base" "robots, workers and a server: 200 faults over loopback, 100,000 in virtual time, a hostile robot" long_test cloud
stage live-simulation "${code[scheduler]}" "$base patch" "100,000 live runs on threads that a seed hands on; faults that there were are found again" live_simulation
stage oclgrind "${code[workloads]} tests/oclgrind.sh" "$base oclgrind" "each OpenCL kernel on a simulated device: races, values nobody wrote" long_test oclgrind
stage rusticl "${code[workloads]}" "$base mesa-opencl-icd" "every workload's OpenCL kernels on Mesa's driver" long_test rusticl
stage recordings "$all" "$base python3-numpy python3-opencv" "recordings, maps and models as others make them: ../shared/cases/recordings" check_recordings
stage mcap "$all" "$base" "npm's readers of MCAP and Foxglove's schemas on what run-robot --record writes" check_mcap
stage subdirectory "$all" "$base" "pirt as a part of another project" long_test subdirectory
stage systems "$all" "$base jq sqlite3 locales" "launchers, containers, boards: cases that lie beside the project" check_systems
stage packages "$all" "$base ${PIRT_PACKAGING[*]} debootstrap lintian" "packages of Debian, installed, used and removed in a fresh root" check_packages
stage unity-build "$all" "${PIRT_PACKAGES[*]}" "what cli/demo.sh builds, whose sources are joined, without a warning" build_united
stage unity-tests "$all" "$base" "the tests of a build whose sources are joined, as who builds once has it" unity
stage trixie-build "$all" "git debootstrap" "Debian 13 builds it, with g++ 14 and clang 19, without a warning" on_trixie build
stage trixie-tests "$all" "git debootstrap" "every test on Debian 13" on_trixie tests
stage noisy "$all" "$base" "the demo's steps beside two busy loops a core: four modes and an answer" beside_loops noisy
for round in 1 2 3; do
  stage "loaded-$round" "$all" "$base" "every test beside two busy loops a core, round $round of 3" beside_loops suite
done
stage loaded-threads "$all" "$base" "50 times beside two busy loops a core: tests that start threads or processes" beside_loops threads
stage aarch64 "$all" "$base g++-aarch64-linux-gnu qemu-user mmdebstrap" "built for ARM's processors, run under qemu" check_aarch64
for layer in "${layers[@]}"; do
  stage "asan-$layer" "${code[$layer]}" "$base" "tests of $layer/ under address and undefined-behaviour sanitizers" asan "$layer"
done
stage tsan "${code[scheduler]}" "$base" "live runs and the runtime under the thread sanitizer" tsan

# In CI warnings are errors; not by an option, which would be another build to a compiler cache: it says them again.
usual_tests() {
  build_pirt build -DPIRT_TESTS=ON 2>&1 | tee "$stamps/build.log"
  if [[ ${CI:-} == true ]] && grep -A 5 -F 'warning:' "$stamps/build.log"; then
    echo "tests: the build has warnings, above" >&2
    return 1
  fi
  run_tests build
}

check_format() { git ls-files '*.cpp' '*.h' | xargs clang-format-14 --dry-run --Werror; }

check_page_script() { NODE_PATH=/usr/share/nodejs eslint --format unix reports/document/charts.js; }

build_clang() { build_pirt build-clang -DCMAKE_CXX_COMPILER=clang++-14 -DPIRT_TESTS=ON -DPIRT_WERROR=ON -DPIRT_PRECOMPILE=OFF; }

check_headers() { PIRT_TARGET=all_verify_interface_header_sets build_clang; }

# tidy FOLDER: on each of its sources that has not passed since it changed, or a header that it includes, or the checks. What it includes
# is what the build with clang has found.
tidy() {
  build_clang
  local passed=build-clang/tidy source key left=() keys=()
  mkdir -p "$passed"
  while read -r source key; do
    if [[ ! -f $passed/$key ]]; then left+=("$source $passed/$key"); fi
  done < <(tidy_keys "$1")
  say "clang-tidy: ${#left[@]} sources of $1/ to check"
  [[ ${#left[@]} -eq 0 ]] || printf '%s\n' "${left[@]}" | xargs -P "$(nproc)" -L 1 bash -c 'clang-tidy-14 --quiet -p build-clang "$1" && touch "$2"' tidy
}

# tidy_keys FOLDER: SOURCE and a hash of it with all that it includes, a line each.
tidy_keys() {
  local source parts checks
  checks=$(cat .clang-tidy <(clang-tidy-14 --version) | sha256sum)
  { git ls-files -z; find build-clang/generated -type f -print0; } | xargs -0 sha256sum >build-clang/tidy/files
  ninja -C build-clang -t deps | awk -v root="$PWD/" -v folder="$1/" '
    function in_tree(path) {
      if (index(path, root) == 1) path = substr(path, length(root) + 1)
      sub(/^\.\.\//, "", path)
      return (path in hash) ? path : "build-clang/" path
    }
    function done() { if (source != "") print source, parts; source = parts = "" }
    NR == FNR { hash[$2] = $1; next }
    /^[^ ]/ { done(); next }
    NF { path = in_tree($1); parts = parts hash[path]; if (index(path, folder) == 1 && path ~ /\.cpp$/) source = path }
    END { done() }' build-clang/tidy/files - | sort -u |
    while read -r source parts; do printf '%s %s\n' "$source" "$(sha256sum <<<"$checks$source$parts" | cut -c -64)"; done
}

long_test() {
  build_pirt build -DPIRT_TESTS=ON
  run_left build -C long -R "^long\.$1"
}

live_simulation() {
  long_test simulation
  tests/scheduler/simulation/faults.sh build/faults
}

check_recordings() {
  local cases=../shared/cases/recordings out
  if [[ ! -f $cases/check.py ]]; then
    echo "skipped: no data"
    return 77
  fi
  build_pirt build -DPIRT_TESTS=ON
  out=$(mktemp -d)
  export PIRT=$PWD/build/pirt
  local code=0
  { /usr/bin/python3 "$cases/make.py" "$out" >/dev/null && /usr/bin/python3 "$cases/check.py" "$out"; } || code=$?
  rm -rf "$out"
  return $code
}

check_mcap() {
  local modules=build/npm flight frames at code=0
  if ! command -v node >/dev/null || ! command -v npm >/dev/null; then
    echo "skipped: no node and npm"
    return 77
  fi
  if ! npm install --silent --no-save --ignore-scripts --prefix "$modules" @mcap/core@2.2.2 @mcap/support@1.1.0 @foxglove/schemas@2.1.0 ajv@8.20.0; then
    echo "skipped: npm's registry is not reached"
    return 77
  fi
  build_pirt build -DPIRT_TESTS=ON
  at=$(mktemp -d)
  flight=$at/flight
  build/pirt generate --seed 7 --duration 6s "$flight" &&
    build/pirt run-robot "$flight" --fast --record "$at/run.mcap" --json "$at/run.json" >/dev/null &&
    frames=$(sed -n 's/^ *"frames": \([0-9]*\),$/\1/p' "$at/run.json") &&
    node tests/mcap.mjs "$modules" "$at/run.mcap" compression=zstd "/latency=$frames" /trajectory=1 /path=some &&
    build/pirt generate --seed 7 --duration 2s --format mcap "$at/flight.mcap" &&
    node tests/mcap.mjs "$modules" "$at/flight.mcap" compression=none /cam0/image_raw=50 /tf_static=1 || code=$?
  rm -rf "$at"
  return $code
}

check_systems() {
  PIRT_TARGET=pirt build_pirt build
  tests/systems.sh build/pirt || exit $?
}

check_packages() { tests/packages.sh || exit $?; }

on_trixie() { tests/trixie.sh "$1" || exit $?; }

# beside_loops WHAT: beside two busy loops a core, what rests on time has to be a condition.
beside_loops() {
  build_pirt build -DPIRT_TESTS=ON
  if [[ $1 == noisy ]]; then
    tests/noisy.sh build/pirt
    return
  fi
  local i
  loops=()
  trap 'kill "${loops[@]}" 2>/dev/null' EXIT  # of the stage's own shell, however it ends
  for ((i = 0; i < 2 * $(nproc); ++i)); do
    (while :; do :; done) &
    loops+=($!)
  done
  if [[ $1 == suite ]]; then
    run_tests build --timeout 1500
  else
    run_tests build --timeout 1500 --repeat until-fail:50 -R '^(scheduler\.(Runtime|Live|Leave|Handover|Engine|Spin)|cli\.(Cloud|Live|Worker))'
  fi
}

# Hardly optimized: what the optimizer sees, the tests' build shows.
build_united() { build_pirt build-united -DPIRT_TESTS=OFF -DPIRT_UNITY=ON -DPIRT_WERROR=ON -DCMAKE_CXX_FLAGS_RELEASE="-O0 -DNDEBUG"; }

unity() {
  build_pirt build-unity -DPIRT_TESTS=ON -DPIRT_UNITY=ON
  run_tests build-unity
}

check_aarch64() {
  PIRT_TARGET=pirt build_pirt build
  tests/aarch64.sh build/pirt || exit $?
}

# asan LAYER. LLVM within PoCL sets signal stacks of its own, which the sanitizer would free as its own; and the leak checker dies of PoCL's
# threads that are about to end, so that tests with a driver go without it. Sequences of 10 s take more than 5 minutes there;
# SlamQuality.SameInputsGiveTheSameBits goes the same ways.
asan() {
  local driver='(Open[Cc]l|Batch|Tun|Peak)' too_long='SlamQuality\.(Stereo|Mono|OneCameraAloneF|ASecond)' leaks="^$1\\." program=$1_test
  local driven="^$1\\..*$driver"
  if [[ $1 == cli ]]; then leaks='^examples\.' driven='^cli\.' program=all; fi
  export ASAN_OPTIONS=use_sigaltstack=0 LSAN_OPTIONS=suppressions=$PWD/tests/support/lsan.txt:print_suppressions=0
  cmake --preset asan -DPIRT_WERROR=ON >/dev/null
  cmake --build --preset asan --target "$program"
  run_tests build-asan -R "$leaks" -E "$driver|$too_long"
  ASAN_OPTIONS=$ASAN_OPTIONS:detect_leaks=0 run_tests build-asan -R "$driven" --no-tests=ignore
}

tsan() {
  cmake --preset tsan -DPIRT_WERROR=ON >/dev/null
  cmake --build --preset tsan --target scheduler_test
  TSAN_OPTIONS=suppressions=$PWD/tests/support/tsan.txt run_tests build-tsan -R '^scheduler\.(Runtime|Live|TraceThread|Localization|Activities|ReadAhead)'
}
