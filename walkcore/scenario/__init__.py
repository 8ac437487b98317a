"""Scripted walks, their recordings, and recordings replayed."""
