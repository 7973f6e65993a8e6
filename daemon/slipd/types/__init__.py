"""Small types that several rooms share."""
