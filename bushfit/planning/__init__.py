"""Which test next: tests chosen for what they would tell, before the rig is booked."""
