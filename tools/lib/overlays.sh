# Sourced after setup.sh: device-tree overlays of packaging/ as the boot loader takes them.
# shellcheck shell=bash disable=SC2154

# compile_overlay NAME CELLS OUTPUT: for a pin controller with that many #pinctrl-cells.
compile_overlay() {
  cpp -nostdinc -undef -x assembler-with-cpp -P -DPINCTRL_CELLS="$2" -I "$root/packaging" \
    "$root/packaging/equipoise-$1.dts" | dtc -q -@ -I dts -O dtb -o "$3" -
}
