#!/usr/bin/env bash
# pirt on Debian 13, in a root folder of its own (build-trixie/root, which is kept): what its compilers and libraries make of it.
#
# Usage: tests/trixie.sh build     the program, by g++ 14 and by clang 19, without a warning
#        tests/trixie.sh tests     tests/run.sh, as on a bare machine
set -euo pipefail
cd "$(dirname "${BASH_SOURCE[0]}")/.."
source cli/packages.sh
root=build-trixie/root
source tests/root.sh
[[ ${1:-} == build || ${1:-} == tests ]] || { sed -n '4,5s/^# //p' "$0" >&2; exit 2; }

if [[ ! -f $root/made ]]; then make_root trixie; fi
enter_root
# The sources as they are; what was built there stays.
mkdir -p "$root/pirt"
find "$root/pirt" -mindepth 1 -maxdepth 1 ! -name 'build*' -exec rm -rf {} +
git ls-files -z --cached --others --exclude-standard | while IFS= read -rd '' file; do if [[ -f $file ]]; then printf '%s\0' "$file"; fi; done |
  tar --null -T - -c | tar -x -C "$root/pirt"
if [[ -d ${PIRT_DATA:-../shared/data} ]]; then
  mkdir -p "$root/data"
  mountpoint -q "$root/data" || mount --bind -o ro "${PIRT_DATA:-../shared/data}" "$root/data"
  variables+=(PIRT_DATA=/data)
fi

if [[ $1 == tests ]]; then
  in_root 'cd /pirt; CI=true tests/run.sh'
else
  # shellcheck disable=SC2016
  in_root 'cd /pirt; source cli/packages.sh
    install_packages "${PIRT_PACKAGES[@]}" "${PIRT_DSP_PACKAGES[@]}" "${PIRT_NATS_PACKAGES[@]}" "${PIRT_BAG_PACKAGES[@]}" ccache
    for compiler in g++ clang++; do
      build_pirt "build-$compiler" -DCMAKE_CXX_COMPILER="$compiler" -DPIRT_TESTS=OFF -DPIRT_UNITY=ON -DPIRT_WERROR=ON -DPIRT_PRECOMPILE=OFF
      "build-$compiler/pirt" --version
      "build-$compiler/pirt" schedule --platform snapdragon820 --mix convolution-1000 --compare >/dev/null
    done'
fi
say "trixie, $1: OK"
