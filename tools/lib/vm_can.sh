# Sourced after setup.sh, foreign_apt.sh and vm_machine.sh: a PC with two CAN controllers on one bus.
# It runs programs of this machine from this machine's root, so this machine must be amd64.
# shellcheck shell=bash disable=SC2154

can_tree=$vm/can-kernel
can_modules=$vm/can-modules

# prepare_can_machine: sets can_kernel_version.
prepare_can_machine() {
  local image version stamp=$vm/can-kernel.stamp
  [ "$(dpkg --print-architecture)" = amd64 ] || die "the CAN machine needs an amd64 host"
  if [ ! -f "$stamp" ] || [ ! -d "$vm/can-headers" ]; then
    image=$(package_of bookworm amd64 linux-image-amd64)
    version=${image#linux-image-}
    download_only amd64 "$image" "linux-headers-$version" "linux-headers-${version%-amd64}-common" linux-kbuild-6.1 \
      busybox-static
    rm -rf "$can_tree" "$vm/can-headers"
    unpack "$can_tree" "$debs/${image}"_*_amd64.deb "$debs"/busybox-static_*_amd64.deb
    unpack "$vm/can-headers" "$debs/linux-headers-${version%-amd64}"{-amd64,-common}_*.deb \
      "$debs"/linux-kbuild-6.1_*_amd64.deb
    printf '%s\n' "$version" >"$stamp"
  fi
  can_kernel_version=$(cat "$stamp")
  build_can_modules
  make_initramfs "$can_tree" "$can_kernel_version" "$root/tests/hardware/canbus/init" "$vm/can-initramfs.gz" \
    virtio_pci 9p 9pnet_virtio can-raw kvaser_pci "$can_modules/can_errors.ko"
}

build_can_modules() {
  local source=$root/tests/hardware/kernel/can wanted stamp=$can_modules/stamp
  wanted=$(cat "$source"/*)" $can_kernel_version"
  [ "$(cat "$stamp" 2>/dev/null)" != "$wanted" ] || return 0
  prepare_source
  rm -rf "$can_modules"
  mkdir -p "$can_modules"
  cp "$source"/* "$vm/source-bookworm/drivers/net/can/sja1000/sja1000.h" "$can_modules/"
  make_modules "$vm/can-headers" "$can_kernel_version" "$can_modules"
  printf '%s\n' "$wanted" >"$stamp"
}

# run_can_machine SECONDS PROGRAM: the console on stdout.
run_can_machine() {
  timeout --foreground "$1" qemu-system-x86_64 -M q35 -cpu max -smp 2 -m 512 -nographic -no-reboot -net none \
    -object can-bus,id=bus -device kvaser_pci,canbus=bus -device kvaser_pci,canbus=bus \
    -kernel "$can_tree/boot/vmlinuz-$can_kernel_version" -initrd "$vm/can-initramfs.gz" \
    -append "console=ttyS0 quiet panic=-1 run=$2" \
    -virtfs "local,path=/,mount_tag=host,security_model=none,readonly=on,multidevs=remap" </dev/null
}
