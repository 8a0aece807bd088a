"""The commands, one file each. A command imports the room that it needs when it runs, not before."""
