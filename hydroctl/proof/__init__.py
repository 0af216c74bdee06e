"""What was shown of a schedule, and what was not."""
