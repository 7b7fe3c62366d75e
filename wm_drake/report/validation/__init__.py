"""Pages in Markdown: docs/verification.md, docs/validation.md and docs/prediction.md."""
