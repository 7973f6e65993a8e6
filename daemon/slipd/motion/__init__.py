"""Evidence that the object moves on the pad: one file for each kind, and one rule that combines them; pure."""
