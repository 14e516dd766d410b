# Sourced after setup.sh, foreign_apt.sh and vm_machine.sh: a PC with two CAN controllers on one bus.
# It runs programs of this machine from this machine's root, so this machine must be amd64.
# shellcheck shell=bash disable=SC2154

can_tree=$vm/can-kernel

# prepare_can_machine: sets can_kernel_version.
prepare_can_machine() {
  local image stamp=$vm/can-kernel.stamp
  [ "$(dpkg --print-architecture)" = amd64 ] || die "the CAN machine needs an amd64 host"
  if [ ! -f "$stamp" ]; then
    image=$(image_of amd64 linux-image-amd64)
    download_only amd64 "$image" busybox-static
    rm -rf "$can_tree"
    unpack "$can_tree" "$vm/debs/${image}"_*_amd64.deb "$vm/debs"/busybox-static_*_amd64.deb
    printf '%s\n' "${image#linux-image-}" >"$stamp"
  fi
  can_kernel_version=$(cat "$stamp")
  make_initramfs "$can_tree" "$can_kernel_version" "$root/tests/hardware/canbus/init" "$vm/can-initramfs.gz" \
    virtio_pci 9p 9pnet_virtio can-raw kvaser_pci
}

# run_can_machine SECONDS PROGRAM: the console on stdout.
run_can_machine() {
  timeout "$1" qemu-system-x86_64 -M q35 -cpu max -smp 2 -m 512 -nographic -no-reboot -net none \
    -object can-bus,id=bus -device kvaser_pci,canbus=bus -device kvaser_pci,canbus=bus \
    -kernel "$can_tree/boot/vmlinuz-$can_kernel_version" -initrd "$vm/can-initramfs.gz" \
    -append "console=ttyS0 quiet panic=-1 run=$2" \
    -virtfs "local,path=/,mount_tag=host,security_model=none,readonly=on,multidevs=remap" </dev/null
}
