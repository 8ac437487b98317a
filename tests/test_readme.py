import re
from pathlib import Path

README = (Path(__file__).parent.parent / "README.md").read_text(encoding="utf-8")


def test_the_code_in_the_readme_runs(capsys):
    (code,) = re.findall(r"```python\n(.*?)```", README, flags=re.DOTALL)
    exec(compile(code, "README.md", "exec"), {})
    assert capsys.readouterr().out.strip().endswith("SOLVED")


def test_every_file_that_the_readme_names_exists():
    root = Path(__file__).parent.parent
    for target in re.findall(r"\]\(([^)#:]+)\)", README):
        assert (root / target).exists(), target
    modules = re.findall(r"^\| (`[a-z_/`, ]+`) \|", README, flags=re.MULTILINE)
    names = [name for cell in modules for name in re.findall(r"[a-z_/]+", cell)]
    assert all((root / "walkcore" / f"{name}.py").exists() for name in names)
    assert len(names) > 12
