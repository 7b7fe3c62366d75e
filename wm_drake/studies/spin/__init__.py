"""Run the loads of a machine through its spin profile and collect what a report shows."""
