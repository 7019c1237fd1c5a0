"""What one trial says, whoever made it: where the tip touched, and how good the recording is."""
