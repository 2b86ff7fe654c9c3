"""What a diagnosis left open, as pairs of models."""
