"""Page of the drive study."""
