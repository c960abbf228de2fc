"""The papers that are tested here."""
