"""Files: small ones read whole, results written whole or not at all, JSON Schema of types."""
