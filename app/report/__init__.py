"""Reports on runs, from the files that they left behind: one run, or several side by side."""

from app.report.loading import LoadedRun, load_run
from app.report.pages import write_comparison, write_report
from app.report.tables import comparison_rows

__all__ = ["LoadedRun", "comparison_rows", "load_run", "write_comparison", "write_report"]
