"""Page of the orders of a record."""
