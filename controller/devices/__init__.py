"""The devices of a bench as the loop holds them: opened, their health and states, lost and back."""
