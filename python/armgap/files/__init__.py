"""Files: bounded reading of small files, atomic writing of results, JSON Schema of types."""
