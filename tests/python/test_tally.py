"""The last line of tools/test: what counts as passed, failed and skipped."""

from equipoise_tools import tally

CTEST = """<testsuite>
<testcase name="A.Passes" status="run"/>
<testcase name="A.Fails" status="fail"><failure message="Failed"/></testcase>
<testcase name="A.Skips" status="notrun"><skipped message="SKIP_REGULAR_EXPRESSION_MATCHED"/>
<system-out>tests/unit/a.cpp:7: Skipped
no multicast here

[  SKIPPED ] A.Skips</system-out></testcase>
<testcase name="A.Missing" status="notrun"><skipped message="Unable to find executable"/></testcase>
</testsuite>"""
PYTEST = """<testsuites><testsuite>
<testcase classname="t" name="one"/>
<testcase classname="t" name="two"><error message="x"/></testcase>
<testcase classname="t" name="three"><skipped message="because"/></testcase>
</testsuite></testsuites>"""


def test_both_reports_are_counted_and_reasons_kept(tmp_path, capsys):
    (tmp_path / "c.xml").write_text(CTEST)
    (tmp_path / "p.xml").write_text(PYTEST)
    assert tally.main([f"ctest=8={tmp_path}/c.xml", f"pytest=1={tmp_path}/p.xml"]) == 1
    lines = capsys.readouterr().out.splitlines()
    assert lines[-1] == "2 passed, 3 failed"
    assert "skipped: ctest: A.Skips: no multicast here" in lines
    assert "skipped: pytest: three: because" in lines
    assert {line for line in lines if line.startswith("failed")} == {
        "failed:  ctest: A.Fails",
        "failed:  ctest: A.Missing",
        "failed:  pytest: two",
    }


def test_all_passed_is_success(tmp_path, capsys):
    (tmp_path / "c.xml").write_text('<testsuite><testcase name="A" status="run"/></testsuite>')
    assert tally.main([f"ctest=0={tmp_path}/c.xml"]) == 0
    assert capsys.readouterr().out == "1 passed, 0 failed\n"


def test_a_program_that_left_no_report_or_failed_silently_is_a_failure(tmp_path, capsys):
    (tmp_path / "c.xml").write_text('<testsuite><testcase name="A" status="run"/></testsuite>')
    assert tally.main([f"ctest=8={tmp_path}/c.xml", f"pytest=2={tmp_path}/missing.xml"]) == 1
    lines = capsys.readouterr().out.splitlines()
    assert lines[-1] == "1 passed, 2 failed"
    assert "failed:  pytest: ended with status 2 and left no report" in lines
