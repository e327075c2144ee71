"""Models on their way to a build: collapsed to score tables, compared with their integers, and judged under faults."""
