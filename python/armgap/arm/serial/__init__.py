"""Serial arms: their chain, their arm files, and default standard deviations of their nominal values."""
