"""Questions that a diagnosis left open, as pairs of models."""
