"""Reports of a run whose name and description come from outside."""

import re

from app.formats import read_run, write_run
from app.report import write_report
from walkcore.scenario.recording import record
from walkcore.scenario.scenario import scenario_from_mapping

HOSTILE = (
    "<img src=x onerror=alert(1)> [click](javascript:alert(1)) `code` | cell\n\n# heading & <script>alert(2)</script>"
)


def test_names_and_descriptions_are_text_in_markdown_and_html(tmp_path):
    scenario = {"name": HOSTILE, "description": HOSTILE, "robot": "hrp2", "duration": 1.0}
    write_run(record(scenario_from_mapping(scenario)), tmp_path / "run", ("npz",))
    for page in write_report(read_run(tmp_path / "run"), tmp_path / "report"):
        text = page.read_text(encoding="utf-8")
        assert "alert(1)" in text
        assert not re.search("<img|<script", text), page.name
        if page.suffix == ".md":
            assert "](javascript" not in text and "# heading" not in re.findall("^#.*$", text, re.MULTILINE)
