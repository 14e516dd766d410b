# Sourced after setup.sh, foreign_apt.sh and vm_machine.sh: a PREEMPT_RT kernel from Debian for QEMU, and the modules it lacks.
# Everything lands in build/vm. Versions come from the archive, none is written here.
# shellcheck shell=bash disable=SC2154

# use_kernel ARCHITECTURE: armhf, which holds without a call, or arm64 (the processor is that of the AM62).
use_kernel() {
  kernel_for=$1
  case $1 in
  armhf) flavour=rt-armmp arch=arm triple=arm-linux-gnueabihf emulated=(qemu-system-arm -M "virt,highmem=off" -cpu cortex-a15) ;;
  arm64) flavour=rt-arm64 arch=arm64 triple=aarch64-linux-gnu emulated=(qemu-system-aarch64 -M virt -cpu cortex-a53) ;;
  esac
  debs=$vm/debs-$1          # what download_only brings
  kernel_tree=$vm/kernel-$1 # lib/modules/VERSION, boot/
  kernel_headers=$vm/headers-$1
  modules_built=$vm/modules-$1
}
use_kernel armhf

# prepare_kernel: sets kernel_version.
prepare_kernel() {
  local image version stamp=$kernel_tree.stamp
  if [ ! -f "$stamp" ] || [ ! -d "$debs" ]; then
    rm -rf "$debs" "$kernel_tree" "$kernel_headers"
    image=$(package_of bookworm "$kernel_for" "linux-image-$flavour")
    version=${image#linux-image-}
    download_only "$kernel_for" "$image" "linux-headers-$version" "linux-headers-${version%-"$flavour"}-common-rt" busybox-static
    download_only "$(dpkg --print-architecture)" linux-kbuild-6.1
    unpack "$kernel_tree" "$debs/${image}"_*.deb "$debs"/busybox-static_*.deb
    unpack "$kernel_headers" "$debs"/linux-headers-*.deb "$debs"/linux-kbuild-*.deb
    printf '%s\n' "$version" >"$stamp"
  fi
  prepare_source
  kernel_version=$(cat "$stamp")
}

# Debian's kernel has no counter subsystem, no gpio-sim and no dummy of IIO; they build as modules against its headers.
collect_module_sources() {
  local drivers=$vm/source-bookworm/drivers
  mkdir -p "$modules_built"
  cp "$drivers"/counter/counter-{core,sysfs,chrdev}.c "$drivers"/counter/counter-*.h "$modules_built/"
  cp "$drivers"/iio/{*.c,dummy/iio_simple_dummy*.[ch],trigger/iio-trig-sysfs.c} "$modules_built/"
  cp "$drivers"/gpio/gpio-sim.c "$drivers"/gpio/gpiolib.h "$modules_built/"
  cp "$vm/source-bookworm/kernel/irq/irq_sim.c" "$drivers/watchdog/i6300esb.c" "$modules_built/"
  cp "$root"/tests/hardware/kernel/{Kbuild,*.[ch]} "$modules_built/"
  # What irq_sim calls is exported to built-in code only; this is its exported equivalent.
  sed -i 's/handle_simple_irq(irq_to_desc(irqnum))/generic_handle_irq(irqnum)/' "$modules_built/irq_sim.c"
  printf 'MODULE_LICENSE("GPL");\n' >>"$modules_built/irq_sim.c"
}

make_target_modules() { # DIRECTORY
  # The host's modpost cannot read the target's tables.
  sed -i '/MODULE_DEVICE_TABLE/d' "$1"/*.c
  make_modules "$kernel_headers" "$kernel_version" "$1" ARCH="$arch" CROSS_COMPILE="$triple-" \
    DEB_BUILD_ARCH="$(dpkg --print-architecture)" DEB_HOST_ARCH="$kernel_for" DEB_HOST_GNU_TYPE="$triple"
}

build_modules() {
  local stamp=$modules_built/stamp wanted
  wanted=$(cat "$root"/tests/hardware/kernel/{Kbuild,*.[ch]} "$root/tools/lib/vm_kernel.sh" | sha256sum)" $kernel_version"
  [ "$(cat "$stamp" 2>/dev/null)" = "$wanted" ] && return 0
  rm -rf "$modules_built"
  collect_module_sources
  make_target_modules "$modules_built"
  printf '%s\n' "$wanted" >"$stamp"
}

# run_hang SECONDS TIMEOUT: a machine whose kernel is made to hang, with QEMU's watchdog set to TIMEOUT by a program; the
# console is on stdout, and at its end how it ended.
run_hang() {
  local seconds=$1 asked=$2 status=0
  timeout --foreground "$seconds" "${emulated[@]}" -m 256 -nographic -no-reboot -net none \
    -icount shift=0,sleep=off -device i6300esb -action watchdog=reset \
    -kernel "$kernel_tree/boot/vmlinuz-$kernel_version" -initrd "$vm/hang-initramfs.gz" \
    -append "console=ttyAMA0 quiet panic=-1 watchdog=$asked" </dev/null >"$vm/console-hang.raw" || status=$?
  cat "$vm/console-hang.raw"
  judge_hang "$status" "$asked" <"$vm/console-hang.raw"
}

# judge_hang STATUS TIMEOUT: of the machine and its console on stdin. It hung, and was reset in the watchdog's time.
judge_hang() {
  local hung
  hung=$(tr -d '\r' | sed -n 's/^HUNG //p' | tail -n 1)
  echo "VM: running the hang's judgement"
  if [ "$1" -eq 0 ] && [ -n "$hung" ] && [ "$hung" -le "$2" ]; then
    printf '[       OK ] a kernel that hangs is reset within %s s\n[==========] 1 test ran.\n[  PASSED  ] 1 test.\n' "$2"
  else
    printf '[  FAILED  ] reset within %s s: hung for %s s, QEMU ended with %s\n[==========] 1 test ran.\n 1 FAILED TEST\n' \
      "$2" "${hung:-no}" "$1"
  fi
}

# run_machine SECONDS ARGUMENT...: boots; the arguments go to tests/hardware/init. The console is on stdout.
# Its clock counts instructions, one per ns: deadlines hold however slow or busy this machine is, and idling is free.
run_machine() {
  timeout --foreground "$1" "${emulated[@]}" -m 512 -nographic -no-reboot -net none \
    -icount shift=0,sleep=off \
    -kernel "$kernel_tree/boot/vmlinuz-$kernel_version" -initrd "$vm/initramfs.gz" \
    -append "console=ttyAMA0 quiet panic=-1 ${*:2}" \
    -virtfs "local,path=$root,mount_tag=project,security_model=none,readonly=on,multidevs=remap" </dev/null
}
