# Sourced after setup.sh, foreign_apt.sh, vm_machine.sh and vm_kernel.sh: the SD card's image in a machine of the board's
# memory size. It is no BeagleBone: its loaders are not run, its kernel, initramfs and system are.
# shellcheck shell=bash disable=SC2154

card_image=$root/build/image/equipoise-bbb.img
card=$vm/card.img

# prepare_card: a copy to write to, larger than the image as a card is; its kernel; its initramfs with the peripherals.
prepare_card() {
  local extra=$vm/card.d file
  [ -f "$card_image" ] || die "no $card_image; run tools/image --no-login first"
  cp --sparse=always "$card_image" "$card"
  truncate -s +512M "$card"
  for file in vmlinuz initrd.img; do
    /sbin/debugfs -R "dump /boot/$file-$kernel_version $vm/card-$file" "$card_image?offset=$((4 << 20))" 2>/dev/null
    [ -s "$vm/card-$file" ] || die "$card_image holds no /boot/$file-$kernel_version; run tools/image again"
  done
  rm -rf "$extra"
  mkdir -p "$extra/scripts/local-bottom"
  install -m 755 "$root/tests/hardware/image/bench" "$extra/scripts/local-bottom/bench"
  printf '/scripts/local-bottom/bench "$@"\n' >"$extra/scripts/local-bottom/ORDER"
  (cd "$extra" && find scripts | cpio -o -H newc --quiet | gzip -1) >>"$vm/card-initrd.img"
}

# run_card SECONDS: the console on stdout.
run_card() {
  timeout --foreground "$1" qemu-system-arm -M virt,highmem=off -cpu cortex-a15 -m 512 -nographic -no-reboot -net none -icount shift=0,sleep=off \
    -kernel "$vm/card-vmlinuz" -initrd "$vm/card-initrd.img" \
    -append "root=LABEL=equipoise rootwait ro console=ttyAMA0 quiet panic=-1" \
    -drive "if=none,id=card,format=raw,file=$card" -device virtio-blk-pci,drive=card \
    -virtfs "local,path=$root,mount_tag=project,security_model=none,readonly=on,multidevs=remap" </dev/null
}
