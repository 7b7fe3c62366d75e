"""Page of the design study."""
