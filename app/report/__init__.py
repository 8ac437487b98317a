"""Reports on runs, from the files of their folders: one run, or several side by side."""

from app.report.pages import write_comparison, write_report
from app.report.tables import comparison_rows

__all__ = ["comparison_rows", "write_comparison", "write_report"]
