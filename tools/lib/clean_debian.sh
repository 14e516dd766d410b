# Sourced after setup.sh and foreign_apt.sh: a package in a Debian that has nothing else; the program built by another release.
# shellcheck shell=bash disable=SC2154,SC2016

# run_foreign_programs ARCHITECTURE: lets this machine's kernel start its programs.
run_foreign_programs() {
  local emulator=qemu-arm
  [ "$1" != arm64 ] || emulator=qemu-aarch64
  [ ! -e "/proc/sys/fs/binfmt_misc/$emulator" ] || return 0
  [ -e /proc/sys/fs/binfmt_misc/status ] || as_root mount -t binfmt_misc binfmt_misc /proc/sys/fs/binfmt_misc >&2 || true
  as_root update-binfmts --enable "$emulator" >&2 || true
  [ -e "/proc/sys/fs/binfmt_misc/$emulator" ] ||
    die "this machine's kernel does not run $1 programs: no /proc/sys/fs/binfmt_misc/$emulator"
}

# check_in_clean_debian SUITE ARCHITECTURE PACKAGE: it installs with what it depends on and nothing else, loads i2c-dev at
# every start, runs a second, and leaves nothing of its own behind when purged.
check_in_clean_debian() {
  local mirror file
  mirror=$(machine_mirror)
  file=$(basename "$3")
  [ "$2" = "$(dpkg --print-architecture)" ] || run_foreign_programs "$2"
  say "Installing $file in a clean $1 $2"
  as_root mmdebstrap --mode=root --quiet --variant=minbase --architectures="$2" \
    --customize-hook="cp '$3' \"\$1/tmp/\"" \
    --customize-hook="chroot \"\$1\" apt-get install -y --no-install-recommends /tmp/$file" \
    --customize-hook='grep -qx i2c-dev "$1/usr/lib/modules-load.d/equipoise.conf"' \
    --customize-hook='chroot "$1" equipoise sim --config /etc/equipoise/mbbr.toml --duration-s 1 --telemetry off --log /tmp/run.lcm' \
    --customize-hook='chroot "$1" equipoise doctor --board /etc/equipoise/boards/robotics_cape_mbbr.toml' \
    --customize-hook='chroot "$1" apt-get purge -y equipoise' \
    --customize-hook='! find "$1/etc" "$1/usr" "$1/lib/systemd" "$1/lib/udev" -path "*equipoise*" | grep .' \
    "$1" /dev/null "deb [signed-by=/usr/share/keyrings/debian-archive-keyring.gpg] $mirror $1 main" >&2 ||
    die "$file does not hold in a clean $1 $2 (see above)"
}

# build_in_debian SUITE DIRECTORY: the program, by the compiler and with the libraries of a release that need not be this
# machine's, in a Debian made once in DIRECTORY/system; then DIRECTORY/equipoise.
build_in_debian() {
  local suite=$1 system=$2/system mirror packages wanted
  mirror=$(machine_mirror)
  [ -n "$mirror" ] || die "no Debian mirror among this machine's apt sources (apt-get update first?)"
  packages=$(packages_of host | paste -sd,)
  wanted="$suite $packages"
  if [ "$(cat "$system/equipoise.stamp" 2>/dev/null)" != "$wanted" ]; then
    say "Installing Debian $suite into build/${system#"$root/build/"}"
    as_root rm -rf "$system"
    mkdir -p "$2"
    as_root mmdebstrap --mode=root --quiet --variant=minbase --include="$packages" "$suite" "$system" \
      "deb [signed-by=/usr/share/keyrings/debian-archive-keyring.gpg] $mirror $suite main" >&2 ||
      die "could not make a Debian $suite (see above)"
    as_root tee "$system/equipoise.stamp" <<<"$wanted" >/dev/null
  fi
  as_root mkdir -p "$system/src"
  as_root find "$system/src" -mindepth 1 -maxdepth 1 ! -name build -exec rm -rf {} +
  tar -C "$root" --exclude=./build --exclude=./logs --exclude=./.git -c . | as_root tar -C "$system/src" -x --no-same-owner
  say "Building in Debian $suite"
  as_root chroot "$system" env CCACHE_DISABLE=1 sh -c 'cd /src && cmake --preset host -D BUILD_TESTING=OFF &&
    cmake --build build/host -j "$1" --target equipoise' sh "$jobs" >&2 || die "the build in Debian $suite failed (see above)"
  cp "$system/src/build/host/equipoise" "$2/equipoise"
}

# depends_in_debian DIRECTORY CONTROL: what dpkg-shlibdeps says of that program in that Debian.
depends_in_debian() {
  as_root install -D -m 644 "$2" "$1/system/src/build/debian/control"
  as_root chroot "$1/system" sh -c 'cd /src/build && dpkg-shlibdeps -O -e/src/build/host/equipoise'
}
