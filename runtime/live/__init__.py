"""Live recognition: devices that come and go, with their newest frames joined, scored and decided on."""
