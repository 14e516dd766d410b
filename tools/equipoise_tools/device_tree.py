"""Flattened device trees: which enabled device claims which pads, and whether two claim the same.

    python -m equipoise_tools.device_tree TREE.dtb...            exit status 1 and one line per finding
    python -m equipoise_tools.device_tree --pads TREE.dtb        source of what of a tree is about pads
    python -m equipoise_tools.device_tree --modules FILE TREE... kernel modules that its devices need

Format: devicetree specification 0.4, chapter 5; rows of pads: pinctrl-single's binding.
"""

from __future__ import annotations

import argparse
import re
import struct
import sys
from collections import defaultdict
from dataclasses import dataclass, field
from pathlib import Path

from equipoise_tools.paths import UserError, repository_root

BEGIN_NODE, END_NODE, PROPERTY, NOP, END = 1, 2, 3, 4, 9


@dataclass
class Node:
    path: str
    parent: Node | None
    properties: dict[str, bytes] = field(default_factory=dict)
    children: dict[str, Node] = field(default_factory=dict)

    def text(self, name: str) -> str:
        return self.properties.get(name, b"").split(b"\0")[0].decode()

    def cells(self, name: str) -> list[int]:
        value = self.properties.get(name, b"")
        return list(struct.unpack(f">{len(value) // 4}I", value[: len(value) // 4 * 4]))

    @property
    def enabled(self) -> bool:
        own = self.text("status") in ("", "okay", "ok")
        return own and (self.parent is None or self.parent.enabled)

    def walk(self):
        yield self
        for child in self.children.values():
            yield from child.walk()


def parse(blob: bytes) -> Node:
    if len(blob) < 40 or struct.unpack_from(">I", blob)[0] != 0xD00DFEED:
        raise UserError("not a flattened device tree")
    at, strings = struct.unpack_from(">II", blob, 8)
    root = node = Node("/", None)
    depth = 0
    while True:
        (token,) = struct.unpack_from(">I", blob, at)
        at += 4
        if token == BEGIN_NODE:
            end = blob.index(b"\0", at)
            name = blob[at:end].decode()
            at = (end + 4) & ~3
            depth += 1
            if depth > 1:
                child = Node(node.path.rstrip("/") + "/" + name, node)
                node.children[name] = child
                node = child
        elif token == END_NODE:
            depth -= 1
            node = node.parent or node
        elif token == PROPERTY:
            length, name_at = struct.unpack_from(">II", blob, at)
            name = blob[strings + name_at : blob.index(b"\0", strings + name_at)].decode()
            node.properties[name] = blob[at + 8 : at + 8 + length]
            at = (at + 8 + length + 3) & ~3
        elif token == END:
            return root


@dataclass(frozen=True)
class Claim:
    pad: int  # offset in the pin controller
    configuration: int
    mode: int
    device: str
    group: str


def read(path: Path) -> Node:
    try:
        return parse(path.read_bytes())
    except (OSError, UserError) as error:
        raise UserError(f"{path}: {error}") from None


def pin_controller(root: Node) -> Node:
    found = [n for n in root.walk() if "#pinctrl-cells" in n.properties and n.text("compatible") != ""]
    found = [n for n in found if any("pinctrl-single,pins" in c.properties for c in n.children.values())]
    if len(found) != 1:
        raise UserError(f"{len(found)} pin controllers with groups of pads, expected one")
    return found[0]


def rows(group: Node, cells: int) -> list[tuple[int, int, int]]:
    """(pad, configuration, mode) as the kernel takes them; UserError when they do not fit."""
    values = group.cells("pinctrl-single,pins")
    size = cells + 1
    if len(values) % size != 0:
        raise UserError(f"{group.path}: {len(values)} cells are no rows of {size}")
    out = []
    for i in range(0, len(values), size):
        pad, rest = values[i], values[i + 1 : i + size]
        configuration, mode = (rest[0] & ~7, rest[0] & 7) if cells == 1 else rest
        # Pad control: mode 0-2, pulls and receiver 3-5, slew rate 6; the last pad is at 0x234.
        if pad % 4 != 0 or pad > 0x234 or configuration & ~0x78 or mode > 7:
            raise UserError(
                f"{group.path}: row {i // size} is no pad: {' '.join(hex(v) for v in [pad, *rest])}"
            )
        out.append((pad, configuration, mode))
    return out


def claims(root: Node) -> list[Claim]:
    """What the enabled devices claim in their default state, the pin controller's own hog among them."""
    cells = pin_controller(root).cells("#pinctrl-cells")[0]
    by_phandle = {n.cells("phandle")[0]: n for n in root.walk() if "phandle" in n.properties}
    found = []
    for device in root.walk():
        if not device.enabled:
            continue
        for phandle in device.cells("pinctrl-0"):
            group = by_phandle.get(phandle)
            if group is None or "pinctrl-single,pins" not in group.properties:
                continue
            found += [
                Claim(pad, configuration, mode, device.path, group.path)
                for pad, configuration, mode in rows(group, cells)
            ]
    return found


def conflicts(root: Node) -> dict[int, list[Claim]]:
    """Pads that more than one group claims: the later device does not probe."""
    owners = defaultdict(list)
    for claim in claims(root):
        owners[claim.pad].append(claim)
    return {pad: who for pad, who in sorted(owners.items()) if len(who) > 1}


def findings(root: Node) -> list[str]:
    try:
        return [
            f"pad 0x{pad:03x}: " + " and ".join(f"{c.device} ({c.group.split('/')[-1]})" for c in who)
            for pad, who in conflicts(root).items()
        ]
    except UserError as error:
        return [str(error)]


def overlay_labels() -> set[str]:
    """What our overlays and those of the tests refer to."""
    root = repository_root()
    overlays = [*root.glob("packaging/*.dts"), *root.glob("tests/data/device_tree/*.dtso")]
    return {label for overlay in overlays for label in re.findall(r"&(\w+)", overlay.read_text())}


def pads_only(root: Node, kept: set[str]) -> str:
    """Source of devices that claim pads or whose label is kept: their state, their groups."""
    symbols = root.children.get("__symbols__", Node("", None)).properties
    labels = {path.rstrip(b"\0").decode(): name for name, path in symbols.items() if name in kept}
    controller = pin_controller(root)
    used = {phandle for node in root.walk() for phandle in node.cells("pinctrl-0")}

    def is_group(node: Node) -> bool:
        return node.parent is controller

    def wanted(node: Node) -> bool:
        if is_group(node):
            return any(phandle in used for phandle in node.cells("phandle"))
        kept_path = node is controller or node.path == "/chosen"  # where overlays say that they are there
        return kept_path or "pinctrl-0" in node.properties or node.path in labels

    def emit(node: Node, depth: int) -> list[str]:
        inside = [line for child in node.children.values() for line in emit(child, depth + 1)]
        if not (wanted(node) or inside) or node.path == "/__symbols__":
            return []
        indent = "\t" * depth
        out = []
        for name in ("compatible", "status"):
            if name in node.properties and not is_group(node):
                out.append(f'{name} = "{node.text(name)}";')
        where = ("#address-cells", "#size-cells", "ranges", "reg")  # a device's address
        for name in (*where, "#pinctrl-cells", "phandle", "pinctrl-0", "pinctrl-single,pins"):
            if name in node.properties and (name != "phandle" or is_group(node)):
                cells = " ".join(hex(value) for value in node.cells(name))
                out.append(f"{name} = <{cells}>;" if cells else f"{name};")
        label = f"{labels[node.path]}: " if node.path in labels else ""
        name = node.path.split("/")[-1] or "/"
        body = [f"{indent}\t{line}" for line in out] + inside
        return [f"{indent}{label}{name} {{", *body, f"{indent}}};"]

    return "\n".join(["/dts-v1/;", *emit(root, 0)]) + "\n"


def drivers(root: Node, aliases: str) -> list[str]:
    """Kernel modules that the enabled devices ask for; `aliases`: text of modules.alias."""
    by_compatible = defaultdict(set)
    for line in aliases.splitlines():
        if match := re.match(r"alias of:N\*T\*C([^*]+)(?:C\*)? (\S+)$", line):
            by_compatible[match[1]].add(match[2])
    wanted = set()
    for node in root.walk():
        if node.enabled:
            for compatible in node.properties.get("compatible", b"").decode().split("\0"):
                wanted |= by_compatible.get(compatible, set())
    return sorted(wanted)


def main(arguments: list[str] | None = None) -> int:
    parser = argparse.ArgumentParser(prog="equipoise_tools.device_tree", description="pads of a device tree")
    parser.add_argument("--pads", action="store_true", help="print what of a tree is about pads")
    parser.add_argument("--modules", type=Path, help="modules.alias: print the modules that the trees need")
    parser.add_argument("trees", nargs="+", type=Path)
    asked = parser.parse_args(arguments)
    bad = 0
    try:
        if asked.modules:
            aliases = asked.modules.read_text()
            needed = {name for path in asked.trees for name in drivers(read(path), aliases)}
            print("\n".join(sorted(needed)))
            return 0
        for path in asked.trees:
            root = read(path)
            if asked.pads:
                sys.stdout.write(pads_only(root, overlay_labels()))
                continue
            for line in findings(root):
                bad += 1
                print(f"{path.name}: {line}")
    except UserError as error:
        print(f"error: {error}", file=sys.stderr)
        return 2
    return 1 if bad else 0


if __name__ == "__main__":
    sys.exit(main())
