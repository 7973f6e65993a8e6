"""Both fingers as one grasp; pure."""
