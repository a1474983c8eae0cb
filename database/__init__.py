"""What has been learnt: tables, store and the planner's snapshot."""
