"""The paper: its tables as data, and its figures remade."""
