#!/usr/bin/env bash
# The packages of Debian as somebody has them: built, looked at by lintian, installed in a fresh root where nothing else is, used there, and
# removed without a trace.
#
# Usage: tests/packages.sh     on Debian as root, since it makes a root folder (build-package/root) of this release and enters it; else it is
#                              skipped (exit code 77)
set -euo pipefail
cd "$(dirname "${BASH_SOURCE[0]}")/.."
source cli/packages.sh
root=build-package/root
source tests/root.sh
release=$(debian_release)  # what is linked here is installed there

say "build: build-package"
rm -f build-package/*.deb
cmake --preset package >/dev/null
cmake --build --preset package
for each in build-package/libpirt1_*.deb; do
  dpkg-deb -f "$each" Depends | grep libopencv || { echo "packages.sh: $each does not say what it is linked with" >&2; exit 1; }
done
say "a copied build has its own library"
copy=$(mktemp -d)
cp build-package/pirt build-package/libpirt.so.1 "$copy"
ldd "$copy/pirt" | grep -F "$copy/libpirt.so.1" || { echo "packages.sh: a copy runs with the library of the original" >&2; exit 1; }
rm -r "$copy"
say "lintian"
lintian --allow-root --fail-on error build-package/*.deb

make_root "$release"
mkdir "$root/tmp/debs"
cp build-package/*.deb "$root/tmp/debs"
cp -r tests/examples "$root/tmp/examples"

say "the program, without what is recommended"
install_there '/tmp/debs/pirt_*.deb /tmp/debs/libpirt1_*.deb'
in_root 'pirt --version
  pirt schedule --platform snapdragon820 --mix convolution-1000 --compare
  ldd /usr/bin/pirt >/tmp/libraries
  grep libpirt.so.1 /tmp/libraries
  rm /tmp/libraries
  for each in g++ gcc clang cmake; do if command -v "$each"; then echo "packages.sh: pirt brings $each" >&2; exit 1; fi; done'

say "a run is gone on with by the library that began it"
in_root 'pirt characterize --quick --platform fake --filter "^fc8$" --max-time 1ns --db /tmp/p.db >/tmp/said 2>&1 || true
  library=$(realpath /usr/lib/*/libpirt.so.1)
  echo >>"$library"
  code=0
  pirt characterize --resume --max-time 1min --db /tmp/p.db >/tmp/said 2>&1 || code=$?
  truncate -s -1 "$library"
  if [[ $code -ne 2 ]] || ! grep -q "another program" /tmp/said; then echo "packages.sh: another library goes on: $code, $(cat /tmp/said)" >&2; exit 1; fi
  rm /tmp/p.db /tmp/said'

say "its manual, and completion"
install_there 'man-db bash-completion'
in_root 'man pirt >/tmp/page
  grep -q "^NAME" /tmp/page
  man pirt-schedule >/tmp/page
  grep -q -e --compare /tmp/page
  rm /tmp/page'
in_root 'set +euo pipefail; . /usr/share/bash-completion/bash_completion; _completion_loader pirt
  COMP_WORDS=(pirt sche) COMP_CWORD=1 COMP_LINE="pirt sche" COMP_POINT=9; compopt() { :; }; _pirt
  if [[ ${COMPREPLY[*]} != schedule* ]]; then echo "packages.sh: bash completes with: ${COMPREPLY[*]}" >&2; exit 1; fi'

say "the examples, by CMake and by pkg-config"
install_there '/tmp/debs/*.deb g++ cmake make'
in_root 'cd /tmp/examples
  for each in . schedule; do cmake -S "$each" -B "$each/build" -DCMAKE_BUILD_TYPE=Release >/dev/null; cmake --build "$each/build"; done
  build/robot 5 host-cpu
  code=0
  build/robot 5 2>said || code=$?
  if [[ $code -ne 4 ]] || ! grep -q pocl-opencl-icd said; then echo "packages.sh: without a driver: $code, $(cat said)" >&2; exit 1; fi'
install_there pocl-opencl-icd
in_root 'cd /tmp/examples
  build/robot 5
  schedule/build/schedule
  ldd build/robot >libraries
  grep libpirt.so.1 libraries
  g++ -O2 robot.cpp -o robot $(pkg-config --cflags --libs pirt-runtime)
  ./robot 5
  g++ -O2 schedule/schedule.cpp -o once $(pkg-config --cflags --libs pirt-scheduler)
  ./once
  if ldd once | grep -E "opencv|dnnl|OpenCL|libpirt.so"; then echo "packages.sh: pirt-scheduler brings what computes" >&2; exit 1; fi
  if ldd /usr/lib/*/pirt/*.so | grep "not found"; then exit 1; fi'

say "removed"
in_root 'names="pirt libpirt1 libpirt-dev pirt-pictures"
  rm -r /tmp/debs /tmp/examples /tmp/home
  dpkg -L $names | sort -u >/tmp/files
  apt-get purge -y -qq $names >/dev/null
  while read -r file; do
    if [[ -e $file ]] && ! dpkg -S "$file" >/dev/null 2>&1; then echo "$file"; fi
  done </tmp/files >/tmp/left
  find / -xdev -iname "*pirt*" -not -path "/var/cache/man/*" >>/tmp/left
  if [[ -s /tmp/left ]]; then echo "packages.sh: left behind:" >&2; cat /tmp/left >&2; exit 1; fi'
leave_root
rm -rf "$root"
say "packages: OK"
