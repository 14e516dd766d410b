"""A machine with a BeagleBone's pads: what of a board's merged tree is about them, in QEMU's own tree.

    python graft.py QEMU.dtb BOARD.dtb >machine.dts

The real pinctrl-single and gpio-omap bind at the addresses they have on the AM335x; there QEMU has memory,
which is taken away from the kernel. Whoever else claims pads is a bus without devices at their addresses.
"""

import re
import subprocess
import sys
from pathlib import Path

from equipoise_tools import device_tree

PINMUX = 0x44E10800
GPIO = {0x44E07000: 40, 0x4804C000: 41, 0x481AC000: 42, 0x481AE000: 43}  # interrupts that QEMU leaves free
REGISTERS = [(0x44E00000, 0x100000), (0x48000000, 0x400000)]


def address_of(node: device_tree.Node) -> int | None:
    """Through the ranges of the interconnect, which add up: child address, parent address, size."""
    cells = node.cells("reg")
    if not cells or node.parent is None or not node.parent.cells("#address-cells"):
        return None
    at, bus = cells[0], node.parent
    while bus is not None:
        ranges = bus.cells("ranges")
        for i in range(0, len(ranges) - 2, 3):
            if ranges[i] <= at < ranges[i] + ranges[i + 2]:
                at += ranges[i + 1] - ranges[i]
                break
        bus = bus.parent
    return at


def hexes(values: list[int]) -> str:
    return " ".join(f"{value:#x}" for value in values)


def grafted(board: device_tree.Node) -> str:
    controller = device_tree.pin_controller(board)
    groups = "".join(
        f"{group.path.rsplit('/', 1)[1]} {{ phandle = <{hexes(group.cells('phandle'))}>; "
        f"pinctrl-single,pins = <{hexes(group.cells('pinctrl-single,pins'))}>; }};\n"
        for group in controller.children.values()
        if group.cells("phandle")
    )

    def state(node):
        claimed = node.cells("pinctrl-0")
        return f'pinctrl-names = "default"; pinctrl-0 = <{hexes(claimed)}>; ' if claimed else ""

    out = [
        f'pinmux@800 {{ compatible = "pinctrl-single"; reg = <0 {PINMUX:#x} 0 0x238>; '
        f"#pinctrl-cells = <{controller.cells('#pinctrl-cells')[0]}>; pinctrl-single,register-width = <32>; "
        f"pinctrl-single,function-mask = <0x7f>; {state(controller)}\n{groups}}};"
    ]
    by_address = {address: node for node in board.walk() if (address := address_of(node)) in GPIO}
    for address, interrupt in GPIO.items():
        bank = by_address.get(address)
        out.append(
            f'gpio@{address:x} {{ compatible = "ti,omap4-gpio"; reg = <0 {address:#x} 0 0x1000>; '
            f"interrupts = <0 {interrupt} 4>; gpio-controller; #gpio-cells = <2>; interrupt-controller; "
            f"#interrupt-cells = <2>; {state(bank) if bank else ''}}};"
        )
    for node in board.walk():
        if not node.enabled or not node.cells("pinctrl-0") or node in (controller, *by_address.values()):
            continue
        name, address = node.path.rsplit("/", 1)[1].split("@")[0], address_of(node)
        unit, reg = (f"@{address:x}", f"reg = <0 {address:#x} 0 0x80>; ") if address else ("", "")
        buses = "#address-cells = <1>; #size-cells = <1>; ranges = <0 0 0 0>;"
        out.append(f'{name}{unit} {{ compatible = "simple-pm-bus"; {reg}{buses} {state(node)}}};')
    chosen = board.children["chosen"].children.get("overlays")
    kinds = "".join(f'{name} = "{chosen.text(name)}"; ' for name in chosen.properties) if chosen else ""
    out.append(f"chosen {{ overlays {{ {kinds}}}; }};")
    reserved = "".join(
        f"memory@{at:x} {{ reg = <0 {at:#x} 0 {size:#x}>; no-map; }};\n" for at, size in REGISTERS
    )
    out.append(f"reserved-memory {{ #address-cells = <2>; #size-cells = <2>; ranges;\n{reserved}}};")
    return "\n".join(out)


def main() -> None:
    qemu, board = (Path(argument) for argument in sys.argv[1:3])
    decompile = ["dtc", "-q", "-I", "dtb", "-O", "dts", qemu]
    machine = subprocess.run(decompile, capture_output=True, text=True, check=True).stdout
    machine = re.sub(
        r'\tmodel = "[^"]*";', '\tmodel = "TI AM335x BeagleBone Black (pads)";', machine, count=1
    )
    print(machine + "\n/ {\n" + grafted(device_tree.read(board)) + "\n};")


if __name__ == "__main__":
    main()
