"""The next tests, chosen for their information before the rig is booked."""
