# Sourced after setup.sh, foreign_apt.sh, vm_machine.sh, vm_kernel.sh and overlays.sh: the real pinctrl-single and gpio-omap
# with the pads of real boards' trees under our overlays, and under faults of the past.
# shellcheck shell=bash disable=SC2154

pads=$vm/pads

# pads_machine NAME BOARD.dtb OVERLAY.dtbo...: the machine's tree, in build/vm/pads.
pads_machine() {
  local name=$1 board=$2
  shift 2
  fdtoverlay -i "$board" -o "$pads/$name-board.dtb" "$@"
  "$venv_python" "$root/tests/hardware/pads/graft.py" "$pads/qemu.dtb" "$pads/$name-board.dtb" >"$pads/$name.dts"
  dtc -q -I dts -O dtb -o "$pads/$name.dtb" "$pads/$name.dts"
}

# prepare_pads: machines by what is expected of them: good-* hold, fault-* must be found.
prepare_pads() {
  local cells overlay
  rm -rf "$pads"
  mkdir -p "$pads"
  # Memory of this size ends above the AM335x's registers, and the loader's initramfs begins below.
  qemu-system-arm -M "virt,highmem=off,dumpdtb=$pads/qemu.dtb" -cpu cortex-a15 -m 192 -nographic 2>/dev/null
  for cells in 1 2; do
    for overlay in cape no-hdmi can; do compile_overlay "$overlay" "$cells" "$pads/$overlay-$cells.dtbo"; done
  done
  for overlay in "$root"/tests/hardware/pads/*.dtso; do
    dtc -q -@ -I dts -O dtb -o "$pads/$(basename "$overlay" .dtso).dtbo" "$overlay"
  done
  dtc -q -@ -I dts -O dtb -o "$pads/beagle.dtb" "$root/tests/data/device_tree/beagle-5.10-boneblack.dts"
  board_tree bookworm boneblack "$pads/debian.dtb"
  pads_machine good-debian "$pads/debian.dtb" "$pads"/{cape-2,no-hdmi-2}.dtbo
  pads_machine good-debian-can "$pads/debian.dtb" "$pads"/{cape-2,no-hdmi-2,can-2}.dtbo
  pads_machine good-beagle "$pads/beagle.dtb" "$pads/cape-1.dtbo"
  pads_machine fault-first-bank "$pads/debian.dtb" "$pads"/{first-bank,no-hdmi-2}.dtbo
  pads_machine fault-wrong-twin "$pads/beagle.dtb" "$pads/cape-2.dtbo"
}

# run_pads SECONDS MACHINE BUILD SYSROOT: the console on stdout.
run_pads() {
  timeout --foreground "$1" qemu-system-arm -M virt,highmem=off -cpu cortex-a15 -m 192 -nographic -no-reboot -net none \
    -icount shift=0,sleep=off -dtb "$pads/$2.dtb" \
    -kernel "$kernel_tree/boot/vmlinuz-$kernel_version" -initrd "$vm/pads-initramfs.gz" \
    -append "console=ttyAMA0 quiet panic=-1 machine=$2 build=/mnt/$3 sysroot=/mnt/$4" \
    -virtfs "local,path=$root,mount_tag=project,security_model=none,readonly=on,multidevs=remap" </dev/null
}
