"""What a run leaves on disk: events, report, trajectory and video."""
