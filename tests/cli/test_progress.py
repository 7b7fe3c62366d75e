"""Test of the progress bar."""

from wm_drake.report import progress as progress_module
from wm_drake.report.terminal import Console


def test_progress_bar_counts_up_to_the_total_on_standard_error(monkeypatch, capsys):
    monkeypatch.setattr(
        progress_module,
        "Console",
        lambda **options: Console(**options, force_terminal=True, width=100),
    )
    with progress_module.progress_bar(40, "machines") as progress:
        progress(10)
        progress(40)
    seen = capsys.readouterr()
    assert "machines" in seen.err
    assert "40/40" in seen.err
    assert seen.out == ""
