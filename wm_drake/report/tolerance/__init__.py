"""Page of the tolerance study."""
