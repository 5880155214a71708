"""Pictures of robots: from above and from behind, their circles, films of schedules."""
