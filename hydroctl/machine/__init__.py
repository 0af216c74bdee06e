"""Facts of a machine: its parameters, data sheets, units, and what it varies by. No equations."""
