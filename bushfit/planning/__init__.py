"""Plan the next tests by their information, before the rig is booked."""
