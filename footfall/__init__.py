"""The command line: parses options and hands over to the room that a verb needs."""
