"""Live recognition: devices that come and go, their newest frames joined, scored and decided upon."""
