"""What strategies cost by counts and unit costs, with any linear solver, and which one is cheapest where."""
