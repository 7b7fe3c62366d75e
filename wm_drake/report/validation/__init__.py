"""Validation page in Markdown: docs/validation.md."""
