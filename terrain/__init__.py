"""What robots walk on: height and normal as functions of place, declared shapes, files of the user's own."""
