"""The import arrows of ARCHITECTURE.md hold."""

from pathlib import Path

from importlinter.cli import lint_imports


def test_imports_run_downward_only(monkeypatch, capsys):
    monkeypatch.chdir(Path(__file__).parents[1])
    code = lint_imports(config_filename=".importlinter", no_cache=True)
    assert code == 0, capsys.readouterr().out
