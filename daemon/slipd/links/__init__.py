"""Links: from which device a reading comes, when it was acquired, and what is wrong with a line; pure."""
