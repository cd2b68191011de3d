"""The checks as a table: what each promises, whether it holds, and what components are checked on."""
