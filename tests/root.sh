# Fresh root folders of Debian's releases, for stages that show what somebody has who has nothing. Sourced; needs root, else exit code 77.
#
# The caller sets `root`, the folder.
if [[ $EUID -ne 0 ]]; then
  echo "$0: skipped: only root can enter another root folder" >&2
  exit 77
fi

leave_root() { for each in data dev/shm proc sys; do if mountpoint -q "$root/$each"; then umount "$root/$each"; fi; done; }
trap leave_root EXIT

# make_root RELEASE: with its package lists; one that was interrupted has no file `made`.
make_root() {
  say "a fresh root: $1"
  leave_root
  rm -rf "$root"
  mkdir -p "$(dirname "$root")"
  debootstrap --variant=minbase "$1" "$root" http://deb.debian.org/debian >"$root.log" || { tail -n 20 "$root.log" >&2; exit 4; }
  cat >"$root/etc/apt/sources.list" <<LINES
deb http://deb.debian.org/debian $1 main
deb http://deb.debian.org/debian $1-updates main
deb http://deb.debian.org/debian-security $1-security main
LINES
  mkdir "$root/tmp/home"
  enter_root
  in_root 'apt-get update -qq; touch /made'
}

# enter_root: makes what programs expect there, until the caller ends.
enter_root() {
  mountpoint -q "$root/proc" || mount -t proc proc "$root/proc"
  mountpoint -q "$root/sys" || mount -t sysfs -o ro sysfs "$root/sys"  # drivers of OpenCL count cores there
  mountpoint -q "$root/dev/shm" || { mkdir -p "$root/dev/shm" && mount -t tmpfs tmpfs "$root/dev/shm"; }
}

in_root() { chroot "$root" env -i PATH="$PATH" HOME=/tmp/home LANG=C.UTF-8 DEBIAN_FRONTEND=noninteractive "${variables[@]}" bash -euo pipefail -c "$1"; }
variables=()  # of the environment there: NAME=VALUE
install_there() { in_root "apt-get install -y -qq --no-install-recommends $1" >"$root.log" 2>&1 || { tail -n 20 "$root.log" >&2; return 1; }; }
