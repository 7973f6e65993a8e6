"""From sensor samples to the pad frame: mounting, tare, charge, geometry; pure."""
