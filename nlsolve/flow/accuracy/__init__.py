"""How accurate a solved flow is: clouds with more nodes, and the error that a solution on them shows."""
