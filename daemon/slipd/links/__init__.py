"""Links: from which device a reading comes, and when it was acquired; pure."""
