# What pirt needs on Debian 12 and 13, and how to get it. Sourced by cli/demo.sh and tests/run.sh; one list for both.
#
# Run packages come first, then what only building or testing needs.
PIRT_PACKAGES=(
  g++ cmake ninja-build pkg-config git ca-certificates sqlite3
  libopencv-dev libdnnl-dev
  ocl-icd-opencl-dev opencl-headers opencl-clhpp-headers pocl-opencl-icd
  libsqlite3-dev zlib1g-dev libjpeg-dev libyaml-cpp-dev libre2-dev nlohmann-json3-dev libcli11-dev libfmt-dev
  coinor-libclp-dev libceres-dev
  node-d3
)
PIRT_TEST_PACKAGES=(ccache make libgtest-dev libgmock-dev libbenchmark-dev chromium chromium-driver bash-completion mandoc yamllint python3-jsonschema python3-onnx)
# Backend dsp: its program's compiler and linker, and the emulator; without them it says so, and its tests are skipped.
PIRT_DSP_PACKAGES=(clang lld qemu-user)
# Backend nats, the cloud: its libraries, and the server that tests start; likewise.
PIRT_NATS_PACKAGES=(libnats-dev libssl-dev nats-server)
# Recordings of ROS that are compressed; without them such a one is refused by name.
PIRT_BAG_PACKAGES=(libbz2-dev liblz4-dev libzstd-dev)
PIRT_FPGA_PACKAGES=(verilator)  # backend fpga, in the same way
PIRT_PACKAGING=(dpkg-dev file)  # preset package

say() { printf '== %s\n' "$*"; }

# debian_release [ROOT]: what the release of Debian is called that this is, e.g. bookworm; on another system 77, a stage that is skipped.
debian_release() {
  local ID="" VERSION_CODENAME=""
  # shellcheck source=/dev/null
  source "${1:-}/etc/os-release"
  if [[ $ID != debian ]]; then
    echo "skipped: this is not Debian" >&2
    return 77
  fi
  printf '%s\n' "$VERSION_CODENAME"
}

# install_packages NAME...: installs those that are missing; says so if it cannot.
install_packages() {
  local missing=() package machine
  machine=$(dpkg --print-architecture 2>/dev/null) || true
  for package in "$@"; do  # which may be there for another architecture as well
    if ! grep -qxE "(all|$machine) installed" <<<"$(dpkg-query -W -f='${Architecture} ${db:Status-Status}\n' "$package" 2>/dev/null)"; then
      missing+=("$package")
    fi
  done
  if [[ ${#missing[@]} -eq 0 ]]; then
    say "packages: all $# installed"
    return
  fi
  say "packages: installing ${missing[*]}"
  local as_root=()
  if [[ $EUID -ne 0 ]]; then
    if ! command -v sudo >/dev/null; then
      echo "Please install as root: apt-get install ${missing[*]}" >&2
      return 4
    fi
    as_root=(sudo)
  fi
  "${as_root[@]}" apt-get update -qq
  "${as_root[@]}" env DEBIAN_FRONTEND=noninteractive \
    apt-get install -y -qq --no-install-recommends -o DPkg::Lock::Timeout=300 "${missing[@]}" >/dev/null
}

# free_memory [ROOT]: the kB that the machine has available, or the least that one of the process's control groups leaves, or one that these
# are in (a container's); files that are kept in memory and can be read again do not count. ROOT: of which root folder, for tests.
free_memory() {
  local root=${1:-} least left controllers path at folder limit used
  least=$(awk '/^MemAvailable:/ { print $2 }' "$root/proc/meminfo")
  while IFS=: read -r _ controllers path; do
    case $controllers in
      '') folder=/sys/fs/cgroup limit=memory.max used=memory.current ;;
      *memory*) folder=/sys/fs/cgroup/memory limit=memory.limit_in_bytes used=memory.usage_in_bytes ;;
      *) continue ;;
    esac
    path=${path%/}/
    while [[ $path == */* ]]; do
      path=${path%/*}
      at=$root$folder$path
      if [[ ! -r $at/$limit || ! -r $at/$used || $(<"$at/$limit") == max ]]; then continue; fi
      left=$(cat "$at/$limit" "$at/$used" "$at/memory.stat" 2>/dev/null |
        awk 'NR == 1 { left = $1 } NR == 2 { left -= $1 } /^(total_)?inactive_file / { kept = $2 } END { printf "%d", (left + kept) / 1024 }') || true
      if ((left < least)); then least=$left; fi
    done
  done < <(cat "$root/proc/self/cgroup" 2>/dev/null)
  printf '%s\n' "$least"
}

# compile_jobs: how many sources are compiled at a time: as many as there are cores, and as memory has room for, since the largest take 1.2 GB.
compile_jobs() {
  local fit cores
  fit=$(($(free_memory) / 1250000))
  cores=$(nproc)
  printf '%s\n' $((fit < 1 ? 1 : fit < cores ? fit : cores))
}

# build_pirt FOLDER [CMAKE_ARGUMENT...]: configures and builds all, or the targets that PIRT_TARGET names.
build_pirt() {
  local folder=$1
  shift
  say "build: $folder"
  cmake -S . -B "$folder" -G Ninja "$@" >/dev/null
  # shellcheck disable=SC2086
  cmake --build "$folder" -j "$(compile_jobs)" ${PIRT_TARGET:+--target $PIRT_TARGET}
}
