"""Forms of a report: HTML, Markdown, notebook, terminal, replay."""
