"""What all schemes share: work arrays, criteria, accelerations at one time, tangents of steps."""
