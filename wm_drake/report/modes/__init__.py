"""Page of the modes of a machine."""
