"""All keys that a study may have, composed from the installed plugins."""
