"""The commands for who writes plugins: new, check."""
