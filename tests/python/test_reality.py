"""docs/reports/reality.md: what the firmware would have done beside real robots."""

import json

from equipoise_tools import reality


def test_the_page_comes_from_its_data(root):
    data = json.loads((root / reality.DATA).read_text())
    assert (root / reality.PAGE).read_text() == reality.page_of(data, reality.maps_of(root))


def test_a_log_that_is_another_version_is_named_and_not_taken(tmp_path, capsys):
    source = {"repository": "a/b", "path": "log.csv", "commit": "c0ffee", "sha256": "0" * 64}
    assert reality.found(tmp_path, source) is None
    (tmp_path / "a+b").mkdir()
    (tmp_path / "a+b/log.csv").write_text("t\n")
    assert reality.found(tmp_path, source) is None
    assert "another version than commit c0ffee" in capsys.readouterr().err


def test_without_a_log_nothing_is_written_anew(tmp_path, monkeypatch, capsys):
    monkeypatch.setattr("sys.argv", ["tools/reality", str(tmp_path)])
    assert reality.main() == 1
    told = capsys.readouterr()
    assert told.out == "" and "holds none of the logs of docs/reports/reality.md" in told.err
