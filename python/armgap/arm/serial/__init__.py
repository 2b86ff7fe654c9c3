"""Serial arms: their chain, their arm files, and how far nominal values are trusted."""
