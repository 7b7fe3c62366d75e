"""Page of the steady unbalance response."""
