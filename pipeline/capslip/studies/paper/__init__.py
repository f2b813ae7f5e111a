"""The paper again: what it prints, what is wrong in it, its tables and figures."""
