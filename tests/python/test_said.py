"""What commands say, line by line, and the keys of their JSON; numbers are # and folders are left out."""

import json
import re

from driven import equipoise


def plain(text: str) -> str:
    text = re.sub(r"[-+]?(\d+\.?\d*|\.\d+)(e[-+]?\d+)?", "#", text)
    return "\n".join(" ".join(line.split()) for line in text.splitlines() if line.strip())


def paths(value, at="") -> set[str]:
    """Keys with those above them; of a list, its first element's."""
    if isinstance(value, list):
        return paths(value[0], at) if value else set()
    if not isinstance(value, dict):
        return set()
    return {at + key for key in value}.union(*(paths(each, f"{at}{key}.") for key, each in value.items()))


def said(root, folder, command: str) -> str:
    """@: in the test's folder; --json @: its keys are the last line."""
    words = [str(root / word) if word.startswith("config/") else word for word in command.split()]
    ended = equipoise(
        root, *(str(folder / (word[1:] or "json")) if word[0] == "@" else word for word in words)
    )
    text = (ended.stdout + ended.stderr).replace(f"{root}/", "").replace(f"{folder}/", "")
    lines = plain(text)
    if (folder / "json").exists():
        lines += "\n{" + " ".join(sorted(paths(json.loads((folder / "json").read_text())))) + "}"
        (folder / "json").unlink()
    return lines.strip()


def test_is_as_in_the_table(root, tmp_path):
    """tests/data/said.txt: commands, of which later ones read what earlier ones wrote."""
    table = re.split(r"^\$ (.*)\n", (root / "tests/data/said.txt").read_text(), flags=re.M)
    for command, text in zip(table[1::2], table[2::2], strict=True):
        assert said(root, tmp_path, command).splitlines() == text.strip().splitlines(), command
