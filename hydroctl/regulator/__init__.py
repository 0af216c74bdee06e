"""The regulator: its law, structures, forms and tables, whatever the machine."""
