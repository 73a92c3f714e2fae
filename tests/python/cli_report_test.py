"""`diffnea report` on runs, and on folders that are none."""

import shutil
from pathlib import Path

from cli import BAD_INPUT, DONE, diffnea, done


def test_report_builds_the_same_page_again(run: Path, tmp_path: Path) -> None:
    copy = tmp_path / "copy"
    shutil.copytree(run, copy)
    (copy / "report.html").unlink()
    (copy / "model.json").unlink()
    done("report", copy)
    assert (copy / "report.html").read_bytes() == (run / "report.html").read_bytes()


def test_report_says_that_there_is_nothing_to_draw(run: Path, tmp_path: Path) -> None:
    copy = tmp_path / "copy"
    shutil.copytree(run, copy)
    (copy / "series.json").unlink()
    answer = diffnea("report", copy)
    assert answer.returncode == DONE
    assert "series.json" in answer.stderr
    assert "series.json" in (copy / "report.html").read_text(encoding="utf-8")


def test_report_refuses_a_folder_that_is_no_run(tmp_path: Path) -> None:
    answer = diffnea("report", tmp_path)
    assert answer.returncode == BAD_INPUT
    assert "result.json" in answer.stderr


def test_report_refuses_a_result_that_is_broken(run: Path, tmp_path: Path) -> None:
    for text in ("{", '{"schema": "diffnea/other/1"}', '{"schema": "diffnea/identify/1"}', "[]"):
        (tmp_path / "result.json").write_text(text)
        answer = diffnea("report", tmp_path)
        assert answer.returncode == BAD_INPUT, text
        assert str(tmp_path / "result.json") in answer.stderr
