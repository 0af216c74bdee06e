"""The regulator law printed to other languages from its own source."""
