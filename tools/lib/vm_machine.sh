# Sourced after setup.sh and foreign_apt.sh: what the emulated machines share. Everything lands in build/vm.
# shellcheck shell=bash disable=SC2154

vm=$root/build/vm

# download_only ARCHITECTURE PACKAGE...: just these, without what they depend on, into $debs.
download_only() {
  local architecture=$1
  shift
  mkdir -p "$debs"
  foreign_apt "$architecture" bookworm --version >/dev/null # makes the private root
  (cd "$debs" && foreign_apt "$architecture" bookworm download "$@" >&2) || die "could not download: $*"
}

unpack() { # DIRECTORY DEB...
  local target=$1 file
  shift
  mkdir -p "$target"
  for file in "$@"; do dpkg-deb --fsys-tarfile "$file" | tar -x -C "$target" --no-same-owner; done
}

# package_of SUITE ARCHITECTURE METAPACKAGE: the package of a kernel's version it stands for today.
package_of() {
  local package
  foreign_apt "$2" "$1" --version >/dev/null # makes the private root
  package=$(APT_CONFIG=$root/build/apt/$1-$2/apt.conf apt-cache depends "$3" |
    awk '/Depends: linux-/ { print $2; exit }')
  [ -n "$package" ] || die "the archive has no $3"
  printf '%s\n' "$package"
}

# prepare_source [SUITE]: of a release's kernel source, in $vm/source-SUITE, what modules and the boards' device trees are
# made of. Debian moved the trees to ti/omap in between.
prepare_source() {
  local suite=${1:-bookworm} machine source package archive parts stamp
  source=$vm/source-$suite
  stamp=$source.stamp
  parts=('drivers/gpio/*.[ch]' 'kernel/irq/irq_sim.c' 'drivers/counter/*.[ch]'
    'drivers/iio/industrialio-configfs.c' 'drivers/iio/industrialio-sw-device.c' 'drivers/iio/dummy/iio_simple_dummy*'
    'drivers/iio/trigger/iio-trig-sysfs.c' 'drivers/watchdog/i6300esb.c'
    'drivers/net/can/sja1000/*.h' 'arch/arm/boot/dts/*am33*' 'arch/arm/boot/dts/*tps65217*' 'include/dt-bindings/*'
    'include/uapi/linux/input-event-codes.h')
  [ "$(cat "$stamp" 2>/dev/null)" != "${parts[*]}" ] || return 0
  machine=$(dpkg --print-architecture) # the source is the same package everywhere
  package=$(package_of "$suite" "$machine" linux-source)
  rm -rf "$source" "$source.deb"
  mkdir -p "$source.deb" "$source"
  (cd "$source.deb" && foreign_apt "$machine" "$suite" download "$package" >&2) || die "could not download $package of $suite"
  unpack "$source.deb" "$source.deb/$package"_*.deb
  archive=$source.deb/usr/src/$package.tar.xz
  tar -xJf "$archive" -C "$source" --strip-components=1 --wildcards "${parts[@]/#/*/}"
  rm -rf "$source.deb"
  printf '%s\n' "${parts[*]}" >"$stamp"
}

# board_tree SUITE BOARD OUTPUT: the tree of am335x-BOARD with symbols, which that of Debian's kernel packages lacks.
board_tree() {
  local source=$vm/source-$1 tree
  prepare_source "$1"
  tree=$(find "$source/arch/arm/boot/dts" -name "am335x-$2.dts")
  cpp -nostdinc -undef -x assembler-with-cpp -I "$source/include" -I "${tree%/*}" "$tree" "$3.dts"
  dtc -q -@ -I dts -O dtb -i "${tree%/*}" -o "$3" "$3.dts"
}

# make_modules HEADERS VERSION DIRECTORY VARIABLE=VALUE...: builds DIRECTORY's modules against Debian's unpacked headers.
make_modules() {
  local headers=$1/usr/src/linux-headers-$2 directory=$3 log=$3.log
  # The headers include each other, and the kbuild tools, by absolute path.
  find "$headers" -maxdepth 1 -name Makefile -exec sed -i "s#\([ =]\)/usr/src/#\1$1/usr/src/#g" {} +
  say "Building kernel modules for $2"
  make -C "$headers" M="$directory" "${@:4}" -j "$jobs" modules >"$log" 2>&1 || {
    tail -30 "$log" >&2
    die "the kernel modules did not build; log: $log"
  }
}

# make_initramfs TREE VERSION INIT OUTPUT MODULE...: busybox, the modules and all they need in loading order (a name
# of the kernel's tree or the path of a .ko), and the first process.
make_initramfs() {
  local tree=$1 version=$2 init=$3 output=$4 stage=$4.d module
  shift 4
  rm -rf "$stage"
  mkdir -p "$stage"/{bin,dev,mnt,modules,proc,sys,tmp}
  cp "$tree/bin/busybox" "$stage/bin/"
  for module in sh mount mkdir insmod ln sleep sync cat chroot; do ln -s busybox "$stage/bin/$module"; done
  cp "$init" "$stage/init"
  chmod +x "$stage/init"
  [ -e "$tree/lib/modules/$version/modules.dep" ] || depmod -b "$tree" "$version"
  for module in "$@"; do
    case $module in
    *.ko) printf 'insmod %s\n' "$module" ;;
    *) modprobe -d "$tree" -S "$version" --show-depends "$module" ;;
    esac
  done | awk '$1 == "insmod" && !seen[$2]++ { print $2 }' | while read -r module; do
    cp "$module" "$stage/modules/"
    printf '/modules/%s\n' "${module##*/}" >>"$stage/modules/order"
  done
  (cd "$stage" && find . | cpio -o -H newc --quiet | gzip -1) >"$output"
}

# tally_console FILE...: prints what failed and "N passed, N failed"; a suite that does not finish is a failure.
tally_console() {
  local passed failed
  cat "$@" | tr -d '\r' | grep -E '^VM: |^\[  FAILED  \]|Failure$|Kernel panic|Oops|BUG:' >&2 || true
  read -r passed failed < <(cat "$@" | tr -d '\r' | awk '
    /^VM: running/ { begun++ }
    /^\[==========\] .* ran\./ { ended++ }
    /^\[  PASSED  \] [0-9]+ test/ { passed += $4 }
    /^ *[0-9]+ FAILED TEST/ { failed += $1 }
    /Kernel panic|Oops|BUG:|^VM: could not|^VM: no / { failed++ }
    END { if (begun == 0 || ended < begun) failed++; print passed + 0, failed + 0 }')
  printf '%s passed, %s failed\n' "$passed" "$failed"
  [ "$failed" -eq 0 ]
}
